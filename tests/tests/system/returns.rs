//! Processes that die or stop and come back in a launch, in every way: the record is executed again and forked, and the next
//! epoch is that of a fresh start.

use std::time::Duration;

use bus::{Bus, Role};
use nix::sys::signal::Signal;
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::random::{stream, unit};
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
#[ignore = "thorough: with `-- --include-ignored`"]
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

/// A launch of Butler and Leguin whose processes are restarted.
fn restarting(lab: &Lab) -> String {
    let scenario = root().join("configs/hors_doeuvres.toml");
    let mut file = format!("scenario = {:?}\n", scenario.display().to_string());
    for name in ["Butler", "Leguin"] {
        let program = name.to_lowercase();
        file += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars-{program}\"]\nrestart = \"on-failure\"\nbackoff = \"0.1 s\"\n"
        );
    }
    let file = lab.write("restarting.toml", &file);
    file.to_str().unwrap().to_owned()
}

/// Something that happens to the process of a robot before a tick, and how it comes back.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// A fault of the scenario, under a rule for late robots; its end is added to the time at which it begins.
    Scenario(&'static str, &'static str, End),
    /// By hand, and back by hand while the clock waits.
    ByHand(&'static str),
    /// Killed from outside, and restarted by the launcher.
    Outside,
}

#[derive(Debug, Clone, Copy)]
enum End {
    None,
    For,
    After(u64),
}

const WAYS: [Way; 8] = [
    Way::Scenario("crash", "wait", End::For),
    Way::Scenario("hang", "wait", End::For),
    Way::Scenario("restart", "wait", End::None),
    Way::Scenario("crash", "continue", End::After(4)),
    Way::Scenario("hang", "continue", End::After(4)),
    Way::ByHand("crash"),
    Way::ByHand("hang"),
    Way::Outside,
];

/// Plays a launch in which that happens, to its end.
fn play(lab: &Lab, run: &str, robot: &str, tick: u64, way: Way) {
    let seconds = |tick: u64| format!("{} s", tick as f64 / 2.0);
    let mut set = vec!["deadline=60 s".to_owned()];
    if let Way::Scenario(kind, on_late, end) = way {
        let end = match end {
            End::None => String::new(),
            End::For => ",for=\"0.1 s\"".to_owned(),
            End::After(ticks) => format!(",until=\"{}\"", seconds(tick + ticks)),
        };
        let at = seconds(tick);
        set.push(format!("on_late={on_late}"));
        set.push(format!(
            "fault=[{{robot=\"{robot}\",do=\"{kind}\",at=\"{at}\"{end}}}]"
        ));
    }
    let file = restarting(lab);
    let mut args = vec!["--no-console", "--duration", "120 s"];
    for set in &set {
        args.extend(["--set", set]);
    }
    let mut launch = lab.paused(run, &file, &args);
    if !matches!(way, Way::Scenario(..)) && tick > 1 {
        lab.step(run, tick - 1);
    }

    if let Way::ByHand(kind) = way {
        eventually("the launcher", || {
            let fault = lab.cars(&["ctl", kind, robot, "--run", run]).output();
            fault.unwrap().status.success().then_some(())
        });
    } else if let Way::Outside = way {
        let program = format!("cars-{}", robot.to_lowercase());
        send(launch.process(&program), Signal::SIGKILL);
    }
    lab.ctl(run, &["start"]);
    if matches!(way, Way::ByHand(_)) {
        eventually("the clock to be held", || {
            let status = lab.ctl(run, &["status"]);
            let awaited = status["awaiting"].as_array().unwrap();
            (!awaited.is_empty()).then_some(())
        });
        lab.ctl(run, &["recover", robot]);
    }
    launch.finish();
    nobody_is_left(run);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_that_is_killed_by_hand_or_from_outside_is_executed_again() {
    let lab = Lab::new();
    for (run, way) in [("by-hand", Way::ByHand("crash")), ("outside", Way::Outside)] {
        play(&lab, run, "Leguin", LEGUIN_MOVES, way);
        let back = joined(&lab, run, "Leguin");
        assert_eq!(back.len(), 1, "{run}: {back:?}");
        assert_again(&lab, run, [back[0] - 1, back[0], back[0] + 1]);
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`; CARS_RETURNS=100 for more of them"]
fn whatever_happens_to_a_process_is_executed_again() {
    let count = std::env::var("CARS_RETURNS").map_or(16, |count| count.parse().unwrap());
    let mut random = stream(7, "returns");
    for index in 0..count {
        let way = WAYS[index % WAYS.len()];
        let robot = ["Butler", "Leguin"][index / WAYS.len() % 2];
        let tick = 1 + (unit(&mut random) * 230.0) as u64;
        let what = format!("{way:?} of {robot} before tick {tick}");
        println!("{what}");

        let lab = Lab::new();
        play(&lab, "drawn", robot, tick, way);
        let back = joined(&lab, "drawn", robot);
        let around = back.first().copied().unwrap_or(tick);
        let is_stopped = matches!(way, Way::Scenario("hang", "wait", _) | Way::ByHand("hang"));
        assert_eq!(back.is_empty(), is_stopped, "{what}: {back:?}");
        assert_again(&lab, "drawn", [around - 1, around, around + 1]);
    }
}

/// Waits until an epoch has begun and waits for `start`.
fn until_epoch(lab: &Lab, run: &str, epoch: u64) {
    within(Duration::from_secs(60), "the next epoch", || {
        let status = lab.ctl(run, &["status"]);
        (status["epoch"] == epoch && status["phase"] == "ready").then_some(())
    });
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
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
    let until_held = || {
        lab.ctl(run, &["start"]);
        eventually("the clock to be held", || {
            let status = lab.ctl(run, &["status"]);
            (status["tick"] == 9 && status["awaiting"][0]["name"] == "Leguin").then_some(())
        });
    };
    for epoch in 2..4 {
        until_held();
        lab.ctl(run, &["init"]);
        until_epoch(&lab, run, epoch);
    }
    until_held();
    lab.ctl(run, &["recover", "Leguin"]);
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
    let mut waited_for = end["waited_for"].as_array().unwrap().iter();
    let leguin = waited_for.find(|one| one["robot"] == "Leguin").unwrap();
    assert!(leguin["because"]["ended"].is_string(), "{end}");
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
