//! The CD-player buttons on a real launch.

use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use serde_json::Value;
use system_tests::processes::{Running, send};
use system_tests::{Lab, assert_same, assert_stepped, eventually};

const FILE: &str = "launch/hors_doeuvres.toml";

fn status(lab: &Lab, run: &str) -> Value {
    serde_json::from_str(&lab.ok(&["ctl", "status", "--json", "--run", run])).unwrap()
}

/// A launch that has gathered its robots and waits for `start`.
fn paused(lab: &Lab, run: &str, more: &[&str]) -> Running {
    lab.paused(run, FILE, more)
}

#[test]
fn step_answers_with_the_tick_reached_and_the_buttons_do_what_they_say() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-buttons", &["--duration", "60 s"]);
    assert_eq!(status(&lab, "ctl-buttons")["tick"], 0);
    assert_eq!(lab.step("ctl-buttons", 10), 10);
    assert_stepped(&lab.ctl("ctl-buttons", &["step"]), 11);
    assert_eq!(lab.settled("ctl-buttons"), 11);
    assert_eq!(lab.ctl("ctl-buttons", &["speed", "2"])["speed"], 2.0);
    assert_eq!(lab.ctl("ctl-buttons", &["start"])["phase"], "running");

    let (code, text) = lab.fails(&["ctl", "step", "--run", "ctl-buttons"]);
    assert!(code == 1 && text.contains("pause it to step"), "{text}");
    assert_eq!(lab.ctl("ctl-buttons", &["pause"])["phase"], "paused");

    lab.step("ctl-buttons", 3);

    lab.ctl("ctl-buttons", &["speed", "max"]);
    lab.ctl("ctl-buttons", &["start"]);
    launch.finish();
    assert_eq!(lab.summary("ctl-buttons")["ticks"], 120);
}

#[test]
fn pausing_and_stepping_change_nothing_in_the_record() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-paused", &["--duration", "60 s"]);
    lab.step("ctl-paused", 33);
    lab.ctl("ctl-paused", &["start"]);
    launch.finish();
    lab.ok(&["run", FILE, "--run", "ctl-straight", "--duration", "60 s"]);
    assert_same(
        ("paused", &lab.bytes("ctl-paused")),
        ("straight", &lab.bytes("ctl-straight")),
    );
}

#[test]
fn init_gives_the_digests_of_a_fresh_start_with_the_same_processes() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-init", &["--duration", "60 s"]);
    lab.step("ctl-init", 50);
    let before = launch.processes();
    let reply = lab.ctl("ctl-init", &["init"]);
    assert_eq!((&reply["tick"], &reply["epoch"]), (&0.into(), &2.into()));
    let again = eventually("the new epoch", || {
        let status = status(&lab, "ctl-init");
        (status["phase"] == "ready" && status["epoch"] == 2).then_some(status)
    });
    assert_eq!(again["tick"], 0);
    assert_eq!(launch.processes(), before);

    lab.ctl("ctl-init", &["start"]);
    launch.finish();
    lab.ok(&["run", FILE, "--run", "ctl-fresh", "--duration", "60 s"]);
    assert_same(
        ("after init", &lab.bytes("ctl-init")),
        ("fresh", &lab.bytes("ctl-fresh")),
    );

    // Nothing is lost: what the first epoch recorded is kept, too, up to where it was left.
    let kept = std::fs::read(lab.file("ctl-init", "events-epoch1.jsonl")).unwrap();
    assert!(
        lab.bytes("ctl-fresh").starts_with(&kept),
        "the first epoch went the same way"
    );
    assert!(String::from_utf8(kept).unwrap().lines().count() > 50);
}

#[test]
fn init_with_another_seed_is_another_run() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-seed", &["--duration", "30 s"]);
    lab.ctl("ctl-seed", &["init", "--seed", "77"]);
    eventually("the new epoch", || {
        (status(&lab, "ctl-seed")["phase"] == "ready").then_some(())
    });
    lab.ctl("ctl-seed", &["start"]);
    launch.finish();
    lab.ok(&[
        "run",
        FILE,
        "--run",
        "ctl-77",
        "--duration",
        "30 s",
        "--seed",
        "77",
    ]);

    assert_same(
        ("after init", &lab.bytes("ctl-seed")),
        ("fresh", &lab.bytes("ctl-77")),
    );
}

#[test]
fn control_answers_at_once_while_the_clock_is_held() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-held", &["--duration", "60 s"]);
    lab.step("ctl-held", 5);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);

    // Less than the time after which an asker gives up.
    let begun = Instant::now();
    let stepped = lab.ctl("ctl-held", &["step", "10"]);
    assert!(
        begun.elapsed() < Duration::from_secs(10),
        "step took {:?}",
        begun.elapsed()
    );
    assert!(stepped["tick"].as_u64().unwrap() < 15, "{stepped}");

    let awaited: Vec<&str> = stepped["awaiting"]
        .as_array()
        .unwrap()
        .iter()
        .map(|awaited| awaited["name"].as_str().unwrap())
        .collect();

    assert!(awaited.contains(&"Leguin"), "{stepped}");
    assert_eq!(lab.ctl("ctl-held", &["pause"])["phase"], "paused");
    assert_eq!(status(&lab, "ctl-held")["phase"], "paused");

    send(leguin, Signal::SIGCONT);
    lab.ctl("ctl-held", &["start"]);
    launch.finish();
    lab.ok(&["run", FILE, "--run", "ctl-not-held", "--duration", "60 s"]);
    assert_same(
        ("held", &lab.bytes("ctl-held")),
        ("not held", &lab.bytes("ctl-not-held")),
    );
}

#[test]
fn init_ends_a_tick_that_hangs() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-rescue", &["--duration", "30 s"]);
    lab.step("ctl-rescue", 5);
    let leguin = launch.process("cars-leguin");
    send(leguin, Signal::SIGSTOP);
    lab.ctl("ctl-rescue", &["step", "10"]);
    lab.ctl("ctl-rescue", &["init"]);
    send(leguin, Signal::SIGCONT);
    eventually("the new epoch", || {
        (status(&lab, "ctl-rescue")["phase"] == "ready").then_some(())
    });
    lab.ctl("ctl-rescue", &["start"]);
    launch.finish();
    lab.ok(&["run", FILE, "--run", "ctl-no-rescue", "--duration", "30 s"]);
    assert_same(
        ("rescued", &lab.bytes("ctl-rescue")),
        ("fresh", &lab.bytes("ctl-no-rescue")),
    );
}

#[test]
fn stop_ends_the_run_with_its_record_complete() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-stop", &[]);
    lab.step("ctl-stop", 20);
    let reply = lab.ctl("ctl-stop", &["stop"]);
    assert_eq!(reply["phase"], "ended");
    // Whoever has the answer may read the record.
    let events = lab.events("ctl-stop");
    launch.finish();
    assert_eq!(lab.events("ctl-stop"), events);
    let end = &events[events.len() - 1];
    let tick = events
        .iter()
        .rfind(|event| event["event"] == "tick")
        .unwrap();
    assert_eq!(
        (&end["event"], &end["reason"], &end["tick"]),
        (&"end".into(), &"stopped".into(), &20.into())
    );
    assert_eq!(end["digest"], tick["digest"]);
    assert_eq!(lab.summary("ctl-stop")["end"], "stopped");

    let (_, text) = lab.fails(&["ctl", "status", "--run", "ctl-stop"]);
    assert!(text.contains("not in progress"), "{text}");
}

#[test]
fn another_scenario_for_the_same_robots_is_loaded_without_a_new_start() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-load", &["--duration", "60 s"]);
    lab.step("ctl-load", 20);
    let processes = launch.processes();
    let scenario = lab.ok(&["ctl", "scenario", "--run", "ctl-load"]);
    assert!(scenario.contains("count = 100"), "{scenario}");

    let fewer = lab.write(
        "fewer.toml",
        &scenario
            .replace("count = 100", "count = 7")
            .replace("seed = 2002", "seed = 5"),
    );
    let fewer = fewer.to_str().unwrap();
    lab.ctl("ctl-load", &["load", fewer]);
    eventually("the new epoch", || {
        let status = status(&lab, "ctl-load");
        (status["phase"] == "ready" && status["epoch"] == 2 && status["seed"] == 5).then_some(())
    });
    assert_eq!(launch.processes(), processes);

    let (_, text) = lab.fails(&[
        "ctl",
        "load",
        "configs/three_robots.toml",
        "--run",
        "ctl-load",
    ]);

    assert!(text.contains("Vonda"), "{text}");

    lab.ctl("ctl-load", &["start"]);
    launch.finish();

    // What is kept of the second epoch is what a fresh run of its scenario gives, and the first epoch is kept, too.
    lab.ok(&["run", fewer, "--run", "ctl-loaded"]);
    assert_same(
        ("loaded", &lab.bytes("ctl-load")),
        ("fresh", &lab.bytes("ctl-loaded")),
    );

    let read = |run, name| std::fs::read(lab.file(run, name)).unwrap();
    assert_eq!(
        read("ctl-load", "scenario.toml"),
        read("ctl-loaded", "scenario.toml")
    );

    for kept in [
        "events-epoch1.jsonl",
        "scenario-epoch1.toml",
        "run-epoch1.mcap",
    ] {
        assert!(lab.file("ctl-load", kept).exists(), "{kept}");
    }
}

/// Ticks that wait for no robot follow one another at once, and the simulator receives what people want meanwhile.
#[test]
fn a_clock_that_waits_for_nobody_can_be_paused() {
    let lab = Lab::new();
    let faults = "fault=[{ robot = \"Butler\", do = \"hang\", at = \"5 s\" }, \
                  { robot = \"Leguin\", do = \"hang\", at = \"5 s\" }]";
    let args = [
        "--duration",
        "1000000 s",
        "--set",
        faults,
        "--set",
        "on_late=continue",
    ];
    let mut launch = paused(&lab, "ctl-nobody", &args);
    lab.ctl("ctl-nobody", &["start"]);
    eventually("ticks without robots", || {
        let tick = status(&lab, "ctl-nobody")["tick"].as_u64().unwrap();
        (tick > 1_000).then_some(())
    });

    assert_eq!(lab.ctl("ctl-nobody", &["pause"])["phase"], "paused");
    lab.ctl("ctl-nobody", &["stop"]);
    launch.wait();
}

#[test]
fn a_step_is_answered_although_others_ask_meanwhile() {
    let lab = Lab::new();
    let mut launch = paused(&lab, "ctl-asked", &["--duration", "10000 s"]);
    std::thread::scope(|scope| {
        let stepped = scope.spawn(|| lab.ctl("ctl-asked", &["step", "1000"]));
        eventually("the steps to be under way", || {
            let tick = status(&lab, "ctl-asked")["tick"].as_u64().unwrap();
            (tick > 0).then_some(())
        });

        assert_stepped(&stepped.join().unwrap(), 1_000);
    });
    assert_eq!(lab.settled("ctl-asked"), 1_000);

    lab.ctl("ctl-asked", &["stop"]);
    launch.wait();
}

/// What a launch needs does not depend on what it prints.
#[test]
fn orders_are_carried_out_whatever_a_launch_prints() {
    for (run, more) in [
        ("orders-quiet", &["--quiet", "--no-console"][..]),
        ("orders-silent-console", &["--quiet"]),
        ("orders-no-console", &["--no-console"]),
    ] {
        let lab = Lab::new();
        let mut args = vec!["--duration", "30 s"];
        args.extend(more);
        let mut launch = paused(&lab, run, &args);
        lab.step(run, 10);
        lab.ctl_of_launcher(run, &["restart", "Leguin"]);
        lab.step(run, 10);
        lab.ctl(run, &["hang", "Butler", "--for", "0.2 s"]);
        lab.ctl(run, &["start"]);
        launch.finish();

        lab.ok(&["verify", &lab.out().join(run).display().to_string()]);
    }
}

/// The launcher connects when the simulator listens, and a person may be faster.
#[test]
fn an_order_in_the_first_moments_of_a_launch_is_carried_out() {
    let lab = Lab::new();
    let run = "orders-first";
    let args = ["launch", FILE, "--quiet", "--no-console", "--paused"];
    let more = ["--speed", "max", "--duration", "30 s"];
    let mut launch = lab.start(run, &[&args[..], &more].concat());
    eventually("the simulator", || {
        let output = lab.cars(&["ctl", "restart", "Leguin", "--run", run]);
        let output = { output }.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!said.contains("no launcher"), "{said}");
        output.status.success().then_some(())
    });
    lab.until_ready(run);
    lab.ctl(run, &["start"]);
    launch.finish();

    let restarts = lab.events(run);
    let mut restarts = restarts.iter().filter(|event| event["event"] == "fault");
    assert!(restarts.all(|event| event["kind"] == "restart"));
    lab.ok(&["verify", run]);
}

/// A run with orders by hand is resumed in the same way.
#[test]
fn a_run_with_orders_is_resumed_without_a_word_and_without_a_console() {
    let lab = Lab::new();
    let run = "orders-resumed";
    let quiet = ["--duration", "30 s", "--quiet", "--no-console"];
    let mut launch = paused(&lab, run, &quiet);
    lab.step(run, 10);
    lab.ctl_of_launcher(run, &["restart", "Leguin"]);
    lab.step(run, 20);
    let simulator = launch.process("cars-sim");
    send(simulator, Signal::SIGKILL);
    assert!(!launch.wait().success());

    let resume = ["launch", "--quiet", "--no-console", "--resume", run];
    lab.ok(&[&resume[..], &["--speed", "max"]].concat());
    assert_eq!(lab.summary(run)["ticks"], 60);
    lab.ok(&["verify", &lab.out().join(run).display().to_string()]);
}
