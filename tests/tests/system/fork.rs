//! Runs that go on from a tick of another run, with changes; and changes while a run goes on.

use system_tests::processes::nobody_is_left;
use system_tests::{Lab, assert_same, eventually, root};

const HALL: &str = "launch/hors_doeuvres.toml";
const SCENARIO: &str = "configs/hors_doeuvres.toml";
const DUST: &str = "layer=[{ name = \"dust\", cell = \"2 ft\", decay = 0.1, diffuse = 0.05, \
                    peaks = [{ at = \"random\", radius = \"10 ft\", height = 15 }] }]";

/// The lines of a run's events up to and including the end of a tick.
fn up_to(lab: &Lab, run: &str, tick: u64) -> Vec<u8> {
    let events = String::from_utf8(lab.bytes(run)).unwrap();
    let end = format!("{{\"tick\":{tick},\"event\":\"tick\"");
    let begin = events.find(&end).expect("the tick is complete");
    let line = events[begin..].find('\n').expect("the line is complete");
    events.into_bytes()[..begin + line].to_vec()
}

fn events_of<'a>(events: &'a [serde_json::Value], kind: &str) -> Vec<&'a serde_json::Value> {
    let found = events.iter().filter(|event| event["event"] == kind);
    found.collect()
}

#[test]
fn a_fork_without_changes_is_the_run_also_after_faults_and_commands_by_hand() {
    let lab = Lab::new();
    let crash = r#"fault=[{ robot = "Leguin", do = "crash", at = "10 s", until = "16 s" }]"#;
    let mut args = vec!["launch", HALL, "--no-console", "--duration", "60 s"];
    args.extend(["--speed", "max", "--paused", "--set", "on_late=continue"]);
    args.extend(["--set", "network.commands.loss=0.2", "--set", crash]);
    // A layer that goes on changing by itself.
    args.extend(["--set", DUST]);
    let mut launch = lab.start("parent", &args);
    lab.until_ready("parent");
    lab.step("parent", 6);
    lab.ok(&["ctl", "command", "Leguin", "hurry", "--run", "parent"]);
    lab.step("parent", 40);
    lab.ok(&["ctl", "start", "--run", "parent"]);
    launch.finish();
    nobody_is_left("parent");

    // Before the command, while Leguin is gone, and after all of it.
    for tick in [7, 25, 46] {
        let run = format!("fork-{tick}");
        lab.ok(&["fork", &format!("parent@{tick}"), "--run", &run, "-q"]);
        assert_same(
            ("the run up to the tick", &up_to(&lab, "parent", tick)),
            ("the fork", &up_to(&lab, &run, tick)),
        );
        let said = lab.ok(&["verify", &run]);
        assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    }
    // Commands that were sent by hand after the tick are not sent again.
    assert_same(
        ("the run", &lab.bytes("parent")),
        ("the fork", &lab.bytes("fork-46")),
    );
    let commands = String::from_utf8(lab.bytes("fork-46")).unwrap();
    assert!(commands.contains("\"from\":\"operator\""));
}

#[test]
fn a_fork_differs_from_the_tick_of_its_changes_on() {
    let lab = Lab::new();
    lab.ok(&["run", SCENARIO, "--run", "parent", "--duration", "90 s"]);
    lab.ok(&[
        "fork",
        "parent@60s",
        "--set",
        "network.commands.loss=1.0",
        "--set",
        "robot.Butler.params.policy=rules",
        "--set",
        "record.log=false",
        "--duration",
        "120 s",
    ]);

    let fork = "parent-fork-120";
    assert_same(
        ("the run up to the tick", &up_to(&lab, "parent", 120)),
        ("the fork", &up_to(&lab, fork, 120)),
    );
    assert!(!lab.file(fork, "cars.log").exists());
    let events = lab.events(fork);
    let changed = events_of(&events, "changed");
    let mut set = Vec::new();
    for event in &changed {
        assert_eq!(event["tick"], 121);
        set.push(event["set"].as_str().unwrap());
    }
    let expected = [
        "network.commands.loss=1.0",
        "robot.Butler.params.policy=\"rules\"",
    ];
    assert_eq!(set, expected);
    let joined = events_of(&events, "joined");
    let back = joined.last().unwrap();
    assert_eq!(
        (&back["tick"], &back["robot"]),
        (&121.into(), &"Butler".into())
    );
    assert_eq!(back["generation"], 2);
    let mut dropped = 0;
    for event in events_of(&events, "command_dropped") {
        assert!(event["tick"].as_u64() > Some(120), "{event}");
        dropped += 1;
    }
    assert!(dropped > 0);
    assert_eq!(events.last().unwrap()["tick"], 240);

    let said = lab.ok(&["verify", fork]);
    assert!(said.contains("the same, 240 ticks to the end"), "{said}");
    let (_, said) = lab.fails(&["diff", "parent", fork]);
    assert!(said.contains("the first difference: tick 121"), "{said}");

    let scenario = std::fs::read_to_string(lab.file(fork, "scenario.toml")).unwrap();
    let scenario: toml::Table = scenario.parse().unwrap();
    assert_eq!(scenario["parent"]["run"].as_str(), Some("parent"));
    assert_eq!(scenario["parent"]["tick"].as_integer(), Some(120));

    // A fork is a run: it can be forked, and its changes stay.
    lab.ok(&[
        "fork",
        "latest@200",
        "--run",
        "second",
        "--set",
        "network.commands.loss=0.0",
    ]);
    assert_same(
        ("the first fork up to the tick", &up_to(&lab, fork, 200)),
        ("the second", &up_to(&lab, "second", 200)),
    );
    let events = lab.events("second");
    assert_eq!(events_of(&events, "changed").len(), 3);
    let said = lab.ok(&["verify", "second"]);
    assert!(said.contains("the same, 240 ticks to the end"), "{said}");
}

/// Changes of network, faults and parameters, one after the other.
const CHANGES: &str = r#"change=[
    { at = "10 s", set = ["network.commands.loss=0.5", "robot.Butler.params.policy=rules"] },
    { at = "20 s", set = ['network.partition=[{ groups = [["Butler"], ["Leguin"]], from = "0 s", until = "25 s" }]'] },
    { at = "30 s", set = ["network={}", "robot.Leguin.params.hurry_mult=2.0", "robot.Butler.params.policy=emotion"] },
]"#;
/// The same with a crash, which needs a clock that goes on.
const FAULT: &str = r#"change=[
    { at = "10 s", set = ['fault=[{ robot = "Leguin", do = "crash", at = "12 s", until = "18 s" }]'] },
    { at = "15 s", set = ["robot.Leguin.params.hurry_mult=2.0", "robot.Butler.params.policy=rules"] },
    { at = "30 s", set = ["robot.Leguin.params.hurry_mult=1.5"] },
]"#;

#[test]
fn changes_are_the_same_in_one_process_and_as_processes() {
    let lab = Lab::new();
    for (run, changes, on_late) in [
        ("changes", CHANGES, "on_late=wait"),
        ("fault", FAULT, "on_late=continue"),
    ] {
        let mut set = vec!["--duration", "60 s", "--speed", "max", "--set", changes];
        set.extend(["--set", on_late]);
        let alone = format!("{run}-alone");
        lab.ok(&[&["run", SCENARIO, "--run", &alone], &set[..]].concat());
        lab.ok(&[&["launch", HALL, "--no-console", "--run", run], &set[..]].concat());

        assert_same(
            ("in one process", &lab.bytes(&alone)),
            ("as processes", &lab.bytes(run)),
        );
        let said = lab.ok(&["verify", run]);
        assert!(said.contains("the same, 120 ticks to the end"), "{said}");
        let events = lab.events(run);
        let mut returns = Vec::new();
        for event in events_of(&events, "joined") {
            if event["generation"].is_u64() {
                let robot = event["robot"].as_str().unwrap().to_owned();
                returns.push((event["tick"].as_u64().unwrap(), robot));
            }
        }
        let expected: &[(u64, &str)] = match run {
            "changes" => &[(20, "Butler"), (60, "Butler"), (60, "Leguin")],
            // Leguin, who is gone at 15 s, has the new parameter when she is back.
            _ => &[(30, "Butler"), (36, "Leguin"), (60, "Leguin")],
        };
        let expected: Vec<(u64, String)> = expected
            .iter()
            .map(|(tick, robot)| (*tick, (*robot).to_owned()))
            .collect();
        assert_eq!(returns, expected);
    }
}

#[test]
fn a_fork_that_cannot_be_made_is_refused_and_the_run_is_kept() {
    let lab = Lab::new();
    lab.ok(&["run", SCENARIO, "--run", "parent", "--duration", "30 s"]);
    let before = lab.bytes("parent");
    let refused = |args: &[&str], reason: &str| {
        let (status, said) = lab.fails(&[&["fork"], args].concat());
        assert_ne!(status, 101, "{said}");
        let words: Vec<&str> = said.split_whitespace().collect();
        let said = words.join(" ").replace("│ ", "");
        assert!(said.contains(reason), "{args:?}: {said}");
    };

    refused(&["parent"], "is not of the form RUN@TICK");
    refused(&["parent@soon"], "is neither a tick nor a time");
    refused(&["nobody@3"], "there is no run nobody");
    refused(&["parent@61"], "ends at tick 60, before tick 61");
    refused(&["parent@60"], "nothing is left after tick 60");
    refused(&["parent@30", "--duration", "15 s"], "nothing is left");
    refused(&["parent@30", "--epoch", "2"], "has no epoch 2");
    refused(
        &["parent@30", "--run", "parent"],
        "would overwrite the run parent",
    );
    let reason =
        "only the network, faults, rules for late robots, and parameters of robots can change";
    refused(&["parent@30", "--set", "seed=5"], reason);
    refused(&["parent@30", "--set", "guests.count=5"], reason);
    refused(&["parent@30", "--set", "robot.Butler.class=Leguin"], reason);
    refused(
        &["parent@30", "--set", "network.commands.loss=3"],
        "a probability",
    );
    refused(
        &["parent@30", "--set", "robot.Nobody.params.x=1"],
        "none of the 2 elements is called",
    );
    refused(&["parent@30", "--set", "change=[]"], "further [[change]]");
    let slow = r#"fault=[{ robot = "Leguin", do = "slow", at = "20 s", until = "21 s" }]"#;
    let slow = ["parent@30", "--set", slow, "--set", "on_late=continue"];
    refused(&slow, "needs a process of its own");
    refused(
        &["parent@30", "--set", "robot.Butler.params.policy=nonsense"],
        "parameters of Butler: policy: unknown variant `nonsense`",
    );

    assert_same(("before", &before), ("after", &lab.bytes("parent")));
    assert!(!lab.out().join("parent-fork-30").exists());

    // What is not what the scenario gives cannot go on.
    let scenario = lab.file("parent", "scenario.toml");
    let text = std::fs::read_to_string(&scenario).unwrap();
    std::fs::write(&scenario, text.replacen("seed = 2002", "seed = 2003", 1)).unwrap();
    let reason = "it differs from its record at tick 0";
    refused(&["parent@30"], reason);
    assert!(!lab.out().join("parent-fork-30").exists());
    let latest = || std::fs::read_link(lab.out().join("latest")).unwrap();
    assert_eq!(latest().to_str(), Some("parent"));

    // In the place of a run, that one is cleared, and what is not of a run is kept.
    lab.ok(&["run", SCENARIO, "--run", "place", "--duration", "5 s"]);
    let args = ["parent@30", "--run", "place"];
    std::fs::write(lab.file("place", "notes.txt"), "kept").unwrap();
    refused(&args, reason);
    assert!(!lab.file("place", "events.jsonl").exists());
    assert!(!lab.file("place", "run.mcap").exists());
    assert!(lab.file("place", "notes.txt").exists());
    std::fs::remove_dir_all(lab.out().join("place")).unwrap();
    lab.ok(&["run", SCENARIO, "--run", "place", "--duration", "5 s"]);
    refused(&args, reason);
    assert!(!lab.out().join("place").exists());
}

#[test]
fn a_robot_of_another_language_cannot_go_on_in_a_fork() {
    let lab = Lab::new();
    let scenario = lab.write(
        "scenario.toml",
        "tick = \"0.5 s\"\nduration = \"10 s\"\n[field]\nsize = [\"20 ft\", \"20 ft\"]\n[[robot]]\nname = \"Bruno\"\nat = [\"5 ft\", \"5 ft\"]\n",
    );
    let stroller = root().join("sdk/stdio/bash/stroller.sh");
    let launch = format!(
        "scenario = {scenario:?}\n[[process]]\nname = \"Bruno\"\ncommand = [\"cars\", \"exec\", \"--\", {stroller:?}]\n"
    );
    let launch = lab.write("bruno.toml", &launch);
    lab.ok(&[
        "launch",
        launch.to_str().unwrap(),
        "--no-console",
        "--speed",
        "max",
    ]);

    let (_, said) = lab.fails(&["fork", "bruno@10"]);
    assert!(said.contains("Bruno cannot go on"), "{said}");
    assert!(!lab.out().join("bruno-fork-10").exists());
}

#[test]
fn an_epoch_that_was_begun_by_hand_can_be_forked() {
    let lab = Lab::new();
    let args = ["launch", HALL, "--no-console", "--paused", "--speed", "max"];
    let mut launch = lab.start("epochs", &[&args[..], &["--duration", "20 s"]].concat());
    lab.until_ready("epochs");
    lab.step("epochs", 12);
    lab.ok(&["ctl", "init", "--run", "epochs", "--seed", "9"]);
    eventually("the next epoch", || {
        lab.file("epochs", "events-epoch1.jsonl")
            .exists()
            .then_some(())
    });
    lab.until_ready("epochs");
    lab.ok(&["ctl", "start", "--run", "epochs"]);
    launch.finish();

    lab.ok(&["fork", "epochs@20", "--run", "second", "-q"]);
    assert_same(
        ("the second epoch", &lab.bytes("epochs")),
        ("its fork", &lab.bytes("second")),
    );
    lab.ok(&["fork", "epochs@10", "--epoch", "1", "--run", "first", "-q"]);
    let events = lab.events("first");
    assert_eq!(events[0]["seed"], 2002);
    assert_eq!(events.last().unwrap()["tick"], 40);
}
