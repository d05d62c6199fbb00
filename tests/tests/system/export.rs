//! Runs exported for other programs: tables, a log for ShiViz, a trace of wall-clock time.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

use nix::sys::signal::Signal;
use recording::Recording;
use serde_json::{Value, json};
use system_tests::processes::send;
use system_tests::python::package;
use system_tests::tools::{has_modules, has_python, lacks_tool};
use system_tests::{Lab, eventually, root};

const HALL: &str = "configs/hors_doeuvres.toml";
/// What is skipped where there is no Python.
const HOSTILE: &str = "exports of a hostile robot in Python";

/// Runs Python in a folder; `None` if one of the packages is missing.
fn python(folder: &Path, packages: &[&str], args: &[&str]) -> Option<Output> {
    let modules = packages.join(", ");
    let install = format!("pip install {}", packages.join(" "));
    // The package is not called as its module.
    let install = install.replace("mcap_ros2", "mcap-ros2-support");
    if !has_modules("reading exports in Python", &modules, &install) {
        return None;
    }

    let output = Command::new("python3")
        .current_dir(folder)
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .args(args)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    Some(output)
}

/// A script of `tests/exports`.
fn script(name: &str) -> String {
    let path = root().join("tests/exports").join(name);
    path.to_str().unwrap().to_owned()
}

/// Compares the tables of a folder with the record of a run; returns the numbers of rows.
fn compare_tables(lab: &Lab, run: &str, tables: &str, epochs: &[&str]) -> Option<Value> {
    let run = lab.out().join(run);
    let page = root().join("docs/exports.md");
    let script = script("tables.py");
    let mut args = vec![script.as_str(), run.to_str().unwrap(), tables];
    args.push(page.to_str().unwrap());
    args.extend(epochs);

    let packages = ["pandas", "pyarrow", "polars", "duckdb", "mcap"];
    let output = python(lab.out(), &packages, &args)?;
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// Exports the tables of a run of a lab to one of its folders; returns what is printed.
fn export(lab: &Lab, run: &str, to: &str, more: &[&str]) -> String {
    let folder = lab.out().join(to);
    let mut args = vec!["export", run, "--csv", "-o", folder.to_str().unwrap()];
    args.extend(more);
    lab.ok(&args)
}

/// Plays a run with two epochs. In both a robot with hostile texts and numbers crashes and returns, and messages are lost,
/// delayed and doubled.
fn play_hostile(lab: &Lab, run: &str) {
    let scenario = lab.write(
        "scenario.toml",
        r#"
            seed = 9007199254740991
            tick = "0.5 s"
            duration = "60 s"
            on_late = "continue"
            deadline = "30 s"

            [field]
            size = ["20 ft", "20 ft"]

            [guests]
            count = 20

            [[robot]]
            name = "Bruno"
            at = ["5 ft", "5 ft"]

            [[robot]]
            name = "Vonda"
            at = ["15 ft", "15 ft"]
            params = { waiter = "Bruno" }

            [network]
            commands = { loss = 0.2, duplication = 0.2, delay = { min = "0 s", mode = "1 s", max = "2 s" } }
            queries = { loss = 0.1 }

            [[network.partition]]
            groups = [["Bruno"], ["Vonda"]]
            from = "8 s"
            until = "9 s"

            [[fault]]
            robot = "Bruno"
            do = "crash"
            at = "3 s"
            until = "5 s"

            [[change]]
            at = "6 s"
            set = ["network.commands.loss=0.25"]
        "#,
    );
    let hostile = script("hostile.py");
    let launch = format!(
        r#"
            scenario = {scenario:?}

            [[process]]
            name = "Bruno"
            command = ["cars", "exec", "--", "python3", {hostile:?}]

            [[process]]
            name = "Vonda"
            command = ["cars-vonda"]
        "#
    );
    let launch = lab.write("hostile.toml", &launch);
    let launch = launch.to_str().unwrap();
    let args = [
        "launch",
        launch,
        "--no-console",
        "--paused",
        "--speed",
        "max",
    ];
    let mut running = lab.start(run, &args);

    lab.until_ready(run);
    lab.step(run, 30);
    lab.ctl(run, &["init", "--seed", "7"]);
    lab.until_ready(run);
    lab.step(run, 20);
    lab.ctl(run, &["stop"]);
    running.finish();
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn tables_have_every_value_of_the_record_also_of_hostile_robots() {
    if !has_python(HOSTILE) {
        return;
    }

    let lab = Lab::new();
    play_hostile(&lab, "exports-hostile");
    let printed = export(&lab, "exports-hostile", "tables", &[]);
    assert_eq!(printed.lines().count(), 3, "{printed}");

    let Some(counts) = compare_tables(&lab, "exports-hostile", "tables", &[]) else {
        return;
    };
    // Two robots, and ticks 0 to 30 and 0 to 20.
    assert_eq!(counts["states"], 2 * (31 + 21), "{counts}");
    let kinds: Vec<&str> = counts["kinds"]
        .as_array()
        .unwrap()
        .iter()
        .map(|kind| kind.as_str().unwrap())
        .collect();
    for kind in [
        "init",
        "joined",
        "lost",
        "missed",
        "emotion",
        "behavior",
        "command_sent",
        "command_delivered",
        "command_dropped",
        "command_delayed",
        "command_duplicated",
        "query_lost",
        "link_cut",
        "link_healed",
        "fault",
        "changed",
        "say",
        "tick",
        "end",
    ] {
        assert!(kinds.contains(&kind), "no {kind}: {kinds:?}");
    }
    // No report while it is away, and one of a further incarnation after that.
    let generations = counts["generations"].as_array().unwrap();
    for generation in [0, 1, 2] {
        assert!(generations.contains(&generation.into()), "{counts}");
    }

    // One epoch by itself, and the same bytes once more.
    export(&lab, "exports-hostile", "second", &["--epoch", "2"]);
    compare_tables(&lab, "exports-hostile", "second", &["2"]);
    export(&lab, "exports-hostile", "again", &[]);
    for table in ["events", "states", "variables"] {
        let name = format!("{table}.csv");
        let [one, again] = ["tables", "again"]
            .map(|folder| std::fs::read(lab.out().join(folder).join(&name)).unwrap());
        assert!(one == again, "{name}");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_examples_of_the_documentation_work() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "hall", "--duration", "60 s"]);
    export(&lab, "hall", "tables", &[]);

    let page = std::fs::read_to_string(root().join("docs/exports.md")).unwrap();
    let mut count = 0;
    for block in page.split("```python\n").skip(1) {
        let code = block.split("```").next().unwrap();
        let file = lab.write("example.py", code);
        let packages = ["pandas", "pyarrow", "polars", "duckdb"];
        let Some(output) = python(lab.out(), &packages, &[file.to_str().unwrap()]) else {
            return;
        };
        assert!(!output.stdout.is_empty(), "{code}");
        count += 1;
    }
    assert_eq!(count, 4);
}

/// Exports a run to the folder `tables` of a lab; returns the notes.
fn notes_of_export(lab: &Lab, run: &str) -> String {
    let folder = lab.out().join("tables");
    let args = ["export", run, "--csv", "-o", folder.to_str().unwrap()];
    let output = lab.cars(&args).output().unwrap();
    let notes = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{notes}");
    notes.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_that_was_killed_or_not_recorded_is_exported_as_far_as_it_goes() {
    let lab = Lab::new();
    let launch = [
        "launch",
        "launch/hors_doeuvres.toml",
        "--speed",
        "20",
        "--no-console",
    ];
    let mut running = lab.start("exports-killed", &launch);
    let file = lab.file("exports-killed", "run.mcap");
    let recorded = || recording::Recording::open(&file).ok();
    eventually("some ticks are recorded", || {
        (recorded()?.len() > 50).then_some(())
    });
    send(running.process("cars-sim"), Signal::SIGKILL);
    running.wait();

    let notes = notes_of_export(&lab, "exports-killed");
    assert!(notes.contains("has no end of the run"), "{notes}");
    assert!(notes.contains("run.mcap was not finished"), "{notes}");
    let states = std::fs::read_to_string(lab.out().join("tables/states.csv")).unwrap();
    let ticks = recorded().unwrap().len() as usize;
    assert_eq!(states.lines().count(), 1 + 2 * ticks);

    std::fs::remove_dir_all(lab.out().join("tables")).unwrap();
    std::fs::remove_file(&file).unwrap();
    let notes = notes_of_export(&lab, "exports-killed");
    assert!(
        notes.contains("has events, and no states and variables"),
        "{notes}"
    );
    let Some(counts) = compare_tables(&lab, "exports-killed", "tables", &[]) else {
        return;
    };
    assert!(counts["events"].as_u64().unwrap() > 50, "{counts}");
}

#[test]
fn what_a_damaged_recording_has_before_the_damage_is_exported() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "hall", "--duration", "120 s"]);
    export(&lab, "hall", "whole", &[]);
    let recording = lab.file("hall", "run.mcap");
    let whole = std::fs::read(&recording).unwrap();
    let table = |folder: &str, name: &str| {
        let path = lab.out().join(folder).join(name);
        std::fs::read_to_string(path).unwrap()
    };
    let damaged = |folder: &str, bytes: &[u8]| {
        std::fs::write(&recording, bytes).unwrap();
        let place = lab.out().join(folder);
        let args = ["export", "hall", "--csv", "-o", place.to_str().unwrap()];
        let output = lab.cars(&args).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        let printed = String::from_utf8_lossy(&output.stdout);
        assert_eq!(printed.lines().count(), 3, "{printed}");
        assert_eq!(table(folder, "events.csv"), table("whole", "events.csv"));
        let words = String::from_utf8_lossy(&output.stderr);
        let words = words.split_whitespace().filter(|word| *word != "│");
        words.collect::<Vec<_>>().join(" ")
    };

    // A byte in a chunk; the index still names all of them.
    let mut bytes = whole.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let said = damaged("chunk", &bytes);
    assert!(said.contains("run.mcap: damaged at byte"), "{said}");
    for name in ["states.csv", "variables.csv"] {
        let [part, all] = ["chunk", "whole"].map(|folder| table(folder, name));
        assert!(part.lines().count() > 1 && part.len() < all.len(), "{said}");
        assert!(all.starts_with(&part), "{name}");
    }
    let ticks = (table("chunk", "states.csv").lines().count() - 1) / 2;
    assert!(said.contains(&format!("after {ticks} ticks")), "{said}");

    // Nothing but the first bytes.
    let said = damaged("head", &whole[..20]);
    assert!(said.contains("run.mcap is not a recording"), "{said}");
    assert_eq!(table("head", "states.csv").lines().count(), 1);
}

#[test]
fn commands_are_arrows_in_shiviz() {
    if !has_python(HOSTILE) {
        return;
    }

    let lab = Lab::new();
    play_hostile(&lab, "exports-arrows");
    let log = lab.out().join("shiviz.log").display().to_string();
    lab.ok(&["export", "exports-arrows", "--shiviz", "-o", &log]);

    let run = lab.out().join("exports-arrows");
    let args = [script("shiviz.py"), run.to_str().unwrap().to_owned(), log];
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let Some(output) = python(lab.out(), &["json"], &args) else {
        return;
    };
    let executions = String::from_utf8(output.stdout).unwrap();
    let executions: Vec<Value> = executions
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(executions.len(), 2);
    for execution in executions {
        assert_eq!(execution["hosts"], serde_json::json!(["Bruno", "Vonda"]));
        assert!(execution["received"].as_u64().unwrap() > 0, "{execution}");
    }
}

/// The trace of a run, which is valid by the schema of the format.
fn trace(lab: &Lab, run: &str, args: &[&str]) -> Value {
    let file = lab.out().join("trace.json");
    let all = [
        &["export", run, "--trace", "-o", file.to_str().unwrap()],
        args,
    ]
    .concat();
    lab.ok(&all);

    let schema = script("trace.schema.json");
    let check = Command::new("check-jsonschema")
        .args(["--schemafile", &schema])
        .arg(&file)
        .output();
    match check {
        Ok(output) => {
            let printed = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{printed}");
        }
        Err(_) => lacks_tool("the schema of traces", "`pip install check-jsonschema`"),
    }
    serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap()
}

/// The events of a trace with these members.
fn select<'a>(trace: &'a Value, members: &[(&str, Value)]) -> Vec<&'a Value> {
    let events = trace["traceEvents"].as_array().unwrap().iter();
    events
        .filter(|event| members.iter().all(|(name, value)| event[name] == *value))
        .collect()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_trace_has_every_tick_every_report_and_what_held_the_clock_up() {
    let lab = Lab::new();
    let run = "exports-trace";
    let args = [
        "launch",
        "launch/hors_doeuvres.toml",
        "--no-console",
        "--speed",
        "max",
        "--duration",
        "20 s",
        "--paused",
    ];
    let mut launch = lab.start(run, &args);
    lab.until_ready(run);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    lab.ctl(run, &["start"]);
    launch.prints("Leguin (is there but has not reported");
    send(leguin, Signal::SIGCONT);
    launch.finish();

    let trace_of_all = trace(&lab, run, &[]);
    let slice = ("ph", Value::from("X"));
    let ticks = select(&trace_of_all, &[slice.clone(), ("name", "tick".into())]);
    assert_eq!(ticks.len(), 41);
    let reports = select(&trace_of_all, &[slice.clone(), ("name", "report".into())]);
    assert_eq!(reports.len(), 2 * 41);
    for report in &reports {
        let tick = ticks[report["args"]["tick"].as_u64().unwrap() as usize];
        assert_eq!(report["ts"], tick["ts"]);
        assert!(
            report["dur"].as_f64() <= tick["dur"].as_f64(),
            "{report} {tick}"
        );
    }

    let held_up = select(
        &trace_of_all,
        &[slice, ("pid", 1.into()), ("tid", 2.into())],
    );
    let by_leguin = held_up
        .iter()
        .find(|event| event["args"]["robot"] == "Leguin");
    let tick = by_leguin.expect("the clock was held up")["args"]["tick"]
        .as_u64()
        .unwrap();
    let held = ticks[tick as usize];
    // Whoever reported last; that may be Butler, who was also waiting for Leguin.
    let names = select(
        &trace_of_all,
        &[("ph", "M".into()), ("name", "thread_name".into())],
    );
    let last = names
        .iter()
        .find(|thread| thread["pid"] == 2 && thread["args"]["name"] == held["args"]["waited_for"])
        .expect("the robot that the clock waited for has a thread");
    let waited_us = |thread: &Value| {
        reports
            .iter()
            .find(|report| report["args"]["tick"] == tick && report["tid"] == *thread)
            .and_then(|report| report["dur"].as_f64())
    };
    let longest_us = waited_us(&last["tid"]).unwrap();
    assert!(waited_us(&Value::from(1)).unwrap() <= longest_us, "{held}");
    assert!(waited_us(&Value::from(2)).unwrap() <= longest_us, "{held}");
    // Microseconds: the clock is late after half a second.
    assert!(held["dur"].as_f64().unwrap() > 500_000.0, "{held}");
    assert_eq!(trace_of_all["otherData"]["notes"], serde_json::json!([]));

    let part = trace(&lab, run, &["--from", "10", "--to", "12"]);
    let numbers: Vec<&Value> = select(&part, &[("name", "tick".into())])
        .iter()
        .map(|event| &event["args"]["tick"])
        .collect();
    assert_eq!(numbers, [10, 11, 12]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_trace_of_a_run_in_one_process_states_what_it_lacks() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "local", "--duration", "5 s"]);
    let trace = trace(&lab, "local", &[]);
    assert_eq!(select(&trace, &[("name", "tick".into())]).len(), 11);
    assert!(select(&trace, &[("name", "report".into())]).is_empty());
    let note = trace["otherData"]["notes"][0].as_str().unwrap();
    assert!(
        note.contains("the robots ran in the simulator's process"),
        "{note}"
    );
}

#[test]
fn an_export_that_fails_names_the_reason_and_leaves_nothing_behind() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "hall", "--duration", "60 s"]);
    let place = |name: &str| lab.out().join(name);
    let tables = place("tables").to_str().unwrap().to_owned();
    let fails = |args: &[&str], code: i32, reason: &str| {
        let (found, text) = lab.fails(args);
        let text = text
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect::<Vec<_>>()
            .join(" ");
        assert_eq!(found, code, "{args:?}: {text}");
        assert!(text.contains(reason), "{args:?}: {text}");
        assert!(!place("tables").exists(), "{args:?}");
    };

    fails(
        &["export", "hall", "-o", &tables],
        2,
        "required arguments were not provided",
    );
    fails(
        &["export", "nowhere", "--csv", "-o", &tables],
        1,
        "there is no run nowhere",
    );
    fails(
        &["export", "hall", "--csv"],
        2,
        "required arguments were not provided",
    );
    fails(
        &["export", "hall", "--csv", "--trace", "-o", &tables],
        2,
        "cannot be used with",
    );
    fails(
        &["export", "hall", "--csv", "-o", &tables, "--epoch", "7"],
        1,
        "has no epoch 7, the last one is 1",
    );
    fails(
        &["export", "nowhere", "--trace"],
        1,
        "there is no run nowhere",
    );
    fails(
        &["export", "hall", "--trace", "--epoch", "0"],
        1,
        "has no epoch 0",
    );
    fails(
        &["export", "hall", "--trace", "--from", "500"],
        1,
        "has ticks 0 to 120, none of 500",
    );
    fails(
        &["export", "hall", "--trace", "-o", "/nowhere/trace.json"],
        1,
        "cannot write /nowhere/trace.json",
    );
    lab.ok(&["export", "hall", "--trace", "-o", "/dev/null"]);
    let recording = lab.file("hall", "run.mcap");
    fails(
        &[
            "export",
            "hall",
            "--trace",
            "-o",
            recording.to_str().unwrap(),
        ],
        1,
        "is part of the record",
    );
    let file = lab.write("a-file", "kept");
    fails(
        &["export", "hall", "--csv", "-o", file.to_str().unwrap()],
        1,
        "cannot write",
    );
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");

    // A folder that was there stays, with what was in it.
    std::fs::create_dir_all(place("other/variables.csv")).unwrap();
    let other = place("other");
    fails(
        &["export", "hall", "--csv", "-o", other.to_str().unwrap()],
        1,
        "something else than a file is there",
    );
    let left: Vec<_> = std::fs::read_dir(&other)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["variables.csv"]);

    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let output = lab
        .cars(&["export", "hall", "--trace"])
        .stdout(full)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("No space left on device"), "{errors}");
}

/// PedPy reads where robots and guests were as the recording has it, guests who come and go included.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn pedpy_reads_trajectories_unchanged() {
    let lab = Lab::new();
    let hall = "configs/recorded_hall.toml";
    lab.ok(&["run", hall, "--set", "duration=60 s", "--run", "people"]);
    let file = lab.out().join("people.txt");
    let path = file.to_str().unwrap();
    lab.ok(&["export", "people", "--trajectories", "-o", path]);

    let recording = Recording::open(&lab.out().join("people/run.mcap")).unwrap();
    let mut expected = Vec::new();
    for tick in recording.read(0, recording.len()).unwrap() {
        let frame = &tick.frame;
        let mut add = |id: f64, x: f64, y: f64| expected.push([id, frame.tick as f64, x, y]);
        // Butler, Leguin, and the guests after them.
        for (id, robot) in [1.0, 2.0].into_iter().zip(&frame.robots) {
            let millimeters = |length_m: f64| (length_m * 1000.0).round() / 1000.0;
            add(
                id,
                millimeters(robot.location.x),
                millimeters(robot.location.y),
            );
        }
        for (number, place) in frame.guest_numbers.iter().zip(frame.guests_mm.chunks(2)) {
            let [x, y] = [place[0], place[1]].map(|mm| mm as f64 / 1000.0);
            add(f64::from(*number) + 3.0, x, y);
        }
    }
    assert!(expected.len() > 500, "{}", expected.len());

    let text = std::fs::read_to_string(&file).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(rows.count(), expected.len());

    let script = script("trajectories.py");
    let Some(output) = python(lab.out(), &["pedpy"], &[&script, path]) else {
        return;
    };
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(read["frame_rate"], 2.0);
    let rows: Vec<[f64; 4]> = serde_json::from_value(read["rows"].clone()).unwrap();
    assert_eq!(rows.len(), expected.len());
    for (row, expected) in rows.iter().zip(&expected) {
        let is_equal = row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(is_equal, "{row:?} is not {expected:?}");
    }
}

/// mcap-ros2-support and rosbags read a bag; in it is what the recording has, in the bytes that ROS 2 has for it.
#[test]
fn readers_of_ros_2_read_a_bag_as_the_recording_has_it() {
    let lab = Lab::new();
    let hall = "configs/recorded_hall.toml";
    lab.ok(&["run", hall, "--set", "duration=60 s", "--run", "bag"]);
    let file = lab.out().join("bag.mcap");
    let path = file.to_str().unwrap();
    lab.ok(&["export", "bag", "--ros", "-o", path]);

    let modules = ["mcap_ros2", "rosbags"];
    let Some(output) = python(lab.out(), &modules, &[&script("ros.py"), path]) else {
        return;
    };
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(read["profile"], "ros2");
    // As ROS 2 has them (Kilted, in `share/*/msg/*.json`).
    for (name, hash) in [
        ("rosgraph_msgs/msg/Clock", "692f7a66"),
        ("nav_msgs/msg/Odometry", "3cc97dc7"),
        ("tf2_msgs/msg/TFMessage", "e369d0f0"),
    ] {
        let found = read["hashes"][name].as_str().unwrap();
        assert!(
            found.starts_with(&format!("RIHS01_{hash}")),
            "{name}: {found}"
        );
    }

    let topics = &read["topics"];
    let recording = Recording::open(&lab.out().join("bag/run.mcap")).unwrap();
    let ticks = recording.read(0, recording.len()).unwrap();
    let mut last: Option<[f64; 2]> = None;
    for (index, tick) in ticks.iter().enumerate() {
        let time_s = index as f64 / 2.0;
        assert_eq!(topics["/clock"][index], time_s);
        let guests: Vec<[f64; 2]> = tick.frame.guests().map(|(_, at_m)| at_m).collect();
        assert_eq!(topics["/guests"][index], json!(guests));

        let butler = &tick.frame.robots[0];
        let at_m = [butler.location.x, butler.location.y];
        let transform = json!(["map", "Butler/base_link", at_m[0], at_m[1]]);
        assert_eq!(topics["/tf"][index][0], transform);
        let odometry: [f64; 8] =
            serde_json::from_value(topics["/Butler/odom"][index].clone()).unwrap();
        assert_eq!(odometry[..3], [time_s, at_m[0], at_m[1]]);
        // The quaternion has the direction of motion, and the velocity is that of the body, seen from it.
        let [z, w] = [odometry[3], odometry[4]];
        let direction_rad = tick.reports[&butler.name].direction_rad;
        let turned_rad = 2.0 * libm::atan2(z, w) - direction_rad;
        assert!(libm::remainder(turned_rad, std::f64::consts::TAU).abs() < 1e-9);
        if let Some(last) = last {
            let moved_mps = [0, 1].map(|axis| (at_m[axis] - last[axis]) * 2.0);
            let [ahead, left] = [odometry[5], odometry[6]];
            let [cos, sin] = [w * w - z * z, 2.0 * w * z];
            assert!((ahead * cos - left * sin - moved_mps[0]).abs() < 1e-9);
            assert!((ahead * sin + left * cos - moved_mps[1]).abs() < 1e-9);
        }
        last = Some(at_m);
    }

    let texts =
        |topic: &str| -> Vec<String> { serde_json::from_value(topics[topic].clone()).unwrap() };
    let mut emotions = Vec::new();
    let mut commands = Vec::new();
    let mut sent = BTreeMap::new();
    let mut events = 0;
    for event in lab.events("bag") {
        let text = |key: &str| event[key].as_str().unwrap_or_default().to_owned();
        match text("event").as_str() {
            "emotion" if event["robot"] == "Butler" => emotions.push(text("to")),
            "command_sent" => {
                sent.insert(event["seq"].as_u64(), text("command"));
            }
            "command_delivered" if event["to"] == "Leguin" => {
                commands.push((event["seq"].as_u64(), sent[&event["seq"].as_u64()].clone()));
            }
            _ => {}
        }
        events += 1;
    }
    assert_eq!(texts("/Butler/emotion"), emotions);
    assert_eq!(texts("/events").len(), events);
    let received: Vec<Value> = texts("/Leguin/command")
        .iter()
        .map(|command| serde_json::from_str(command).unwrap())
        .collect();
    let received: Vec<(Option<u64>, String)> = received
        .iter()
        .map(|command| {
            (
                command["seq"].as_u64(),
                command["command"].as_str().unwrap().to_owned(),
            )
        })
        .collect();
    assert!(!commands.is_empty());
    assert_eq!(received, commands);
}
