//! Recordings of runs: what other programs read in them, and what is left of them after a crash.

use std::path::Path;
use std::process::{Command, Output};

use nix::sys::signal::Signal;
use protocol::{Epoch, Event, Line, RobotName};
use recording::Recording;
use recording::content::Missed;
use serde_json::Value;
use system_tests::processes::send;
use system_tests::tools::has_modules;
use system_tests::{Lab, eventually, root};

/// Runs a Python script on a file; `None` if a package is missing.
fn python(script: &Path, file: &Path) -> Option<Output> {
    let modules = "foxglove_schemas_protobuf, mcap";
    let install = "pip install mcap foxglove-schemas-protobuf";
    if !has_modules("reading recordings in Python", modules, install) {
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
        // Once a simulated second.
        ("/view/robots", 61),
        ("/view/guests", 61),
        ("/view/transforms", 61),
        ("/view/pose/Butler", 61),
        ("/robot/Butler/panel", 121),
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
fn what_viewers_draw_has_the_schemas_of_foxglove() {
    let lab = Lab::new();
    let args = ["--duration", "60 s", "--run", "hall"];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let script = root().join("tests/recording/views.py");
    let Some(output) = python(&script, &lab.file("hall", "run.mcap")) else {
        return;
    };

    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let schemas = [
        "FrameTransforms",
        "Log",
        "PointCloud",
        "PoseInFrame",
        "SceneUpdate",
    ];
    assert_eq!(found["schemas"], serde_json::json!(schemas));
    let guests = &found["last"]["/view/guests"];
    let last = &lab.recorded("hall")[120];
    assert_eq!(guests["points"].as_array().unwrap().len(), 100);
    for (point, place_mm) in guests["points"]
        .as_array()
        .unwrap()
        .iter()
        .zip(last.frame.guests_mm.chunks(2))
    {
        for axis in 0..2 {
            let mm = (point[axis].as_f64().unwrap() * 1000.0).round() as i64;
            assert_eq!(mm, place_mm[axis]);
        }
    }
    let butler = &last.frame.robots[0];
    let pose = &found["last"]["/view/pose/Butler"]["pose"]["position"];
    assert_eq!(pose["x"], butler.location.x);
    assert_eq!(pose["y"], butler.location.y);
}

#[test]
fn viewers_draw_walls_and_shapes() {
    let lab = Lab::new();
    let walls = r#"wall=[{ points = [["1 m", "9 m"], ["3 m", "9 m"], ["3 m", "8 m"]] }]"#;
    let obstacles =
        r#"obstacle=[{ at = ["2 ft", "2 ft"] }, { at = ["9 m", "9 m"], radius = "0.5 m" },
        { at = ["12 m", "9 m"], size = ["2 m", "1 m"] }]"#
            .replace('\n', " ");
    let args = [
        "--duration",
        "5 s",
        "--run",
        "hall",
        "--set",
        walls,
        "--set",
        &obstacles,
    ];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let script = root().join("tests/recording/views.py");
    let Some(output) = python(&script, &lab.file("hall", "run.mcap")) else {
        return;
    };

    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let field = &found["last"]["/view/field"]["entities"][0];
    assert_eq!(field["cubes"].as_array().unwrap().len(), 2);
    let showcase = &field["cubes"][1];
    assert_eq!(showcase["pose"]["position"]["x"], 12.0);
    assert_eq!(
        (&showcase["size"]["x"], &showcase["size"]["y"]),
        (&2.0.into(), &1.0.into())
    );
    let disc = &field["cylinders"][0];
    assert_eq!(disc["pose"]["position"]["x"], 9.0);
    assert_eq!(
        (&disc["size"]["x"], &disc["topScale"]),
        (&1.0.into(), &1.0.into())
    );
    // The edge of the field, and the wall.
    let lines = field["lines"].as_array().unwrap();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[1]["points"].as_array().unwrap().len(), 3);
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

    // As `docs/recordings.md` says of other readers.
    let script = root().join("tests/recording/killed.py");
    if let Some(output) = python(&script, &file) {
        let count = String::from_utf8(output.stdout).unwrap();
        assert_eq!(count.trim(), recording.len().to_string());
    }
}

/// The hall, of which Leguin crashes and returns, without holding the clock.
const CRASH: &str = r#"fault=[{ robot = "Leguin", do = "crash", at = "2 s", until = "5 s" }]"#;

/// Checks what is recorded of an epoch in which Leguin crashed and returned: it is that of the epoch's events, and no report is
/// of another epoch or of another incarnation than the events state.
fn check_epoch(lab: &Lab, run: &str, suffix: &str, epoch: Epoch, seed: u64) {
    let recording = Recording::open(&lab.file(run, &format!("run{suffix}.mcap"))).unwrap();
    assert!(recording.is_finished());
    let header = recording.header();
    assert_eq!((header.epoch, header.seed), (epoch, seed));
    let scenario = std::fs::read_to_string(lab.file(run, &format!("scenario{suffix}.toml")));
    assert_eq!(recording.scenario().unwrap(), scenario.unwrap());

    let leguin = RobotName::new("Leguin").unwrap();
    let ticks = recording.read(0, recording.len()).unwrap();
    let mut recorded = Vec::new();
    // Events count the incarnations of an epoch, reports all of the run.
    let mut incarnation = 1;
    let mut generation = None;
    let mut generation_before = 0;
    let mut last_report = None;
    for (number, tick) in (0..).zip(&ticks) {
        assert_eq!(tick.tick(), number);
        for event in tick.events.iter() {
            if let Event::Joined {
                robot,
                generation: Some(joined),
                ..
            } = event
                && *robot == leguin
            {
                assert_eq!(*joined, incarnation + 1, "tick {number}");
                incarnation = *joined;
                generation_before = generation.take().unwrap();
            }
            let tick = tick.tick();
            let event = event.clone();
            recorded.push(serde_json::to_value(Line { tick, event }).unwrap());
        }
        for report in tick.reports.values() {
            assert_eq!((report.epoch, report.tick), (epoch, number));
        }

        let placed = tick.frame.robots.iter().find(|robot| robot.name == leguin);
        let missed = placed.unwrap().missed;
        match tick.reports.get(&leguin) {
            Some(report) => {
                let expected = *generation.get_or_insert(report.generation);
                assert_eq!(report.generation, expected, "tick {number}");
                assert!(report.generation > generation_before, "tick {number}");
                assert_eq!(missed, None, "tick {number}");
                last_report = Some(number);
            }
            None => assert_eq!(missed, Some(Missed { last_report }), "tick {number}"),
        }
    }
    assert_eq!(incarnation, 2);

    let events = std::fs::read_to_string(lab.file(run, &format!("events{suffix}.jsonl"))).unwrap();
    let mut stated = Vec::new();
    for line in events.lines() {
        let mut event: Value = serde_json::from_str(line).unwrap();
        event.as_object_mut().unwrap().remove("seal");
        stated.push(event);
    }
    assert_eq!(recorded, stated);
}

#[test]
fn epochs_and_incarnations_are_kept_apart() {
    let lab = Lab::new();
    let run = "apart";
    let args = ["--no-console", "--speed", "10", "--set", "on_late=continue"];
    let hall = ["launch", "launch/hors_doeuvres.toml", "--duration", "60 s"];
    let mut launch = lab.start(run, &[&hall[..], &args, &["--set", CRASH]].concat());
    let returned = || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        let joined = events.split("\"event\":\"joined\",\"robot\":\"Leguin\"");
        (joined.count() > 2).then_some(())
    };

    eventually("Leguin to return in the first epoch", returned);
    lab.ctl(run, &["init", "--seed", "7"]);
    lab.until_ready(run);
    lab.ctl(run, &["start"]);
    eventually("Leguin to return in the second epoch", returned);
    lab.ctl(run, &["stop"]);
    launch.finish();

    check_epoch(&lab, run, "-epoch1", 1, 2002);
    check_epoch(&lab, run, "", 2, 7);
}

#[test]
fn a_recording_of_which_only_the_end_is_missing_is_unfinished() {
    let lab = Lab::new();
    let args = ["--duration", "30 s", "--run", "unfinished"];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let file = lab.file("unfinished", "run.mcap");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() - 100]).unwrap();

    let (code, said) = lab.fails(&["verify", "unfinished"]);
    assert_eq!(code, 1);
    let words: Vec<&str> = said.split_whitespace().collect();
    assert!(
        words.join(" ").contains("is unfinished: it has all ticks"),
        "{said}"
    );
}

/// As a program that repairs files does it: chunks end anywhere.
#[test]
fn a_recording_that_another_program_wrote_anew_is_read() {
    let lab = Lab::new();
    let args = ["--duration", "60 s", "--run", "anew"];
    lab.ok(&[&["run", "configs/hors_doeuvres.toml"][..], &args].concat());
    let written = lab.recorded("anew");
    let script = root().join("tests/recording/write_anew.py");
    if python(&script, &lab.file("anew", "run.mcap")).is_none() {
        return;
    }

    assert_eq!(lab.recorded("anew"), written);
    let said = lab.ok(&["verify", "anew"]);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
}
