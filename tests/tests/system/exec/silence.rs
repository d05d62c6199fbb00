//! What a program does that is understood in part, or has no effect: one line each, with the limit.

use system_tests::Lab;
use system_tests::processes::nobody_is_left;
use system_tests::tools::has_python;

use super::stage::{Stage, says};

/// What a program does in each tick, and what the log of the run says about it, once.
const IN_THE_LOG: &[(&str, &str, &str)] = &[
    (
        "typo",
        r#"say '{"type":"done","propsal":{"x":1,"y":2}}'; continue"#,
        "warning: unknown field `propsal` of a line `done` ignored; its fields are proposal, speed_mps, direction_rad, \
         emotion_state, behavior_state, state_variables",
    ),
    (
        "fast",
        r#"say '{"type":"done","proposal":{"x":9,"y":9}}'; continue"#,
        "in a tick and stays: at most 3.048 m/s, 1.524 m in 0.5 s, is allowed",
    ),
    (
        "lines",
        r#"i=0; while [ $i -lt 600 ]; do i=$((i + 1)); say '{"type":"log","text":"again"}'; done"#,
        "warning: 88 lines of the log were dropped: the limits are 4096 bytes a line, and 512 lines and 262144 bytes a tick",
    ),
    (
        "full",
        r#"i=0; while [ $i -lt 512 ]; do i=$((i + 1)); say '{"type":"log","text":"again"}'; done
           say '{"type":"done","propsal":{"x":1,"y":2}}'; continue"#,
        "warning: unknown field `propsal` of a line `done` ignored; its fields are proposal, speed_mps, direction_rad, \
         emotion_state, behavior_state, state_variables",
    ),
];

#[test]
fn what_has_no_effect_is_told_once_in_terminal_and_log_and_counted() {
    for (name, lines, expected) in IN_THE_LOG {
        let run = format!("exec-silence-{name}");
        let from_go_on =
            format!("if [ ! -e go ]; then say '{{\"type\":\"done\"}}'; continue; fi\n{lines}");
        let stage = Stage::each_tick(&from_go_on, "");
        let mut launch = stage.start(&run, &["--duration", "3 s", "--paused"]);
        stage.lab.until_ready(&run);
        // The launcher shows what is said once it observes the run, and from then on it carries out orders.
        stage
            .lab
            .ctl_of_launcher(&run, &["hang", "Butler", "--for", "0.1 s"]);
        stage.lab.write("go", "");
        stage.lab.ctl(&run, &["start"]);
        launch.finish();
        says(&launch, &[*expected]);

        let log = std::fs::read_to_string(stage.lab.file(&run, "cars.log")).unwrap();
        assert_eq!(log.matches(expected).count(), 1, "{name}: {log}");
        assert_eq!(launch.printed().matches(expected).count(), 1, "{name}");
        let count = match *name {
            "typo" | "full" => "Leguin: 6 of its lines `done` had unknown fields",
            "fast" => "5 of its moves were refused because they were too fast",
            _ => "Leguin: 528 lines of the log were dropped",
        };
        says(&launch, &[count]);
        nobody_is_left(&run);
    }
}

#[test]
fn a_program_that_does_not_end_as_it_should_is_named_and_the_run_is_right() {
    for (name, at_end, expected) in [
        (
            "status",
            "exit 7",
            "Leguin: its program ended with exit status 7 after the line `end`, where exit status 0 is expected",
        ),
        (
            "killed",
            "kill -9 $$",
            "Leguin: its program was ended by SIGKILL after the line `end`, where exit status 0 is expected",
        ),
        (
            "stays",
            "while :; do sleep 1; done",
            "Leguin: its program had not exited 2 s after the line `end`, and was killed",
        ),
    ] {
        let run = format!("exec-end-{name}");
        let script = format!(
            "while hear; do if is end; then {at_end}; fi; say '{{\"type\":\"done\"}}'; done"
        );
        let stage = Stage::new(&script, "");
        let mut launch = stage.start(&run, &["--duration", "3 s"]);
        launch.finish();
        says(&launch, &[expected]);
        assert!(stage.log(&run).contains(expected), "{}", stage.log(&run));
        nobody_is_left(&run);
    }
}

#[test]
fn a_byte_order_mark_is_named() {
    let stage = Stage::each_tick(
        r#"if is init; then printf '\357\273\277{"type":"done"}\n'; continue; fi"#,
        "",
    );
    let mut launch = stage.start("exec-mark", &[]);
    assert_eq!(launch.wait().code(), Some(1), "{}", launch.printed());
    says(
        &launch,
        &["it begins with a byte order mark (U+FEFF): write UTF-8 without it"],
    );
    nobody_is_left("exec-mark");
}

/// Alternates between two states whose names are as long as they may be.
const LONG_NAMES: &str = r#"#!/usr/bin/env python3
import json, sys
count = 0
for line in sys.stdin:
    if json.loads(line)["type"] == "end":
        break
    count += 1
    print(json.dumps({"type": "done", "emotion_state": "AB"[count % 2] * 4096}), flush=True)
"#;

#[test]
fn the_longest_names_are_in_the_log_of_observers() {
    if !has_python("names of 4096 bytes in Python") {
        return;
    }

    let lab = Lab::new();
    let program = lab.write("long.py", LONG_NAMES);
    lab.write(
        "long.toml",
        "duration = \"3 s\"\n[[robot]]\nname = \"Walker\"\nat = [\"5 m\", \"5 m\"]\n",
    );
    let launch = format!(
        "scenario = \"long.toml\"\n[[process]]\nname = \"Walker\"\ncommand = [\"cars\", \"exec\", \"--\", \"python3\", {:?}]\n",
        program.display().to_string()
    );
    let launch = lab.write("launch.toml", &launch).display().to_string();
    let mut running = lab.start(
        "exec-long-names",
        &["launch", &launch, "--no-console", "--speed", "max"],
    );
    running.finish();

    let printed = running.printed();
    assert!(!printed.contains("malformed"), "{printed}");
    let change = format!("emotion {} -> {}", "B".repeat(4096), "A".repeat(4096));
    assert!(printed.contains(&change), "{printed}");
    nobody_is_left("exec-long-names");
}
