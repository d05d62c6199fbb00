//! What can happen to a record: damage, a crash, a disk that takes no more.

use std::process::{Command, Stdio};

use system_tests::{Lab, programs, root};

const HALL: &str = "launch/hors_doeuvres.toml";

/// Checks the record in a folder. Returns the exit status and the output of `cars check`.
pub(crate) fn check(lab: &Lab, folder: &str) -> (i32, String) {
    lab.cars_without_out(&["check", folder])
}

#[test]
fn damage_anywhere_in_a_record_is_found_and_named() {
    damage_record(15);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn damage_at_many_places_of_a_record_is_found_and_named() {
    damage_record(120);
}

/// Damages a record at so many places, half of them in its last lines.
fn damage_record(count: usize) {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "30 s", "--run", "whole"]);
    let folder = lab.out().join("whole");
    let path = folder.display().to_string();
    let events = folder.join("events.jsonl");
    let whole = std::fs::read(&events).unwrap();
    let (code, said) = check(&lab, &path);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("60 ticks to the end"), "{said}");

    let end = whole.len() - 120;
    let mut places: Vec<usize> = (0..end).step_by(2 * end / count).collect();
    places.extend((end..whole.len() - 1).step_by(240 / count));
    for &place in &places {
        let mut damaged = whole.clone();
        damaged[place] ^= 1;
        std::fs::write(&events, &damaged).unwrap();

        let (code, text) = check(&lab, &path);
        assert_eq!(code, 1, "byte {place}: {text}");
        let line = 1 + whole[..place].iter().filter(|byte| **byte == b'\n').count();
        let (first, last) = lines_of(&text);
        assert!(
            (first..=last).contains(&line),
            "byte {place}, line {line}: {text}"
        );
    }
    println!("{} damaged records", places.len());
}

#[test]
fn damage_in_any_file_of_a_run_is_found_and_the_file_named() {
    damage_files(5);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn damage_at_many_places_of_any_file_of_a_run_is_found_and_the_file_named() {
    damage_files(40);
}

/// Damages each file of a run at so many places.
fn damage_files(count: usize) {
    let lab = Lab::new();
    let launch = ["launch", HALL, "--no-console", "--speed", "max", "--quiet"];
    lab.ok(&[&launch[..], &["--duration", "10 s", "--run", "whole"]].concat());
    let folder = lab.out().join("whole");
    let path = folder.display().to_string();
    let (code, said) = check(&lab, &path);
    assert_eq!(code, 0, "{said}");

    let files = [
        "run.mcap",
        "summary.json",
        "launched.json",
        "cars.log",
        "scenario.toml",
    ];
    for name in files {
        let file = folder.join(name);
        let whole = std::fs::read(&file).unwrap();
        let mut step = whole.len() / count;
        step += usize::from(step.is_multiple_of(2)); // Not always at the same column.
        for place in (0..whole.len()).step_by(step) {
            let mut damaged = whole.clone();
            damaged[place] ^= 1;
            std::fs::write(&file, &damaged).unwrap();
            let (code, text) = check(&lab, &path);
            // The scenario is compared with the one in the recording.
            assert_eq!(code, 1, "{name}, byte {place}: {text}");
            let text: String = text
                .split_whitespace()
                .filter(|word| *word != "│")
                .collect();
            assert!(text.contains(name), "{name}, byte {place}: {text}");
            assert!(!text.contains("panicked"), "{name}, byte {place}: {text}");
        }
        for kept in [0, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&file, &whole[..kept]).unwrap();
            let (code, text) = check(&lab, &path);
            assert_eq!(code, 1, "{name}, {kept} bytes: {text}");
        }
        std::fs::write(&file, &whole).unwrap();
    }
    assert_eq!(check(&lab, &path).0, 0);
}

#[test]
fn a_summary_from_before_seals_counts_lost_robots_otherwise() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "launch/hors_doeuvres.toml",
        "--duration",
        "20 s",
        "--run",
        "earlier",
    ]);
    let file = lab.file("earlier", "summary.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let mut summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    summary["wall"].as_object_mut().unwrap().remove("seal");

    summary["robots"]["Leguin"]["behaviors_s"]["WAIT"] = 123.0.into();
    std::fs::write(&file, summary.to_string()).unwrap();
    lab.ok(&["verify", "earlier"]);

    summary["robots"]["Leguin"]["blocked"] = 123.into();
    std::fs::write(&file, summary.to_string()).unwrap();
    let (_, printed) = lab.fails(&["verify", "earlier"]);
    assert!(
        printed.contains("summary.robots.Leguin.blocked"),
        "{printed}"
    );
}

#[test]
fn a_summary_that_does_not_follow_from_its_record_is_found() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--duration", "60 s", "-q", "--run", "whole"]);
    let file = lab.file("whole", "summary.json");
    let whole = std::fs::read_to_string(&file).unwrap();
    let change = |pointer: &str, value: serde_json::Value| {
        let mut summary: serde_json::Value = serde_json::from_str(&whole).unwrap();
        *summary.pointer_mut(pointer).unwrap() = value;
        std::fs::write(&file, summary.to_string()).unwrap();
    };

    for (pointer, value) in [
        ("/ticks", 7.into()),
        ("/seed", 7.into()),
        ("/time_s", 7.5.into()),
        ("/end", "stopped".into()),
        ("/digest", "0123456789abcdef".into()),
        ("/robots/Butler/blocked", 70.into()),
        (
            "/robots/Butler/emotions_s",
            serde_json::json!({"HAPPY": 1.0}),
        ),
        ("/robots/Butler/state_variables", serde_json::json!({})),
        ("/network/links", serde_json::json!({})),
        ("/expectations", serde_json::json!({})),
        ("/run", "other".into()),
    ] {
        change(pointer, value);
        let (code, text) = lab.fails(&["verify", "whole"]);
        assert_eq!(code, 1, "{pointer}: {text}");
        let named = pointer.replace('/', ".");
        let is_named = text.contains(&format!("summary{named}")) || text.contains("summary.json");
        assert!(is_named, "{pointer}: {text}");
    }

    // Wall clock follows from nothing.
    change("/wall/elapsed_s", 12345.0.into());
    lab.ok(&["verify", "whole"]);
    std::fs::write(&file, &whole).unwrap();
    lab.ok(&["verify", "whole"]);
}

/// The lines that an error names: `lines 3 to 9 are damaged`.
pub(crate) fn lines_of(text: &str) -> (usize, usize) {
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    let at = words.iter().position(|word| *word == "lines").unwrap();

    (
        words[at + 1].parse().unwrap(),
        words[at + 3].parse().unwrap(),
    )
}

#[test]
fn a_record_that_ends_anywhere_is_good_up_to_its_last_complete_tick() {
    let lab = Lab::new();
    let no_frames = ["--set", "record.frames=false"];
    lab.ok(&[
        &["run", HALL, "--duration", "10 s", "--run", "cut"][..],
        &no_frames,
    ]
    .concat());
    let folder = lab.out().join("cut");
    // What a process writes at the end, and a log that cannot be longer than the events.
    for later in ["summary.json", "cars.log"] {
        std::fs::remove_file(folder.join(later)).unwrap();
    }
    let path = folder.display().to_string();
    let events = folder.join("events.jsonl");
    let whole = std::fs::read(&events).unwrap();

    for kept in (0..whole.len()).step_by(whole.len() / 40) {
        std::fs::write(&events, &whole[..kept]).unwrap();
        let (code, said) = check(&lab, &path);
        let lines = String::from_utf8_lossy(&whole[..kept]);
        let (complete, _) = lines.rsplit_once('\n').unwrap_or_default();
        let ticks = complete.lines().filter(|line| line.contains("\"seal\""));
        let last = ticks.count().saturating_sub(1);
        assert_eq!(code, 0, "{kept} bytes: {said}");
        assert!(
            said.contains(&format!("{last} ticks, no end")),
            "{kept} bytes: {said}"
        );
        println!("a record cut off after {kept} bytes");
    }
}

/// A file may not grow beyond so many blocks, as on a full disk.
fn with_little_space(lab: &Lab, blocks: u32, args: &[&str]) -> Command {
    let mut command = Command::new("sh");
    let program = programs().join("cars");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    command
        .args(["-c", &script, "sh"])
        .arg(program)
        .args(args)
        .arg("--out")
        .arg(lab.out())
        .current_dir(root())
        .stdin(Stdio::null());
    command
}

#[test]
fn a_record_that_cannot_be_written_is_named_and_ends_the_run() {
    let lab = Lab::new();
    let long = ["--duration", "5000 s", "--run"];
    let launch = ["launch", HALL, "--no-console", "--speed", "max"];
    for (run, args) in [("full-run", &["run", HALL][..]), ("full-launch", &launch)] {
        let mut command = with_little_space(&lab, 64, args);
        let output = command.args(long).arg(run).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        let text: String = text
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect();

        assert_eq!(output.status.code(), Some(1), "{run}: {text}");
        assert!(
            text.contains("cannotwrite") && text.contains(&format!("{run}/")),
            "{text}"
        );
        assert!(text.contains("Filetoolarge"), "{text}");
        assert!(!text.contains("panicked"), "{text}");
        let (code, said) = check(&lab, &lab.out().join(run).display().to_string());
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("no end"), "{said}");
    }
}

/// The one chunk of a short recording is written when all ticks are there.
#[test]
fn events_have_no_end_unless_the_recording_is_finished() {
    let lab = Lab::new();
    let args = ["run", HALL, "--duration", "8 s", "--run", "full"];
    let output = with_little_space(&lab, 130, &args).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");

    let events = std::fs::read_to_string(lab.out().join("full/events.jsonl")).unwrap();
    let ticks = events
        .lines()
        .filter(|line| line.contains("\"event\":\"tick\""));
    assert_eq!(ticks.count(), 17, "{events}");
    assert!(!events.contains("\"event\":\"end\""), "{events}");
    let (code, said) = check(&lab, &lab.out().join("full").display().to_string());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("16 ticks, no end"), "{said}");
}

#[test]
fn records_are_synchronized_as_the_scenario_says() {
    let lab = Lab::new();
    for sync in ["tick", "second", "end"] {
        let set = format!("record.sync={sync}");
        lab.ok(&[
            "run",
            HALL,
            "--duration",
            "10 s",
            "--run",
            sync,
            "--set",
            &set,
        ]);
    }
    assert_eq!(lab.bytes("tick"), lab.bytes("end"));
    assert_eq!(lab.bytes("second"), lab.bytes("end"));

    let (_, text) = lab.fails(&["run", HALL, "--set", "record.sync=never"]);
    assert!(text.contains("second"), "{text}");
}
