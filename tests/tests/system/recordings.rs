//! Recordings of runs: what other programs read in them, and what is left of them after a crash.

use std::path::Path;
use std::process::{Command, Output};

use nix::sys::signal::Signal;
use recording::Recording;
use serde_json::Value;
use system_tests::processes::send;
use system_tests::tools::lacks_tool;
use system_tests::{Lab, eventually, root};

/// Runs a Python script on a file; `None` if the package `mcap` is missing.
fn python(script: &Path, file: &Path) -> Option<Output> {
    let has_package = Command::new("python3").args(["-c", "import mcap"]).output();
    if !has_package.is_ok_and(|output| output.status.success()) {
        lacks_tool("reading recordings in Python", "`pip install mcap`");
        return None;
    }

    let output = Command::new("python3")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(script)
        .arg(file)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    Some(output)
}

#[test]
fn the_package_of_the_format_reads_all_of_a_recording() {
    let lab = Lab::new();
    let args = ["--duration", "60 s", "--run", "hall"];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let file = lab.file("hall", "run.mcap");
    let Some(output) = python(&root().join("tests/recording/read.py"), &file) else {
        return;
    };
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();

    let ticks = found["ticks"].as_array().unwrap();
    assert_eq!(ticks.len(), 121);
    for (number, tick) in (0_u64..).zip(ticks) {
        let time_ns = number * 500_000_000;
        assert_eq!(*tick, serde_json::json!([number, time_ns, time_ns]));
    }

    let scenario = std::fs::read_to_string(lab.file("hall", "scenario.toml")).unwrap();
    assert_eq!(found["attachments"]["scenario.toml"], scenario);
    let metadata = &found["metadata"]["cars"];
    for (key, value) in [("run", "hall"), ("epoch", "1"), ("tick_s", "0.5")] {
        assert_eq!(metadata[key], value);
    }
    for key in ["seed", "version", "protocol"] {
        assert!(metadata[key].is_string(), "{metadata}");
    }

    let counts = &found["counts"];
    assert_eq!(counts["/events"], lab.events("hall").len());
    for (topic, count) in [
        ("/header", 1),
        ("/wall", 121),
        ("/robot/Butler/report", 121),
        ("/robot/Leguin/report", 121),
        ("/view/field", 1),
        ("/view/robots", 121),
        ("/view/guests", 121),
        ("/view/transforms", 121),
        ("/view/pose/Butler", 121),
        // Once a simulated second.
        ("/robot/Butler/panel", 61),
    ] {
        assert_eq!(counts[topic], count, "{topic}");
    }

    for (topic, channel) in found["channels"].as_object().unwrap() {
        let expected = if topic.starts_with("/view/") {
            "protobuf"
        } else {
            "jsonschema"
        };
        assert_eq!(channel["schema_encoding"], expected, "{topic}");
    }
}

#[test]
fn the_example_of_the_documentation_works() {
    let lab = Lab::new();
    let args = ["--duration", "10 s", "--run", "hall"];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let page = std::fs::read_to_string(root().join("docs/recordings.md")).unwrap();
    let code = page.split("```python\n").nth(1).unwrap();
    let script = lab.write("example.py", code.split("```").next().unwrap());

    let Some(output) = python(&script, &lab.file("hall", "run.mcap")) else {
        return;
    };
    let lines = String::from_utf8(output.stdout).unwrap();
    assert_eq!(lines.lines().count(), 21, "{lines}");
    assert!(lines.starts_with("0 HAPPY "), "{lines}");
}

#[test]
fn a_simulator_that_is_killed_leaves_a_recording() {
    let lab = Lab::new();
    let mut launch = lab.start(
        "killed",
        &["launch", "launch/hors_doeuvres.toml", "--speed", "20"],
    );
    let file = lab.file("killed", "run.mcap");
    eventually("some ticks are recorded", || {
        let recording = Recording::open(&file).ok()?;
        (recording.len() > 50).then_some(())
    });

    send(launch.process("cars-sim"), Signal::SIGKILL);
    launch.wait();

    let recording = Recording::open(&file).unwrap();
    assert!(!recording.is_finished());
    let ticks = recording.read(0, recording.len()).unwrap();
    assert_eq!(ticks.len() as u64, recording.len());
    // The events of all these ticks are those of the record.
    let recorded: usize = ticks.iter().map(|tick| tick.events.len()).sum();
    let events = lab.events("killed");
    let until = events
        .iter()
        .filter(|event| event["tick"].as_u64().unwrap() < recording.len());
    assert_eq!(recorded, until.count());
    assert!(ticks.iter().all(|tick| tick.reports.len() == 2));
    assert!(ticks.iter().any(|tick| !tick.panels.is_empty()));
    assert!(ticks.iter().all(|tick| tick.wall.reports_ns.len() == 2));
}
