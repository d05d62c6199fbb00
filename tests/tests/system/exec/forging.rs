//! What a program writes can neither steer a terminal nor forge lines of a log.

use system_tests::processes::nobody_is_left;

use super::stage::Stage;

/// A log line with a line break, an escape sequence and a bidirectional control, and raw bytes on the standard error.
const FORGER: &str = r#"
say '{"type":"log","text":"seen\n      1.0 s  simulator    forged\u001b[2J\u202e\u009b"}'
if is init; then
    printf 'raw\033[2J\rforged\302\233\n' >&2
fi"#;

fn has_controls(text: &str) -> bool {
    text.replace('\n', "").contains(char::is_control) || text.contains('\u{202e}')
}

#[test]
fn a_robot_forges_no_lines_and_steers_no_terminal() {
    let run = "exec-forging";
    let stage = Stage::each_tick(FORGER, "");
    let mut launch = stage.start(run, &["--speed", "10"]);
    launch.finish();
    nobody_is_left(run);

    let log = std::fs::read_to_string(stage.lab.file(run, "cars.log")).unwrap();
    let shown = stage.lab.ok(&["log", "--run", run]);
    let seen = r"Leguin       seen\n      1.0 s  simulator    forged\u{1b}[2J\u{202e}\u{9b}";
    for text in [&log, &shown, &launch.printed()] {
        assert!(text.contains(seen), "{text}");
        assert!(!has_controls(text), "{text:?}");
        let is_forged = |line: &str| line.trim_start().starts_with("1.0 s  simulator    forged");
        assert!(!text.lines().any(is_forged), "{text}");
    }
    let raw = r"Leguin: raw\u{1b}[2J\rforged\u{9b}";
    assert!(launch.printed().contains(raw), "{}", launch.printed());

    // The record is data.
    let events = String::from_utf8(stage.lab.bytes(run)).unwrap();
    assert!(
        events.contains(r"seen\n      1.0 s  simulator    forged\u001b[2J"),
        "{events}"
    );
}

#[test]
fn a_log_from_elsewhere_is_shown_escaped() {
    let run = "exec-planted";
    let stage = Stage::each_tick("", "");
    stage.start(run, &[]).finish();
    std::fs::write(
        stage.lab.file(run, "cars.log"),
        "one\u{1b}]0;title\u{7}\ntwo\u{2066}\n",
    )
    .unwrap();

    let shown = stage.lab.ok(&["log", "--run", run]);
    assert_eq!(shown, "one\\u{1b}]0;title\\u{7}\ntwo\\u{2066}\n");
}
