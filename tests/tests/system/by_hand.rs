//! Experiments by hand on real launches: what is done takes effect, is in the record, and is done again where the run is executed
//! again.

use std::process::{Command, Stdio};

use nix::sys::signal::Signal;
use serde_json::Value;
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::{Lab, assert_same, eventually, programs, root};

const FILE: &str = "launch/hors_doeuvres.toml";

/// A launch that has gathered its robots and waits for `start`.
fn paused(lab: &Lab, run: &str, more: &[&str]) -> Running {
    let mut args = vec!["--no-console", "--duration", "60 s"];
    args.extend(more);
    let launch = lab.paused(run, FILE, &args);
    // The launcher joins as an observer when the simulator answers.
    eventually("the launcher", || {
        let restarted = lab.cars(&["ctl", "restart", "Leguin", "--run", run]);
        let output = { restarted }.output().unwrap();
        output.status.success().then_some(())
    });
    launch
}

/// The events of one kind, with their ticks and one of their fields.
fn of_kind(lab: &Lab, run: &str, kind: &str, field: &str) -> Vec<(u64, String)> {
    let mut found = Vec::new();
    for event in lab.events(run) {
        if event["event"] == kind {
            let text = event[field].to_string().replace('"', "");
            found.push((event["tick"].as_u64().unwrap(), text));
        }
    }
    found
}

/// Waits until the clock waits for Leguin; returns the status then.
fn held_by_leguin(lab: &Lab, run: &str) -> Value {
    eventually("the clock to be held", || {
        let status = lab.ctl(run, &["status"]);
        let awaited = status["awaiting"].as_array().unwrap();
        awaited
            .iter()
            .any(|awaited| awaited["name"] == "Leguin")
            .then_some(status)
    })
}

/// Steps on until the clock waits for Leguin, who is to be killed or stopped: before that, Leguin may do some of these ticks, or all.
/// Returns the last tick that was asked for.
fn step_until_held(lab: &Lab, launch: &Running, run: &str) -> u64 {
    let mut last = lab.settled(run) + 5;
    lab.ctl(run, &["step", "5"]);
    launch.until_down("cars-leguin");
    let is_held = eventually("the clock to wait", || {
        let status = lab.ctl(run, &["status"]);
        let is_held = !status["awaiting"].as_array().unwrap().is_empty();
        (is_held || status["tick"] == last).then_some(is_held)
    });

    if !is_held {
        lab.ctl(run, &["step", "5"]);
        last += 5;
    }
    held_by_leguin(lab, run);
    last
}

fn verified(lab: &Lab, run: &str) {
    let said = lab.ok(&["verify", run]);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
}

/// The run as if a scenario had said everything.
fn as_scripted(bytes: &[u8]) -> Vec<Value> {
    let text = String::from_utf8(bytes.to_vec()).unwrap();
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut line: Value = serde_json::from_str(line).unwrap();
        let fields = line.as_object_mut().unwrap();
        fields.remove("seal");
        fields.remove("by_hand");
        lines.push(line);
    }
    lines
}

#[test]
fn links_robots_and_parameters_are_changed_by_hand_and_the_record_gives_the_same_run() {
    let lab = Lab::new();
    let run = "by-hand-all";
    let mut launch = paused(
        &lab,
        run,
        &["--set", "on_late=continue", "--set", "deadline=60 s"],
    );
    let do_and_step = |requests: &[&[&str]], ticks: u64| {
        for request in requests {
            lab.ctl(run, request);
        }
        lab.step(run, ticks)
    };
    assert_eq!(do_and_step(&[], 5), 5);
    do_and_step(&[&["cut", "Butler", "Leguin"]], 5); // From tick 6 on.
    do_and_step(&[&["heal", "Leguin", "Butler", "--one-way"]], 5); // 11
    do_and_step(&[&["heal"], &["lose", "Butler", "Leguin"]], 5); // 16
    do_and_step(&[&["hang", "Leguin"]], 5); // 21
    do_and_step(&[&["recover", "Leguin"]], 5); // 26
    do_and_step(&[&["crash", "Butler"]], 5); // 31
    do_and_step(&[&["recover", "Butler"]], 5); // 36
    do_and_step(&[&["set", "robot.Butler.params.policy=rules"]], 5); // 41
    do_and_step(&[&["late", "wait", "--robot", "Leguin"]], 5); // 46
    let told = lab.ok(&["ctl", "scenario", "--run", run]);
    lab.ctl(run, &["start"]);
    launch.finish();
    nobody_is_left(run);

    let cut = of_kind(&lab, run, "link_cut", "from");
    assert_eq!(cut, [(6, "Butler".to_owned()), (6, "Leguin".to_owned())]);
    let healed = of_kind(&lab, run, "link_healed", "from");
    assert_eq!(
        healed,
        [(11, "Leguin".to_owned()), (16, "Butler".to_owned())]
    );
    let faults = of_kind(&lab, run, "fault", "robot");
    let begun: Vec<u64> = faults.iter().map(|(tick, _)| *tick).collect();
    assert_eq!(begun, [1, 1, 21, 26, 31, 36], "{faults:?}");
    let missed = of_kind(&lab, run, "missed", "robot");
    let missed: Vec<u64> = missed.into_iter().map(|(tick, _)| tick).collect();
    let expected: Vec<u64> = (21..26).chain(31..36).collect();
    assert_eq!(missed, expected);
    // Liveness: both take part to the end, and both came back as further incarnations.
    let joined = of_kind(&lab, run, "joined", "generation");
    assert!(joined.contains(&(26, "3".to_owned())), "{joined:?}");
    assert!(joined.contains(&(41, "3".to_owned())), "{joined:?}");
    let changed = of_kind(&lab, run, "changed", "by_hand");
    assert!(changed.iter().all(|(_, by_hand)| by_hand == "true"));
    assert!(changed.iter().any(|(tick, _)| *tick == 46), "{changed:?}");
    verified(&lab, run);

    // The same run, told as a scenario, in one process.
    let scenario = lab.write("told.toml", &told);
    let told = "by-hand-told";
    lab.ok(&["run", scenario.to_str().unwrap(), "--run", told]);
    let [by_hand, scripted] = [run, told].map(|run| as_scripted(&lab.bytes(run)));
    assert_eq!(by_hand.len(), scripted.len());
    for (one, other) in by_hand.iter().zip(&scripted) {
        assert_eq!(one, other);
    }
    let (_, refused) = lab.fails(&["verify", run, "--processes"]);
    assert!(refused.contains("changes by hand"), "{refused}");
}

#[test]
fn what_was_done_by_hand_is_done_again_when_a_killed_run_is_resumed() {
    let lab = Lab::new();
    let run = "by-hand-killed";
    let mut launch = paused(
        &lab,
        run,
        &["--set", "on_late=continue", "--set", "deadline=60 s"],
    );
    lab.step(run, 5);
    lab.ctl(run, &["cut", "Butler", "Leguin", "--one-way"]);
    lab.ctl(run, &["hang", "Leguin"]);
    lab.step(run, 5);
    lab.ctl(run, &["recover", "Leguin"]);
    lab.step(run, 20);
    send(launch.process("cars-sim"), Signal::SIGKILL);
    assert!(!launch.wait().success());
    nobody_is_left(run);
    let killed_at = lab.bytes(run);

    let resume = ["launch", "--no-console", "--resume", run, "--speed", "max"];
    lab.ok(&resume);
    let whole = lab.bytes(run);
    assert!(whole.len() > killed_at.len());
    assert_same(
        ("resumed", &whole[..killed_at.len()]),
        ("killed", &killed_at),
    );
    verified(&lab, run);
}

#[test]
fn a_clock_that_waits_for_a_robot_is_freed_by_hand_and_nothing_changes() {
    let lab = Lab::new();
    let run = "by-hand-waits";
    let mut launch = paused(&lab, run, &[]);
    lab.step(run, 5);
    lab.ctl(run, &["hang", "Leguin"]);
    lab.ctl(run, &["start"]);
    let held = held_by_leguin(&lab, run);
    // A process that is told to stop may do another tick before it does.
    let held_after = held["tick"].as_u64().unwrap();
    assert!((5..20).contains(&held_after), "{held}");
    lab.ctl(run, &["recover", "Leguin"]);
    launch.finish();
    let faults = of_kind(&lab, run, "fault", "robot");
    assert_eq!(faults.last().unwrap(), &(6, "Leguin".to_owned()));
    assert!(of_kind(&lab, run, "missed", "robot").is_empty());
    verified(&lab, run);
}

#[test]
fn going_on_without_a_late_robot_is_an_event_and_is_executed_again() {
    let lab = Lab::new();
    let run = "by-hand-late";
    let mut launch = paused(&lab, run, &[]);
    lab.step(run, 5);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    // Stepped, so that the run is there to be asked until it is told to go to its end.
    lab.ctl(run, &["step", "20"]);
    held_by_leguin(&lab, run);
    lab.ctl(run, &["late", "continue", "--robot", "Leguin"]);
    assert_eq!(lab.settled(run), 25);
    send(leguin, Signal::SIGCONT);
    lab.ctl(run, &["start"]);
    launch.finish();
    let changed = of_kind(&lab, run, "changed", "set");
    let (_, last) = changed.last().unwrap();
    assert!(last.contains("robot.Leguin.on_late="), "{changed:?}");
    verified(&lab, run);
}

/// Also one that the clock waited for until a person did not want to: it goes on at once, and not after a deadline.
#[test]
fn a_robot_without_which_the_clock_went_on_is_let_go_on_by_hand() {
    for (kind, done) in [("crash", "is killed"), ("hang", "is stopped")] {
        let lab = Lab::new();
        let run = format!("by-hand-without-{kind}");
        let run = run.as_str();
        let mut launch = paused(&lab, run, &["--set", "deadline=60 s"]);
        lab.step(run, 5);
        lab.ctl(run, &[kind, "Leguin"]);
        let last = step_until_held(&lab, &launch, run);
        lab.ctl(run, &["late", "continue", "--robot", "Leguin"]);
        assert_eq!(lab.settled(run), last, "{kind}");
        let (_, again) = lab.fails(&["ctl", "crash", "Leguin", "--run", run]);
        assert!(again.contains(&format!("{done} already")), "{again}");

        lab.ctl(run, &["recover", "Leguin"]);
        lab.step(run, 1);
        let (_, again) = lab.fails(&["ctl", "recover", "Leguin", "--run", run]);
        assert!(again.contains("no fault holds Leguin"), "{again}");
        lab.ctl(run, &["start"]);
        launch.finish();
        nobody_is_left(run);

        let begins = of_kind(&lab, run, "fault", "begins");
        assert_eq!(begins.last().unwrap(), &(last + 1, "false".to_owned()));
        let missed = of_kind(&lab, run, "missed", "robot");
        assert!(
            missed.last().is_some_and(|(tick, _)| *tick == last),
            "{missed:?}"
        );
        let joined = of_kind(&lab, run, "joined", "generation");
        assert!(joined.contains(&(last + 1, "3".to_owned())), "{joined:?}");
        verified(&lab, run);
    }
}

/// The fault lasts an hour of wall clock if nobody ends it. It was ended between two ticks, while the clock waited for the robot, or
/// not before the run was killed.
fn is_resumed_after_faults(faults: &[(&str, &str)]) {
    for (kind, ended) in faults {
        let (kind, ended) = (*kind, *ended);
        let lab = Lab::new();
        let run = format!("by-hand-resumed-{kind}-{ended}");
        let run = run.as_str();
        let mut launch = paused(&lab, run, &["--set", "deadline=60 s"]);
        lab.step(run, 5);
        lab.ctl(run, &[kind, "Leguin"]);
        let last = step_until_held(&lab, &launch, run);
        if ended != "waiting" {
            lab.ctl(run, &["late", "continue", "--robot", "Leguin"]);
            assert_eq!(lab.settled(run), last);
        }
        if ended != "never" {
            lab.ctl(run, &["recover", "Leguin"]);
        }
        assert_eq!(lab.settled(run), last);
        lab.step(run, 20);
        send(launch.process("cars-sim"), Signal::SIGKILL);
        assert!(!launch.wait().success());
        nobody_is_left(run);

        let resume = ["launch", "--no-console", "--resume", run, "--speed", "max"];
        lab.ok(&resume);
        let log = std::fs::read_to_string(lab.out().join(run).join("logs/simulator.log")).unwrap();
        assert!(log.contains("the clock is held"), "{log}");
        assert!(!log.contains("in time"), "{log}");
        let missed = of_kind(&lab, run, "missed", "robot");
        let is_here = |tick: u64| !missed.iter().any(|(missed, _)| *missed == tick);
        assert_eq!(is_here(last + 1), ended != "never", "{ended}: {missed:?}");
        assert_eq!(is_here(120), ended != "never", "{ended}: {missed:?}");
        verified(&lab, run);
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_killed_run_is_resumed_without_waiting_for_a_fault_by_hand() {
    is_resumed_after_faults(&[("crash", "never"), ("hang", "waiting")]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_killed_run_is_resumed_whatever_the_fault_and_whenever_it_was_ended() {
    is_resumed_after_faults(&[
        ("crash", "between"),
        ("crash", "waiting"),
        ("hang", "between"),
        ("hang", "never"),
    ]);
}

#[test]
fn what_cannot_be_done_by_hand_is_refused_with_the_reason() {
    let lab = Lab::new();
    let run = "by-hand-refused";
    let mut launch = paused(&lab, run, &[]);
    for (request, reason) in [
        (&["cut", "Butler", "Zoe"][..], "called Zoe"),
        (&["heal", "Butler"], "no link between these robots is cut"),
        (
            &["heal", "Butler", "Leguin"],
            "no link between these robots is cut",
        ),
        (&["hang", "Leguin", "--for", "2 h"], "at most an hour"),
        (&["recover", "Leguin"], "no fault holds Leguin"),
        (&["set", "guests.count=5"], "can change while a run goes on"),
        (&["set", "robot.Zoe.params.x=1"], "Zoe"),
    ] {
        let (code, said) = lab.fails(&[&["ctl"], request, &["--run", run]].concat());
        assert!(code == 1 && said.contains(reason), "{request:?}: {said}");
    }
    lab.ctl(run, &["start"]);
    launch.finish();
    assert_eq!(of_kind(&lab, run, "changed", "set").len(), 1);

    // No launcher could stop the processes of these.
    let alone = "by-hand-alone";
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", free.local_addr().unwrap());
    drop(free);
    let start = |program: &str, args: &[&str]| {
        let mut command = Command::new(programs().join(program));
        command
            .current_dir(root())
            .args(args)
            .args(["--run", alone]);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command.spawn().unwrap()
    };
    let out = lab.out().display().to_string();
    let scenario = "configs/hors_doeuvres.toml";
    let args = [scenario, "--paused", "--listen", &endpoint, "--out", &out];
    let mut simulator = start("cars-sim", &args);
    let robots = ["cars-butler", "cars-leguin"];
    let robots = robots.map(|robot| start(robot, &["--connect", &endpoint]));
    lab.until_ready(alone);
    let (_, said) = lab.fails(&["ctl", "crash", "Leguin", "--run", alone]);
    assert!(said.contains("no launcher is connected"), "{said}");
    lab.ctl(alone, &["stop"]);
    simulator.wait().unwrap();
    for mut robot in robots {
        robot.wait().unwrap();
    }
}
