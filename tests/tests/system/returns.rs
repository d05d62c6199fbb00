//! Processes that die or stop and come back in a launch, in every way: the record is executed again and forked, and the next
//! epoch is that of a fresh start.

use std::time::Duration;

use bus::{Bus, Role};
use nix::sys::signal::Signal;
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::{RobotName, RunName, decode, encode};
use serde_json::{Value, json};
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::{Lab, PATIENCE, assert_same, eventually, root, within};

const FILE: &str = "launch/hors_doeuvres.toml";
/// Leguin is on her way with treats from here on, for some ticks.
const LEGUIN_MOVES: u64 = 212;

/// The ticks of a run in which a robot took part again.
fn joined(lab: &Lab, run: &str, robot: &str) -> Vec<u64> {
    let mut ticks = Vec::new();
    for event in lab.events(run) {
        let is_return = event["event"] == "joined" && event["generation"].is_u64();
        if is_return && event["robot"] == robot {
            ticks.push(event["tick"].as_u64().unwrap());
        }
    }
    ticks
}

/// The record of a run can be executed again, and forked after each of these ticks.
fn assert_again(lab: &Lab, run: &str, ticks: impl IntoIterator<Item = u64>) {
    let said = lab.ok(&["verify", run]);
    assert!(
        said.contains("the same") && said.contains("to the end"),
        "{said}"
    );

    for tick in ticks {
        let fork = format!("{run}-{tick}");
        let from = format!("{run}@{tick}");
        lab.ok(&["fork", &from, "--run", &fork, "--quiet"]);
        let said = lab.ok(&["verify", &fork]);
        assert!(said.contains("the same"), "{said}");
    }
}

fn joined_in(launch: &mut Running, lab: &Lab, run: &str, robot: &str) -> Vec<u64> {
    launch.finish();
    nobody_is_left(run);
    let ticks = joined(lab, run, robot);
    assert!(!ticks.is_empty(), "{robot} has not come back in {run}");
    ticks
}

#[test]
fn a_crash_for_a_time_is_executed_again_where_the_robot_moves() {
    let lab = Lab::new();
    for (robot, tick) in [("Leguin", LEGUIN_MOVES), ("Butler", 9), ("Butler", 230)] {
        let run = format!("for-{robot}-{tick}");
        let at_s = tick as f64 / 2.0;
        let fault =
            format!("fault=[{{robot=\"{robot}\",do=\"crash\",at=\"{at_s} s\",for=\"0.1 s\"}}]");
        let args = [
            "launch",
            FILE,
            "--speed",
            "max",
            "--duration",
            "120 s",
            "--set",
            &fault,
        ];
        let mut launch = lab.start(&run, &args);
        let back = joined_in(&mut launch, &lab, &run, robot);
        assert_eq!(back, [tick]);
        assert_again(&lab, &run, [tick, tick + 1]);
    }
}

#[test]
fn a_robot_that_is_killed_by_hand_or_from_outside_is_executed_again() {
    let lab = Lab::new();
    let run = "by-hand";
    let mut launch = lab.paused(run, FILE, &["--no-console", "--duration", "120 s"]);
    lab.step(run, LEGUIN_MOVES);
    eventually("the launcher", || {
        let crash = lab.cars(&["ctl", "crash", "Leguin", "--run", run]).output();
        crash.unwrap().status.success().then_some(())
    });
    lab.ctl(run, &["start"]);
    let is_held = || {
        let status = lab.ctl(run, &["status"]);
        let awaited = status["awaiting"].as_array().unwrap().clone();
        (!awaited.is_empty()).then_some(())
    };
    eventually("the clock to be held", is_held);
    lab.ctl(run, &["recover", "Leguin"]);
    let back = joined_in(&mut launch, &lab, run, "Leguin");
    assert_eq!(back, [LEGUIN_MOVES + 1]);
    assert_again(&lab, run, [back[0], back[0] + 1]);

    let run = "from-outside";
    let scenario = root().join("configs/hors_doeuvres.toml");
    let mut file = format!("scenario = {:?}\n", scenario.display().to_string());
    for name in ["Butler", "Leguin"] {
        let program = name.to_lowercase();
        file += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars-{program}\"]\nrestart = \"on-failure\"\nbackoff = \"0.1 s\"\n"
        );
    }
    let file = lab.write("restarting.toml", &file);
    let args = ["--no-console", "--duration", "120 s"];
    let mut launch = lab.paused(run, file.to_str().unwrap(), &args);
    lab.step(run, LEGUIN_MOVES);
    send(launch.process("cars-leguin"), Signal::SIGKILL);
    lab.ctl(run, &["start"]);
    let back = joined_in(&mut launch, &lab, run, "Leguin");
    assert_again(&lab, run, [back[0], back[0] + 1]);
}

/// Waits until an epoch has begun and waits for `start`.
fn until_epoch(lab: &Lab, run: &str, epoch: u64) {
    within(Duration::from_secs(60), "the next epoch", || {
        let status = lab.ctl(run, &["status"]);
        (status["epoch"] == epoch && status["phase"] == "ready").then_some(())
    });
}

#[test]
fn init_ends_the_faults_of_processes_and_begins_as_a_fresh_start_does() {
    let lab = Lab::new();
    for kind in ["crash", "hang"] {
        let run = format!("init-{kind}");
        let fault = format!("fault=[{{robot=\"Leguin\",do=\"{kind}\",at=\"5 s\"}}]");
        let set = [
            "--set",
            "on_late=continue",
            "--set",
            "deadline=60 s",
            "--set",
            &fault,
        ];
        let args = [&["--no-console", "--duration", "20 s"][..], &set].concat();
        let mut launch = lab.paused(&run, FILE, &args);
        lab.step(&run, 20);
        lab.ctl(&run, &["init"]);
        until_epoch(&lab, &run, 2);
        lab.ctl(&run, &["start"]);
        launch.finish();
        nobody_is_left(&run);

        let fresh = format!("fresh-{kind}");
        let args = ["run", FILE, "--duration", "20 s", "--run", &fresh];
        lab.ok(&[&args[..], &set].concat());
        assert_same(
            ("after init", &lab.bytes(&run)),
            ("fresh", &lab.bytes(&fresh)),
        );
    }
}

#[test]
fn init_is_not_held_by_a_crash_for_which_the_clock_waits() {
    let lab = Lab::new();
    let crash = |for_s: &str| {
        format!("fault=[{{robot=\"Leguin\",do=\"crash\",at=\"5 s\",for=\"{for_s} s\"}}]")
    };
    let run = "init-held";
    let args = [
        "--no-console",
        "--duration",
        "20 s",
        "--set",
        &crash("3600"),
    ];
    let mut launch = lab.paused(run, FILE, &args);
    for epoch in 2..4 {
        lab.ctl(run, &["start"]);
        eventually("the clock to be held", || {
            let status = lab.ctl(run, &["status"]);
            (status["tick"] == 9 && status["awaiting"][0]["name"] == "Leguin").then_some(())
        });
        lab.ctl(run, &["init"]);
        until_epoch(&lab, run, epoch);
    }
    lab.ctl(run, &["start"]);
    eventually("the fault to be ended by hand", || {
        let recover = lab
            .cars(&["ctl", "recover", "Leguin", "--run", run])
            .output();
        (recover.unwrap().status.success() && joined_lately(&lab, run)).then_some(())
    });
    launch.finish();

    let fresh = "init-not-held";
    let args = [
        "launch",
        FILE,
        "--speed",
        "max",
        "--duration",
        "20 s",
        "--set",
        &crash("0.1"),
    ];
    lab.start(fresh, &args).finish();
    assert_same(
        ("after init", &lab.bytes(run)),
        ("fresh", &lab.bytes(fresh)),
    );
}

/// Whether the run has gone on after tick 9.
fn joined_lately(lab: &Lab, run: &str) -> bool {
    let events = lab.events(run);
    events.iter().any(|event| event["tick"].as_u64() > Some(10))
}

#[test]
fn what_is_set_by_hand_does_not_reach_into_the_next_epoch() {
    let lab = Lab::new();
    let run = "init-by-hand";
    let set = ["--set", "on_late=continue", "--set", "deadline=60 s"];
    let args = [&["--no-console", "--duration", "20 s"][..], &set].concat();
    let mut launch = lab.paused(run, FILE, &args);
    lab.step(run, 5);
    for (kind, robot) in [("crash", "Butler"), ("hang", "Leguin")] {
        eventually("the launcher", || {
            let fault = lab.cars(&["ctl", kind, robot, "--run", run]).output();
            fault.unwrap().status.success().then_some(())
        });
    }
    lab.step(run, 5);
    lab.ctl(run, &["init"]);
    until_epoch(&lab, run, 2);
    lab.ctl(run, &["start"]);
    launch.finish();
    nobody_is_left(run);

    lab.ok(&[
        &["run", FILE, "--duration", "20 s", "--run", "by-hand-fresh"],
        &set[..],
    ]
    .concat());
    assert_same(
        ("after init", &lab.bytes(run)),
        ("fresh", &lab.bytes("by-hand-fresh")),
    );
}

/// A request of a launcher.
fn control(lab: &Lab, run: &str, control: &Control) -> ControlAnswer {
    let endpoint = std::fs::read_to_string(lab.file(run, "endpoint")).unwrap();
    let role = Role::Client {
        connect: endpoint.trim().to_owned(),
        patience: PATIENCE,
    };
    let bus = Bus::open(&role, None).unwrap();
    let key = Keys::new(&RunName::new(run).unwrap()).control();
    let reply = bus.get(&key, "", Some(encode(control))).unwrap();
    let answer = reply.expect("the simulator answers").result.unwrap();
    bus.close();
    decode(&key, "the simulator", &answer).unwrap()
}

fn ended(robot: &str) -> Control {
    Control::ProcessEnded {
        robots: vec![RobotName::new(robot).unwrap()],
        because: "exited with status 0".to_owned(),
    }
}

#[test]
fn a_run_does_not_wait_for_a_robot_that_has_ended_for_good() {
    let lab = Lab::new();
    let scenario = root().join("configs/hors_doeuvres.toml");
    let mut file = format!("scenario = {:?}\n", scenario.display().to_string());
    for name in ["Butler", "Leguin"] {
        let program = name.to_lowercase();
        file += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars-{program}\"]\nrequired = false\n"
        );
    }
    let file = lab.write("not-required.toml", &file);
    let run = "ended";
    let mut launch = lab.paused(run, file.to_str().unwrap(), &["--no-console"]);
    lab.step(run, 5);
    assert!(matches!(
        control(&lab, run, &ended("Nobody")),
        ControlAnswer::Refused { .. }
    ));
    // As long as a process is connected, the word of the launcher changes nothing.
    assert!(matches!(
        control(&lab, run, &ended("Leguin")),
        ControlAnswer::Done(_)
    ));
    assert_eq!(lab.step(run, 5), 10);

    send(launch.process("cars-leguin"), Signal::SIGKILL);
    lab.ctl(run, &["start"]);
    let status = launch.wait();
    assert!(!status.success(), "{}", launch.printed());
    let end: Value = lab.events(run).pop().unwrap();
    assert_eq!(end["reason"], "aborted");
    let robot = &end["waited_for"][0];
    assert_eq!(robot["robot"], "Leguin", "{end}");
    assert!(robot["because"]["ended"].is_string(), "{end}");
    assert_eq!(lab.summary(run)["waited_for"], end["waited_for"]);
    assert!(
        launch.printed().contains("because Leguin"),
        "{}",
        launch.printed()
    );
    lab.ok(&["verify", run]);
    nobody_is_left(run);
}

#[test]
fn an_aborted_run_names_whom_it_waited_for_however_short_the_deadline() {
    let lab = Lab::new();
    let run = "short-deadline";
    let set = [
        "--no-console",
        "--set",
        "on_late=abort",
        "--set",
        "deadline=60 s",
    ];
    let mut launch = lab.paused(run, FILE, &set);
    lab.step(run, 3);
    send(launch.process("cars-leguin"), Signal::SIGSTOP);
    lab.ctl(run, &["late", "--deadline", "0.2 s"]);
    lab.ctl(run, &["start"]);
    let status = launch.wait();
    assert!(!status.success());
    let end: Value = lab.events(run).pop().unwrap();
    assert_eq!(end["reason"], "aborted");
    assert_eq!(
        end["waited_for"],
        json!([{ "robot": "Leguin", "because": "silent" }])
    );
    assert_eq!(lab.summary(run)["waited_for"], end["waited_for"]);
    assert!(
        launch.printed().contains("because Leguin"),
        "{}",
        launch.printed()
    );
    lab.ok(&["verify", run]);
}
