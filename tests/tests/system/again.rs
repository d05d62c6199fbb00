//! Runs that are executed again: verified against their record, compared with one another, resumed.

use std::path::Path;
use std::sync::Arc;

use nix::sys::signal::Signal;
use protocol::Event;
use recording::{Header, RecordedTick, Recording, Writer};
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::{Lab, assert_same, eventually, root};

const HALL: &str = "launch/hors_doeuvres.toml";

/// Verifies a run of a lab; returns what is printed.
fn verify(lab: &Lab, run: &str) -> String {
    lab.ok(&["verify", run])
}

#[test]
fn every_shipped_scenario_is_executed_again_with_the_same_result() {
    let lab = Lab::new();
    let mut count = 0;
    for entry in std::fs::read_dir(root().join("configs")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let is_scenario = path.extension().is_some_and(|ending| ending == "toml");
        // Its robots are not of this process: see below.
        if !is_scenario || name == "any_language" {
            continue;
        }
        lab.ok(&["run", path.to_str().unwrap(), "--duration", "60 s"]);

        let said = verify(&lab, &name);
        assert!(said.contains("the same, "), "{name}: {said}");
        assert!(said.contains("to the end"), "{name}: {said}");
        count += 1;
    }
    assert!(count >= 5, "{count}");
}

#[test]
fn every_shipped_launch_of_these_robots_is_executed_again_with_the_same_result() {
    let lab = Lab::new();
    for name in ["hors_doeuvres", "partition", "three_robots"] {
        let file = format!("launch/{name}.toml");
        let args = ["launch", &file, "--no-console", "--speed", "max"];
        lab.ok(&[&args[..], &["--duration", "60 s"]].concat());

        let said = verify(&lab, name);
        assert!(said.contains("the same, 120 ticks to the end"), "{said}");
        assert!(!said.contains("taken from the record"), "{said}");
    }
}

/// The hall as processes, of which Leguin crashes and Butler hangs, both without holding the clock.
const FAULTS: &str = r#"fault=[
    { robot = "Leguin", do = "crash", at = "10 s", until = "16 s" },
    { robot = "Butler", do = "hang", at = "20 s", until = "24 s" },
]"#;

#[test]
fn faults_lost_commands_and_returns_are_executed_again_from_the_scenario() {
    let lab = Lab::new();
    lab.ok(&[
        "launch",
        HALL,
        "--run",
        "faults",
        "--no-console",
        "--speed",
        "max",
        "--duration",
        "60 s",
        "--set",
        FAULTS,
        "--set",
        "on_late=continue",
        "--set",
        "network.commands={ loss = 0.3 }",
    ]);

    let said = verify(&lab, "faults");
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    assert!(!said.contains("taken from the record"), "{said}");
    let said = lab.ok(&["verify", "faults", "--processes"]);
    assert!(said.contains("the same as processes, 120 ticks"), "{said}");
}

#[test]
fn a_robot_of_another_language_is_taken_from_the_record() {
    let lab = Lab::new();
    let scenario = lab.write(
        "scenario.toml",
        r#"
            seed = 3
            tick = "0.5 s"
            duration = "20 s"

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
        "#,
    );
    let stroller = root().join("sdk/stdio/bash/stroller.sh");
    let launch = format!(
        r#"
            scenario = {scenario:?}

            [[process]]
            name = "Bruno"
            command = ["cars", "exec", "--", {stroller:?}]

            [[process]]
            name = "Vonda"
            command = ["cars-vonda"]
        "#
    );
    let launch = lab.write("bruno.toml", &launch);
    let launch = launch.to_str().unwrap();
    lab.ok(&["launch", launch, "--no-console", "--speed", "max"]);

    let said = verify(&lab, "bruno");
    assert!(said.contains("the same, 40 ticks to the end"), "{said}");
    let note = "Bruno could not be executed in this process from tick 0 on";
    assert!(said.contains(note), "{said}");
    assert!(!said.contains("Vonda could not"), "{said}");
}

/// Its recording is written in chunks, so that it ends before the events do.
#[test]
fn a_killed_run_of_a_robot_that_cannot_be_executed_is_compared_as_far_as_it_was_recorded() {
    let lab = Lab::new();
    let scenario = lab.write(
        "alone.toml",
        "duration = \"60 s\"\n[[robot]]\nname = \"Bruno\"\nat = [\"5 ft\", \"5 ft\"]\n",
    );
    let stroller = root().join("sdk/stdio/bash/stroller.sh");
    let launch = lab.write(
        "bruno.toml",
        &format!(
            "scenario = {scenario:?}\n[[process]]\nname = \"Bruno\"\ncommand = [\"cars\", \"exec\", \"--\", {stroller:?}]\n"
        ),
    );
    let run = "bruno";
    let mut launch = lab.paused(run, launch.to_str().unwrap(), &["--no-console"]);
    let length = || Recording::open(&lab.file(run, "run.mcap")).map_or(0, |file| file.len());
    let recorded = eventually("a chunk that ends before the last tick", || {
        let tick = lab.step(run, 1);
        let recorded = length();
        (recorded > 0 && recorded <= tick).then_some(recorded)
    });
    kill_simulator(&mut launch, run);
    assert_eq!(length(), recorded);

    let said = verify(&lab, run);
    let same = format!("the same, {} ticks and no end", recorded - 1);
    assert!(said.contains(&same), "{said}");
    assert!(said.contains("the events go on: Bruno"), "{said}");

    // Killed before there is a chunk.
    let path = lab.file(run, "run.mcap");
    let recording = Recording::open(&path).unwrap();
    let scenario = recording.scenario().unwrap();
    // It is finished when the writer is dropped.
    let mut writer = Writer::create(&path, recording.header(), &scenario).unwrap();
    writer.sync().unwrap();
    let (_, said) = lab.fails(&["verify", run]);
    assert!(said.contains("the simulator was killed"), "{said}");
}

/// Starts the hall and waits until it has reached a tick.
fn start_hall(lab: &Lab, run: &str, tick: u64, args: &[&str]) -> Running {
    let mut all = vec!["launch", HALL, "--no-console", "--duration", "60 s"];
    all.extend(args);
    let launch = lab.start(run, &all);
    await_tick(lab, run, tick);
    launch
}

fn await_tick(lab: &Lab, run: &str, tick: u64) {
    let event = format!("{{\"tick\":{tick},\"event\":\"tick\"");
    eventually("a tick", || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        events.contains(&event).then_some(())
    });
}

#[test]
fn what_an_operator_and_the_machine_did_is_taken_from_the_record() {
    let lab = Lab::new();
    let run = "by-hand";
    let continues = ["--set", "on_late=continue", "--set", "deadline=0.3 s"];
    let mut launch = start_hall(
        &lab,
        run,
        10,
        &[&["--speed", "10"], &continues[..]].concat(),
    );
    lab.ok(&["ctl", "command", "Leguin", "hurry", "--run", run]);
    // She misses ticks, and goes on without having been lost, or comes back.
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    eventually("a missed tick", || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        events
            .contains("\"missed\",\"robot\":\"Leguin\"")
            .then_some(())
    });
    send(leguin, Signal::SIGCONT);
    launch.finish();

    let said = verify(&lab, run);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    let (_, refused) = lab.fails(&["verify", run, "--processes"]);
    assert!(refused.contains("commands of an operator"), "{refused}");
    let events = String::from_utf8(lab.bytes(run)).unwrap();
    assert!(events.contains("\"from\":\"operator\""));
}

#[test]
fn ticks_that_a_robot_missed_are_not_repeated_by_processes() {
    let lab = Lab::new();
    let run = "missed";
    let mut args = vec!["--no-console", "--duration", "60 s"];
    args.extend(["--set", "on_late=continue", "--set", "deadline=0.3 s"]);
    let mut launch = lab.paused(run, HALL, &args);
    lab.step(run, 5);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    lab.step(run, 3);
    send(leguin, Signal::SIGCONT);
    lab.ctl(run, &["start"]);
    launch.finish();

    assert!(verify(&lab, run).contains("the same, 120 ticks to the end"));
    let (code, refused) = lab.fails(&["verify", run, "--processes"]);
    assert_eq!(code, 1);
    let refused = refused.split_whitespace().collect::<Vec<_>>().join(" ");
    let reason = "that Leguin missed without a fault of the scenario, from tick 6 on";
    assert!(refused.contains(reason), "{refused}");
}

/// Changes the first place where a text stands after another one in a file.
fn replace(file: &Path, after: &str, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    let begin = text.find(after).expect("the text is there");
    let place = begin + text[begin..].find(from).expect("the text is there");
    let changed = format!("{}{to}{}", &text[..place], &text[place + from.len()..]);
    std::fs::write(file, changed).unwrap();
}

#[test]
fn a_record_that_is_not_what_the_scenario_gives_is_told_by_tick_robot_and_field() {
    let lab = Lab::new();
    let whole = |run: &str| {
        lab.ok(&["run", HALL, "--run", run, "--duration", "60 s"]);
        lab.file(run, "events.jsonl")
    };

    // One byte of an event. The tick is that of the line.
    let events = whole("byte");
    let text = std::fs::read_to_string(&events).unwrap();
    let line = text
        .lines()
        .find(|line| line.contains("\"to\":\"CONFIDENT\""))
        .unwrap();
    let tick = line.split(&[':', ','][..]).nth(1).unwrap().to_owned();
    replace(&events, line, "CONFIDENT", "CONFIDENX");
    let (code, said) = lab.fails(&["verify", "byte"]);
    assert_eq!(code, 1);
    let place = format!("the first difference: tick {tick}, Butler, emotion.to");
    assert!(said.contains(&place), "{said}");
    assert!(
        said.contains("CONFIDENX") && said.contains("\"CONFIDENT\""),
        "{said}"
    );

    // Another seed. With a recording the change of the scenario itself would be told.
    let unrecorded = |run: &str| {
        let frames = ["--set", "record.frames=false"];
        lab.ok(&[
            &["run", HALL, "--run", run, "--duration", "60 s"],
            &frames[..],
        ]
        .concat());
    };
    unrecorded("seed");
    replace(&lab.file("seed", "scenario.toml"), "seed", "2002", "2003");
    let (_, said) = lab.fails(&["verify", "seed"]);
    assert!(said.contains("tick 0, init.seed"), "{said}");

    // A robot with another parameter.
    unrecorded("parameter");
    let scenario = lab.file("parameter", "scenario.toml");
    replace(
        &scenario,
        "name = \"Leguin\"",
        "v_refill_mps = 0.",
        "v_refill_mps = 1.",
    );
    let (_, said) = lab.fails(&["verify", "parameter"]);
    assert!(said.contains("the first difference: tick "), "{said}");

    // A program that is not what the scenario says it is.
    let scenario = root().join("configs/hors_doeuvres.toml");
    let stroller = root().join("sdk/stdio/bash/stroller.sh");
    let launch = format!(
        r#"
            scenario = {scenario:?}

            [[process]]
            name = "Butler"
            command = ["cars-butler"]

            [[process]]
            name = "Leguin"
            command = ["cars", "exec", "--", {stroller:?}]
        "#
    );
    let launch = lab.write("impostor.toml", &launch);
    let launch = launch.to_str().unwrap();
    lab.ok(&[
        "launch",
        launch,
        "--no-console",
        "--speed",
        "max",
        "--duration",
        "5 s",
    ]);
    let (_, said) = lab.fails(&["verify", "impostor"]);
    assert!(
        said.contains("the first difference: tick 0, Leguin, "),
        "{said}"
    );

    // A seal that was changed, where nothing else differs.
    let events = whole("seal");
    let text = std::fs::read_to_string(&events).unwrap();
    let at = text.find("\"seal\":\"").unwrap() + 8;
    let other = if &text[at..=at] == "0" { "1" } else { "0" };
    let changed = format!("{}{other}{}", &text[..at], &text[at + 1..]);
    std::fs::write(&events, changed).unwrap();
    let (_, said) = lab.fails(&["verify", "seal"]);
    assert!(said.contains("are damaged"), "{said}");
}

#[test]
fn a_record_that_is_not_whole_is_not_the_same() {
    let lab = Lab::new();
    let fails = |run: &str| {
        let (code, said) = lab.fails(&["verify", run]);
        assert_eq!(code, 1, "{run}: {said}");
        assert!(!said.contains("panicked"), "{run}: {said}");
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    for run in ["cut", "gone", "events", "empty", "order", "scenario"] {
        lab.ok(&["run", HALL, "--run", run, "--duration", "30 s"]);
    }
    let keep = |run: &str, file: &str, share: f64| {
        let path = lab.file(run, file);
        let bytes = std::fs::read(&path).unwrap();
        let kept = (bytes.len() as f64 * share) as usize;
        std::fs::write(&path, &bytes[..kept]).unwrap();
    };

    keep("cut", "run.mcap", 0.7);
    let said = fails("cut");
    assert!(said.contains("run.mcap"), "{said}");
    std::fs::remove_file(lab.file("gone", "run.mcap")).unwrap();
    assert!(fails("gone").contains("is not there"));
    keep("events", "events.jsonl", 0.5);
    assert!(fails("events").contains("it has a summary"));
    keep("empty", "events.jsonl", 0.0);
    assert!(fails("empty").contains("no complete tick"));

    let events = lab.file("order", "events.jsonl");
    let text = std::fs::read_to_string(&events).unwrap();
    let at = text.find("{\"tick\":10,").unwrap();
    let stray = "{\"tick\":0,\"event\":\"tick\",\"digest\":\"aa\"}\n";
    std::fs::write(&events, format!("{}{stray}{}", &text[..at], &text[at..])).unwrap();
    assert!(fails("order").contains("tick 0 where tick 10 is due"));

    replace(
        &lab.file("scenario", "scenario.toml"),
        "duration",
        "30 s",
        "90 s",
    );
    assert!(fails("scenario").contains("was changed since the run"));
}

/// Writes the recording of a run anew with something changed, whole and with its checksums.
fn forge(lab: &Lab, run: &str, change: impl Fn(&mut Header, &mut RecordedTick)) {
    let path = lab.file(run, "run.mcap");
    let ticks = lab.recorded(run);
    let recording = Recording::open(&path).unwrap();
    let mut header = recording.header().clone();
    let scenario = recording.scenario().unwrap();
    change(&mut header, &mut ticks[0].clone());

    let mut writer = Writer::create(&path, &header, &scenario).unwrap();
    for mut tick in ticks {
        change(&mut header, &mut tick);
        writer.tick(tick).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn what_only_the_recording_has_is_compared_too() {
    let lab = Lab::new();
    let run = "forged";
    let forged = |change: fn(&mut Header, &mut RecordedTick)| {
        lab.ok(&["run", HALL, "--run", run, "--duration", "60 s"]);
        forge(&lab, run, change);
        let (code, said) = lab.fails(&["verify", run]);
        assert_eq!(code, 1, "{said}");
        said
    };

    lab.ok(&["run", HALL, "--run", run, "--duration", "60 s"]);
    forge(&lab, run, |_, _| {});
    assert!(verify(&lab, run).contains("the same, 120 ticks to the end"));

    let said = forged(|_, tick| {
        if tick.tick() == 30 {
            tick.frame.robots[1].location.x += 0.5;
        }
    });
    assert!(said.contains("tick 30, Leguin, location.x"), "{said}");
    let said = forged(|_, tick| {
        if tick.tick() == 31 {
            tick.frame.guests_mm[7] += 1;
        }
    });
    assert!(said.contains("tick 31, frame.guests_mm.7"), "{said}");
    let said = forged(|_, tick| {
        for event in Arc::make_mut(&mut tick.events) {
            if let Event::Emotion { to, .. } = event {
                "CONCERNEX".clone_into(to);
            }
        }
    });
    assert!(
        said.contains("Butler, emotion.to in the recording"),
        "{said}"
    );
    let said = forged(|_, tick| {
        if tick.tick() == 120 {
            Arc::make_mut(&mut tick.events).pop();
        }
    });
    assert!(said.contains("tick 120, event in the recording"), "{said}");
    let said = forged(|_, tick| {
        if tick.tick() == 50 {
            let event = tick.events[0].clone();
            Arc::make_mut(&mut tick.events).push(event);
        }
    });
    assert!(said.contains("has events of tick 50"), "{said}");
    let said = forged(|header, _| header.seed = 7);
    assert!(said.contains("tick 0, header.seed"), "{said}");
}

#[test]
fn two_runs_are_compared_up_to_the_end_of_both() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "one", "--duration", "60 s"]);
    lab.ok(&["run", HALL, "--run", "longer", "--duration", "90 s"]);
    let lossy = "network.commands={ loss = 1.0 }";
    lab.ok(&[
        "run",
        HALL,
        "--run",
        "lossy",
        "--duration",
        "60 s",
        "--set",
        lossy,
    ]);

    assert!(
        lab.ok(&["diff", "one", "one"])
            .contains("the same, 120 ticks")
    );
    let (code, said) = lab.fails(&["diff", "one", "longer"]);
    assert_eq!(code, 1);
    assert!(said.contains("tick 120 and tick 180"), "{said}");

    let (_, said) = lab.fails(&["diff", "one", "lossy", "--json"]);
    let comparison: serde_json::Value = serde_json::from_str(&said).unwrap();
    let events = lab.events("lossy");
    let lost = events
        .iter()
        .find(|event| event["event"] == "command_dropped");
    assert_eq!(comparison["first"]["tick"], lost.unwrap()["tick"]);
    let dropped = events
        .iter()
        .filter(|event| event["event"] == "command_dropped");
    assert_eq!(comparison["only_in"]["command_dropped"][1], dropped.count());
}

/// Kills the simulator of a launch that has reached a tick, and waits until all of it is gone.
fn kill_simulator(launch: &mut Running, run: &str) {
    send(launch.process("cars-sim"), Signal::SIGKILL);
    assert!(!launch.wait().success());
    nobody_is_left(run);
}

#[test]
fn a_run_whose_simulator_was_killed_goes_on_as_if_nothing_had_happened() {
    let lab = Lab::new();
    let run = "resumed";
    let set = ["--set", "network.commands={ loss = 0.2 }", "--set", FAULTS];
    let set = [&set[..], &["--set", "on_late=continue"]].concat();
    let mut launch = start_hall(&lab, run, 30, &[&["--speed", "10"], &set[..]].concat());
    kill_simulator(&mut launch, run);
    let killed_at = lab.bytes(run);

    // Killed again after it has gone on.
    let resume = ["launch", "--no-console", "--resume", run];
    let mut again = Running::start(lab.cars(&resume), run, lab.out().join(run));
    await_tick(&lab, run, 60);
    kill_simulator(&mut again, run);
    assert!(lab.bytes(run).len() > killed_at.len());
    lab.ok(&[&resume[..], &["--speed", "max"]].concat());

    let whole = [
        "launch",
        HALL,
        "--no-console",
        "--run",
        "whole",
        "--duration",
        "60 s",
    ];
    lab.ok(&[&whole[..], &["--speed", "max"], &set].concat());
    assert_same(("resumed", &lab.bytes(run)), ("whole", &lab.bytes("whole")));
    let log = |run| std::fs::read_to_string(lab.file(run, "cars.log")).unwrap();
    assert_eq!(log(run), log("whole"));
    let said = verify(&lab, run);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
}

/// The simulator ends the run in order where its launcher is killed, or somebody stops it. The run goes on from there.
#[test]
fn a_run_whose_launcher_was_killed_or_that_was_stopped_is_resumed() {
    let lab = Lab::new();
    let run = "stopped";
    let mut launch = start_hall(&lab, run, 20, &["--speed", "10"]);
    launch.signal(Signal::SIGKILL);
    launch.wait();
    nobody_is_left(run);
    let ticks = lab.summary(run)["ticks"].as_u64().unwrap();
    assert_eq!(lab.events(run).pop().unwrap()["reason"], "stopped");

    let resume = ["launch", "--no-console", "--resume", run];
    let paced = [&resume[..], &["--speed", "10"]].concat();
    let mut again = Running::start(lab.cars(&paced), run, lab.out().join(run));
    let further = format!("{{\"tick\":{},\"event\":\"tick\"", ticks + 10);
    eventually("further ticks", || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        events.contains(&further).then_some(())
    });
    lab.ctl(run, &["stop"]);
    again.wait();
    nobody_is_left(run);
    assert_eq!(lab.events(run).pop().unwrap()["reason"], "stopped");

    lab.ok(&[&resume[..], &["--speed", "max"]].concat());
    lab.ok(&["run", HALL, "--run", "whole", "--duration", "60 s"]);
    assert_same(("resumed", &lab.bytes(run)), ("whole", &lab.bytes("whole")));
    let log = |run| std::fs::read_to_string(lab.file(run, "cars.log")).unwrap();
    assert_eq!(log(run), log("whole"));
    let said = verify(&lab, run);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    let (_, refused) = lab.fails(&resume);
    assert!(refused.contains("has ended"), "{refused}");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn an_epoch_after_init_is_resumed_and_the_one_before_is_kept() {
    let lab = Lab::new();
    let run = "second-epoch";
    let mut launch = start_hall(&lab, run, 10, &["--speed", "10"]);
    lab.ctl(run, &["init", "--seed", "7"]);
    lab.until_ready(run);
    let first = std::fs::read(lab.file(run, "events-epoch1.jsonl")).unwrap();
    let log = std::fs::read_to_string(lab.file(run, "cars.log")).unwrap();
    lab.step(run, 15);
    kill_simulator(&mut launch, run);

    lab.ok(&["launch", "--no-console", "--resume", run, "--speed", "max"]);
    let kept = std::fs::read(lab.file(run, "events-epoch1.jsonl")).unwrap();
    assert_same(("kept", &kept), ("first", &first));
    let resumed = std::fs::read_to_string(lab.file(run, "cars.log")).unwrap();
    assert!(resumed.starts_with(&log), "{resumed}");
    lab.ok(&[
        "run",
        HALL,
        "--run",
        "whole",
        "--seed",
        "7",
        "--duration",
        "60 s",
    ]);
    assert_same(("resumed", &lab.bytes(run)), ("whole", &lab.bytes("whole")));
    let said = verify(&lab, run);
    assert!(
        said.contains("epoch 1: the same") && said.contains("epoch 2: the same"),
        "{said}"
    );

    // Killed before a tick of the second epoch was complete.
    for file in ["events.jsonl", "run.mcap", "summary.json"] {
        std::fs::remove_file(lab.file(run, file)).unwrap();
    }
    lab.ok(&["launch", "--no-console", "--resume", run, "--speed", "max"]);
    assert_same(("resumed", &lab.bytes(run)), ("whole", &lab.bytes("whole")));
    let said = verify(&lab, run);
    assert!(
        said.contains("epoch 2: the same, 120 ticks to the end"),
        "{said}"
    );
}

#[test]
fn a_run_that_cannot_be_resumed_keeps_its_record() {
    let lab = Lab::new();
    let resume = |run: &str| lab.fails(&["launch", "--no-console", "--resume", run]).1;
    lab.ok(&["run", HALL, "--run", "local", "--duration", "10 s"]);
    assert!(resume("local").contains("has ended"));
    assert!(resume("nowhere").contains("there is no run nowhere"));

    let run = "other";
    let mut launch = start_hall(&lab, run, 20, &["--speed", "10"]);
    assert!(resume(run).contains("is in progress"));
    kill_simulator(&mut launch, run);

    // The robots are not the ones of the record: their parameters are others.
    let record = lab.bytes(run);
    let scenario = lab.file(run, "scenario.toml");
    let text = std::fs::read_to_string(&scenario).unwrap();
    replace(&scenario, "seed", "2002", "2003");
    let said = resume(run);
    assert!(said.contains("cannot be resumed"), "{said}");
    assert!(said.contains("tick 0, init.seed"), "{said}");
    assert_same(("kept", &lab.bytes(run)), ("record", &record));

    // A damaged record is refused; one that ends in the middle of a line is not.
    std::fs::write(&scenario, text).unwrap();
    let events = lab.file(run, "events.jsonl");
    let mut damaged = record.clone();
    damaged[200] ^= 1;
    std::fs::write(&events, &damaged).unwrap();
    assert!(resume(run).contains("are damaged"));
    std::fs::write(&events, &record[..record.len() - 7]).unwrap();
    lab.ok(&["launch", "--no-console", "--resume", run, "--speed", "max"]);
    lab.ok(&["run", HALL, "--run", "whole", "--duration", "60 s"]);
    assert_same(("resumed", &lab.bytes(run)), ("whole", &lab.bytes("whole")));
}

/// The hall under `on_late = "continue"`, paced, whose processes have these options in the launch file.
struct Unattended {
    lab: Lab,
    run: &'static str,
}

impl Unattended {
    /// Starts it and waits until it has reached a tick.
    fn start(run: &'static str, options: &str, tick: u64, args: &[&str]) -> (Self, Running) {
        let lab = Lab::new();
        let scenario = root().join("configs/hors_doeuvres.toml");
        let mut launch = format!("scenario = {scenario:?}\n");
        for (name, program) in [("Butler", "cars-butler"), ("Leguin", "cars-leguin")] {
            launch.push_str(&format!(
                "[[process]]\nname = {name:?}\ncommand = [{program:?}]\n{options}\n"
            ));
        }
        let file = lab.write("unattended.toml", &launch);
        let all = [
            "launch",
            file.to_str().unwrap(),
            "--no-console",
            "--speed",
            "10",
            // Longer than any of these tests waits.
            "--duration",
            "600 s",
            "--set",
            "on_late=continue",
            "--set",
            "deadline=0.3 s",
        ];
        let launch = lab.start(run, &[&all[..], args].concat());
        await_tick(&lab, run, tick);
        (Self { lab, run }, launch)
    }

    /// Waits for an event of Leguin's, such as `"lost"`.
    fn await_event(&self, event: &str) {
        let text = match event.strip_prefix("joined ") {
            Some(incarnation) => {
                format!("\"joined\",\"robot\":\"Leguin\",\"generation\":{incarnation},")
            }
            None => format!("\"event\":\"{event}\",\"robot\":\"Leguin\""),
        };
        eventually(event, || {
            let events = std::fs::read_to_string(self.lab.file(self.run, "events.jsonl")).ok()?;
            events.contains(&text).then_some(())
        });
    }

    /// The ticks of Leguin's events of this kind, without that of the beginning.
    fn ticks(&self, kind: &str) -> Vec<u64> {
        self.ticks_of("Leguin", kind)
    }

    /// The same of any robot.
    fn ticks_of(&self, robot: &str, kind: &str) -> Vec<u64> {
        let mut ticks = Vec::new();
        let (whole, _) = complete(&self.lab.bytes(self.run));
        for line in String::from_utf8(whole).unwrap().lines() {
            let event: serde_json::Value = serde_json::from_str(line).unwrap();
            let is_later = kind != "joined" || event["generation"].is_u64();
            if event["event"] == kind && event["robot"] == robot && is_later {
                ticks.push(event["tick"].as_u64().unwrap());
            }
        }
        ticks
    }

    /// Waits for further ticks.
    fn await_ticks(&self, further: u64) {
        let reached = complete(&self.lab.bytes(self.run)).1;
        await_tick(&self.lab, self.run, reached + further);
    }

    /// Kills the simulator; returns the record up to the last complete tick, and that tick.
    fn kill(&self, launch: &mut Running) -> (Vec<u8>, u64) {
        kill_simulator(launch, self.run);
        complete(&self.lab.bytes(self.run))
    }

    /// Resumes the run at its pace, and waits for ticks after those that were recorded, which are the same then.
    fn resume(&self, recorded: &(Vec<u8>, u64)) -> Running {
        let resume = ["launch", "--no-console", "--resume", self.run];
        let folder = self.lab.out().join(self.run);
        let again = Running::start(self.lab.cars(&resume), self.run, folder);
        await_tick(&self.lab, self.run, recorded.1 + 5);
        self.assert_kept(&recorded.0);
        again
    }

    /// Resumes the run to its end, and verifies it.
    fn finish(&self, recorded: &(Vec<u8>, u64)) {
        let resume = ["launch", "--no-console", "--resume", self.run];
        self.lab.ok(&[&resume[..], &["--speed", "max"]].concat());

        self.assert_kept(&recorded.0);
        let said = verify(&self.lab, self.run);
        assert!(said.contains("the same, 1200 ticks to the end"), "{said}");
    }

    fn assert_kept(&self, recorded: &[u8]) {
        let bytes = self.lab.bytes(self.run);
        let kept = &bytes[..recorded.len().min(bytes.len())];
        assert_same(("resumed", kept), ("recorded", recorded));
    }
}

/// A record up to its last complete tick, and that tick.
fn complete(record: &[u8]) -> (Vec<u8>, u64) {
    let text = String::from_utf8_lossy(record);
    let mut whole = 0;
    let mut last = 0;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        at += line.len();
        if line.contains("\"event\":\"tick\"") && line.ends_with('\n') {
            let event: serde_json::Value = serde_json::from_str(line).unwrap();
            last = event["tick"].as_u64().unwrap();
            whole = at;
        }
    }
    (record[..whole].to_vec(), last)
}

const RESTARTS: &str = "restart = \"on-failure\"\nbackoff = \"0.1 s\"";
const NOT_REQUIRED: &str = "required = false";

/// The clock goes on without a robot that died, and its successor takes part: no part of the scenario.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_whose_robot_was_killed_and_came_back_is_resumed_as_often_as_it_is_killed() {
    let (hall, mut launch) = Unattended::start("killed-robot", RESTARTS, 10, &[]);
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    hall.await_event("lost");
    hall.await_event("joined 2");
    hall.await_ticks(2);
    let first = hall.kill(&mut launch);

    let mut again = hall.resume(&first);
    send(again.process("cars-leguin"), Signal::SIGKILL);
    hall.await_event("joined 3");
    hall.await_ticks(2);
    let second = hall.kill(&mut again);
    assert!(second.1 > first.1);
    let (lost, joined) = (hall.ticks("lost"), hall.ticks("joined"));

    hall.finish(&second);
    assert_eq!((lost.len(), joined.len()), (2, 2));
    assert_eq!(hall.ticks("lost"), lost);
    assert_eq!(hall.ticks("joined"), joined);
}

/// A process that was stopped goes on where it was, after ticks that it has missed. Some of them it does too late. However long
/// this machine takes to let it go on, it is not lost: neither by the number of these ticks nor by its link.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_whose_robots_were_stopped_for_some_ticks_is_resumed() {
    let shipped = std::fs::read_to_string(root().join("configs/zenoh/robot.json5")).unwrap();
    let patient = shipped.replace("lease: 2000,", "lease: 60000,");
    assert_ne!(patient, shipped);
    let files = Lab::new();
    let config = files.write("patient.json5", &patient);
    let options = format!("{NOT_REQUIRED}\nenv = {{ CARS_ZENOH_CONFIG = {config:?} }}");

    let args = ["--set", "lose_after=1000"];
    let (hall, mut launch) = Unattended::start("stopped-robots", &options, 10, &args);
    for (robot, program) in [
        ("Leguin", "cars-leguin"),
        ("Butler", "cars-butler"),
        ("Leguin", "cars-leguin"),
    ] {
        let before = hall.ticks_of(robot, "missed").len();
        let process = launch.process(program);
        send(process, Signal::SIGSTOP);
        eventually("missed ticks", || {
            (hall.ticks_of(robot, "missed").len() >= before + 3).then_some(())
        });
        send(process, Signal::SIGCONT);
        hall.await_ticks(10);
    }
    let recorded = hall.kill(&mut launch);
    let of_both = |kind| ["Leguin", "Butler"].map(|robot| hall.ticks_of(robot, kind));
    let (missed, done_late) = (of_both("missed"), of_both("done_late"));
    assert!(missed[0].len() >= 6 && missed[1].len() >= 3, "{missed:?}");
    let lost = of_both("lost").concat();
    assert!(lost.is_empty(), "stopped for too long: {lost:?}");
    assert!(
        done_late.iter().any(|ticks| !ticks.is_empty()),
        "{missed:?}"
    );

    let mut again = hall.resume(&recorded);
    let recorded = hall.kill(&mut again);
    hall.finish(&recorded);
    assert_eq!(of_both("missed"), missed);
    assert_eq!(of_both("done_late"), done_late);
}

/// Its link was given up, as that of a robot that is cut off, and the same process returns.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_whose_robot_was_silent_until_it_was_lost_is_resumed() {
    let (hall, mut launch) = Unattended::start("silent-robot", NOT_REQUIRED, 10, &[]);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    hall.await_event("lost");
    send(leguin, Signal::SIGCONT);
    hall.await_event("joined 2");
    hall.await_ticks(5);
    let recorded = hall.kill(&mut launch);

    let mut again = hall.resume(&recorded);
    let recorded = hall.kill(&mut again);
    hall.finish(&recorded);
    assert_eq!(hall.ticks("lost").len(), 1);
    assert_eq!(hall.ticks("joined").len(), 1);
}

/// No tick was missed: the record has nothing but the further incarnation.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_whose_robot_was_replaced_between_two_ticks_is_resumed() {
    for (run, policy) in [("replaced", "continue"), ("replaced-awaited", "wait")] {
        let on_late = format!("on_late={policy}");
        let args = ["--paused", "--set", &on_late];
        let (hall, mut launch) = Unattended::start(run, RESTARTS, 0, &args);
        hall.lab.until_ready(run);
        hall.lab.step(run, 10);
        send(launch.process("cars-leguin"), Signal::SIGKILL);
        eventually("the successor", || {
            let status = hall.lab.ctl(run, &["status"]);
            let robots = status["robots"].as_array().unwrap();
            let leguin = robots.iter().find(|robot| robot["name"] == "Leguin")?;
            let is_here = leguin["generation"] == 2 && leguin["presence"] == "here";
            is_here.then_some(())
        });
        hall.lab.step(run, 5);
        let recorded = hall.kill(&mut launch);

        hall.finish(&recorded);
        assert!(hall.ticks("missed").is_empty());
        assert_eq!(hall.ticks("joined"), [11]);
    }
}

/// Whether the loss is in the first tick, in the last one, or before it.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_had_not_come_back_takes_part_after_the_last_tick_of_the_record() {
    for (run, before, after) in [
        ("lost-in-the-first-tick", 0, 4),
        ("lost-in-the-last-tick", 20, 1),
        ("lost-before-the-last-tick", 20, 6),
    ] {
        let (hall, mut launch) = Unattended::start(run, NOT_REQUIRED, 0, &["--paused"]);
        hall.lab.until_ready(run);
        if before > 0 {
            hall.lab.step(run, before);
        }
        send(launch.process("cars-leguin"), Signal::SIGKILL);
        let last = hall.lab.step(run, after);
        let recorded = hall.kill(&mut launch);
        assert_eq!(recorded.1, last);
        assert_eq!(hall.ticks("lost"), [before + 1]);

        hall.finish(&recorded);
        assert_eq!(hall.ticks("lost"), [before + 1]);
        assert_eq!(hall.ticks("joined"), [last + 1]);
        let missed: Vec<u64> = (before + 1..=last).collect();
        assert_eq!(hall.ticks("missed"), missed);
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_run_that_lost_a_robot_in_each_of_two_epochs_is_resumed() {
    let run = "lost-in-two-epochs";
    let (hall, mut launch) = Unattended::start(run, RESTARTS, 10, &[]);
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    hall.await_event("joined 2");
    hall.lab.ctl(run, &["init", "--seed", "7"]);
    hall.lab.until_ready(run);
    hall.lab.ctl(run, &["start"]);
    hall.await_ticks(10);
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    hall.await_event("joined 2");
    hall.await_ticks(2);
    let recorded = hall.kill(&mut launch);

    let first = std::fs::read(hall.lab.file(run, "events-epoch1.jsonl")).unwrap();
    hall.finish(&recorded);
    let kept = std::fs::read(hall.lab.file(run, "events-epoch1.jsonl")).unwrap();
    assert_same(("kept", &kept), ("first", &first));
}

#[test]
fn a_table_of_parameters_means_the_same_in_a_scenario_and_in_its_record() {
    let lab = Lab::new();
    let shipped = std::fs::read_to_string(root().join("configs/robots/butler.toml")).unwrap();
    let own = shipped.replacen("th_concerned = 0.45", "th_concerned = 0.6", 1);
    assert_ne!(own, shipped);
    lab.write("own.toml", &own);
    let hall = std::fs::read_to_string(root().join("configs/hors_doeuvres.toml")).unwrap();
    let hall = hall.replacen("robots/butler.toml", "own.toml", 1).replacen(
        "\"robots/leguin.toml\"",
        &format!("{:?}", root().join("configs/robots/leguin.toml")),
        1,
    );
    let changes = "\n[[change]]\nat = \"15 s\"\n\
                   set = ['robot.Butler.params.dynamics={ rho_max = 3.0 }', 'robot.Butler.params={ caution = 0.9 }']\n";
    let file = lab.write("changed.toml", &format!("{hall}{changes}"));
    let file = file.to_str().unwrap();

    lab.ok(&[
        "run",
        file,
        "--duration",
        "60 s",
        "-q",
        "--run",
        "as-written",
    ]);
    let printed = lab.ok(&["verify", "as-written"]);
    assert!(printed.contains("the same"), "{printed}");

    // Its record names no file any more.
    let recorded = lab.file("as-written", "scenario.toml");
    let text = std::fs::read_to_string(&recorded).unwrap();
    assert!(
        !text.contains("params_from") && text.contains("th_concerned = 0.6"),
        "{text}"
    );
    lab.ok(&[
        "run",
        recorded.to_str().unwrap(),
        "-q",
        "--run",
        "as-recorded",
    ]);
    assert_eq!(lab.bytes("as-written"), lab.bytes("as-recorded"));
}
