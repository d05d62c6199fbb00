//! Forks of worlds with sites, layers, payloads, radios, shapes and places from the seed: each shares its parent's ticks, and without
//! a change it is its parent.

use std::path::Path;

use nix::sys::signal::Signal;
use system_tests::processes::{Running, nobody_is_left, send};
use system_tests::{Lab, assert_same, eventually, programs};

/// Bidders among walls and bodies of several shapes, over a network with loss, repetitions and delays that changes twice. Layers go on by
/// themselves, and what is expected and measured depends on sites, layers and places.
const WORLD: &str = r#"
seed = 11
tick = "0.1 s"
duration = "12 s"
end_when = { sites = "T*", by = "count", variable = "done", at_least = 4 }

[field]
size = ["12 m", "12 m"]
body = "0.4 m"

[network]
commands = { loss = 0.3, duplication = 0.2, delay = { min = "0 s", mode = "0.1 s", max = "0.4 s" } }
radio = { range = "7 m" }

[sensing]
range = "3 m"
field_of_view = "200 deg"
walls_hide = true
misses = 0.2
noise = "0.1 m"

[[wall]]
points = [["6 m", "0 m"], ["6 m", "4 m"], ["8 m", "6 m"]]

[[obstacle]]
count = 3
at = "random"
radius = "0.3 m"

[[site]]
name = "T{1..9}"
kind = "task"
at = "random"
range = "1.5 m"
known = true
state = { done = false }

[[layer]]
name = "dust"
cell = "0.5 m"
decay = 0.1
diffuse = 0.2
range = "1 m"
peaks = [{ count = 3, at = "random", radius = "2 m", height = 5 }]

[[robot]]
name = "S{1..8}"
class = "Bidder"
at = { cluster = { center = ["3 m", "6 m"], radius = "2.5 m" } }
radius = "0.15 m"
params = { speed = "1 m/s", work = "1 s", sends = "periodically", period = "0.3 s" }

[[change]]
at = "3 s"
set = ["network.commands.loss=0.6", "robot.S*.params.period=0.2 s"]
[[change]]
at = "6 s"
set = ["network.commands={}"]

[[measure]]
name = "dust"
layer = { name = "dust", by = "sum", as = "end" }
[[expect]]
name = "one is done"
eventually = { sites = "T*", by = "any", variable = "done" }
within = "10 s"
"#;

/// Guests who walk by a model, want a site, an exit and treats, stop for Butler and come closer to him.
const PEOPLE: &str = r#"
seed = 5
duration = "120 s"

[guests]
count = 30
model = "collision-free"
speed = { min = "0.5 m/s", mode = "1 m/s", max = "1.5 m/s" }

[[guests.wants]]
site = "bar"
stay = { min = "2 s", mode = "5 s", max = "10 s" }
[[guests.wants]]
exit = ["0 m", "7 m"]
stay = { min = "2 s", mode = "5 s", max = "10 s" }
[[guests.wants]]
treat = "Butler"
give_up = "20 s"
weight = 2

[guests.requests]
stop = "2 s"
come_closer = true

[[site]]
name = "bar"
at = "random"

[[obstacle]]
at = ["2 ft", "2 ft"]

[[robot]]
name = "Butler"
at = ["25 ft", "25 ft"]
params = { table = ["4 ft", "4 ft"] }
[[robot]]
name = "Leguin"
at = ["4 ft", "4 ft"]
"#;

struct Parent {
    lab: Lab,
    ticks: u64,
}

impl Parent {
    fn of(file: &str, more: &[&str]) -> Self {
        let lab = Lab::new();
        let is_text = file.contains('\n');
        let file = if is_text {
            lab.write("world.toml", file)
        } else {
            file.into()
        };
        let file = file.display().to_string();
        lab.ok(&[&["run", &file, "--run", "parent", "-q"], more].concat());
        let ticks = lab.summary("parent")["ticks"].as_u64().unwrap();
        Self { lab, ticks }
    }

    fn fork(&self, of: &str, tick: u64, run: &str, more: &[&str]) {
        let at = format!("{of}@{tick}");
        let fork = ["fork", &at, "--run", run, "-q"];
        self.lab.ok(&[&fork, more].concat());
    }

    fn assert_is_parent(&self, run: &str) {
        let parent = self.lab.bytes("parent");
        assert_same(("the run", &parent), (run, &self.lab.bytes(run)));
        self.lab.ok(&["verify", run]);
        let said = self.lab.ok(&["diff", "parent", run]);
        assert!(said.contains("the same"), "{said}");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn forks_without_a_change_at_any_tick_are_the_run() {
    forks_are_the_run(&[("auction", &["--seed", "3"]), (WORLD, &[])]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn forks_without_a_change_in_further_scenarios_are_the_run() {
    forks_are_the_run(&[
        (
            "auction",
            &[
                "--set",
                "tick=0.2 s",
                "--set",
                "robot.B*.params.sends=on_change",
            ],
        ),
        ("swarm", &["--duration", "40 s"]),
        (PEOPLE, &[]),
        (PEOPLE, &["--set", "guests.model=social-force"]),
    ]);
}

fn forks_are_the_run(scenarios: &[(&str, &[&str])]) {
    for (file, more) in scenarios {
        let parent = Parent::of(file, more);
        let Parent { ticks, .. } = parent;
        assert!(ticks > 20, "{ticks}");
        parent.lab.ok(&["verify", "parent"]);
        for tick in [0, 1, ticks / 2, ticks - 1] {
            parent.fork("parent", tick, "fork", &[]);
            parent.assert_is_parent("fork");
        }

        // A fork of a fork, after and before the tick of the first one.
        parent.fork("parent", ticks / 2, "first", &[]);
        for tick in [0, ticks / 2, ticks - 2] {
            parent.fork("first", tick, "second", &[]);
            parent.assert_is_parent("second");
        }
    }
}

/// What a run ended by; `null` if by its duration.
fn ended_by(lab: &Lab, run: &str) -> (u64, serde_json::Value) {
    let end = lab.events(run).pop().unwrap();
    (end["tick"].as_u64().unwrap(), end["because"].clone())
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_fork_ends_by_conditions_that_hold_before_at_and_after_its_tick() {
    let parent = Parent::of(WORLD, &[]);
    let Parent { lab, ticks } = &parent;
    let (end, because) = ended_by(lab, "parent");
    assert!(
        because.is_string() && end == *ticks && end < 120,
        "{because} {end}"
    );
    let done = |count: u32| {
        format!("end_when={{ sites = \"T*\", by = \"count\", variable = \"done\", is = {count} }}")
    };

    // The tick of the end has no tick after it; the one before has one.
    let (_, said) = lab.fails(&["fork", &format!("parent@{ticks}"), "--run", "none"]);
    assert!(said.contains("by its `end_when`"), "{said}");
    assert!(!lab.out().join("none").exists());
    parent.fork("parent", ticks - 1, "fork", &[]);
    parent.assert_is_parent("fork");

    // It holds at the tick already.
    let (_, said) = lab.fails(&["fork", "parent@5", "--run", "none", "--set", &done(0)]);
    assert!(said.contains("ends at tick 5 by its `end_when`"), "{said}");
    assert!(!lab.out().join("none").exists());

    // It held before the tick, and does not again: the fork goes on to its duration.
    parent.fork("parent", ticks - 1, "past", &["--set", &done(0)]);
    assert_eq!(ended_by(lab, "past"), (120, serde_json::Value::Null));
    assert!(lab.ok(&["verify", "past"]).contains("120 ticks to the end"));

    // It holds at the last tick, and after the end of the parent, which the fork then outlives.
    parent.fork("parent", *ticks, "later", &["--set", &done(6)]);
    let (later, because) = ended_by(lab, "later");
    assert!(later > *ticks, "{later}");
    assert!(
        lab.ok(&["verify", "later"])
            .contains(&format!("{later} ticks to the end"))
    );
    if because.is_string() {
        // The duration may end where the condition does.
        let s = format!("{} s", later as f64 * 0.1);
        let both = ["--set", &done(6), "--duration", &s];
        parent.fork("parent", *ticks, "both", &both);
        assert_eq!(ended_by(lab, "both"), (later, because));
        let (_, said) = lab.fails(&["fork", &format!("both@{later}"), "--run", "none"]);
        assert!(said.contains("nothing is left"), "{said}");
    }
}

#[test]
fn changes_of_forks_take_effect_from_the_next_tick_on() {
    let parent = Parent::of(WORLD, &[]);
    let lab = &parent.lab;
    let set = [
        "--set",
        "robot.S*.params.speed=0.5 m/s",
        "--set",
        "network.radio={ range = \"3 m\" }",
    ];
    let mut before = String::from("parent");
    for (index, tick) in [29, 30, 31, 47].into_iter().enumerate() {
        let run = format!("fork-{index}");
        parent.fork(&before, tick, &run, &set);
        let text = |run: &str| String::from_utf8(lab.bytes(run)).unwrap();
        let end = format!("{{\"tick\":{},", tick + 1);
        let common = |run: &str| text(run).split(&end).next().unwrap().to_owned();
        assert_same(
            (&before, common(&before).as_bytes()),
            (&run, common(&run).as_bytes()),
        );
        let changed = lab.events(&run);
        let changed = changed.iter().filter(|event| event["event"] == "changed");
        assert!(changed.clone().any(|event| event["tick"] == tick + 1));
        lab.ok(&["verify", &run]);
        before = run;
    }

    // What the last one changes is in the record of the scenario, and executed from there it is the same run.
    let scenario = lab.file(&before, "scenario.toml");
    let text = std::fs::read_to_string(&scenario).unwrap();
    assert_eq!(text.matches("[[change]]").count(), 2 + 4, "{text}");
    lab.ok(&["run", scenario.to_str().unwrap(), "--run", "again", "-q"]);
    assert_same(
        ("the fork", &lab.bytes(&before)),
        ("again", &lab.bytes("again")),
    );
}

/// A launch file for the robots of a world: their names, their program, and how many are in a process.
fn launch_of(lab: &Lab, name: &str, scenario: &Path, processes: &[(&str, &str, usize)]) -> String {
    let mut text = format!("scenario = {scenario:?}\n");
    for (robots, program, per_process) in processes {
        let command = programs().join(program);
        text += &format!(
            "[[process]]\nname = \"{program}\"\ncommand = [{command:?}]\nrobots = \"{robots}\"\nper_process = {per_process}\n"
        );
    }
    lab.write(name, &text).display().to_string()
}

/// Kills the simulator of a launch twice, resumes it each time, and returns what was recorded in the end.
fn killed_and_resumed(lab: &Lab, run: &str, launch: &str, ticks: [u64; 2]) -> Vec<u8> {
    let paced = ["launch", launch, "--no-console", "--speed", "4"];
    let resume = ["launch", "--no-console", "--resume", run];
    for (index, tick) in ticks.into_iter().enumerate() {
        let mut launched = if index == 0 {
            lab.start(run, &paced)
        } else {
            Running::start(lab.cars(&resume), run, lab.out().join(run))
        };
        let end = format!("{{\"tick\":{tick},\"event\":\"tick\"");
        eventually("the tick", || {
            let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
            events.contains(&end).then_some(())
        });
        send(launched.process("cars-sim"), Signal::SIGKILL);
        assert!(!launched.wait().success());
        nobody_is_left(run);
    }
    lab.ok(&[&resume[..], &["--speed", "max"]].concat());
    lab.bytes(run)
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn any_number_of_processes_killed_or_not_give_the_same_world() {
    let parent = Parent::of(WORLD, &[]);
    let lab = &parent.lab;
    let scenario = lab.out().join("world.toml");
    for per_process in [1, 3, 8] {
        let run = format!("by-{per_process}");
        let file = launch_of(
            lab,
            &format!("{run}.toml"),
            &scenario,
            &[("S*", "cars-bidder", per_process)],
        );
        lab.ok(&[
            "launch",
            &file,
            "--no-console",
            "--speed",
            "max",
            "--run",
            &run,
        ]);
        parent.assert_is_parent(&run);
    }
    let file = launch_of(lab, "by-4.toml", &scenario, &[("S*", "cars-bidder", 4)]);
    killed_and_resumed(lab, "resumed", &file, [20, 45]);
    parent.assert_is_parent("resumed");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn guests_who_walk_by_a_model_are_resumed_as_they_were() {
    let parent = Parent::of(PEOPLE, &[]);
    let events = String::from_utf8(parent.lab.bytes("parent")).unwrap();
    for event in ["guest_entered", "guest_left", "\"guest\",\"guest\""] {
        assert!(events.contains(event), "no {event}");
    }
    let scenario = parent.lab.out().join("world.toml");
    let processes = [("Butler", "cars-butler", 1), ("Leguin", "cars-leguin", 1)];
    let file = launch_of(&parent.lab, "people.toml", &scenario, &processes);
    killed_and_resumed(&parent.lab, "resumed", &file, [30, 90]);
    parent.assert_is_parent("resumed");
}

/// Robots that drive, take from sites and sweep layers, close to one another and to walls.
const ACTORS: &str = r#"
seed = 4
tick = "0.1 s"
duration = "12 s"
end_when = { sites = "T*", by = "all", variable = "stock", at_most = 0, for = "5 s" }

[field]
size = ["8 m", "8 m"]

[sensing]
rays = { count = 7, range = "3 m" }

[[wall]]
points = [["4 m", "1 m"], ["4 m", "3 m"], ["5 m", "2.5 m"]]

[[site]]
name = "T{1..3}"
at = { circle = { center = ["3 m", "4 m"], radius = "1 m" }, jitter = "0.2 m" }
range = "4 m"
state = { stock = { start = 40, min = 0 }, open = true, last = "" }
[[site]]
name = "U"
at = ["3 m", "4 m"]
range = "4 m"
on_conflict = "refuse"
state = { stock = { start = 9, min = 0 }, open = true, last = "" }

[[layer]]
name = "dust"
cell = "0.5 m"
range = "1.5 m"
min = 0
diffuse = 0.1
peaks = [{ count = 2, at = "random", radius = "3 m", height = 4 }]
[[layer]]
name = "trail"
cell = "0.25 m"
range = "1 m"
decay = 0.5

[[robot]]
name = "F{1..2}"
at = { line = { from = ["1 m", "3 m"], to = ["1 m", "5 m"] } }
[[robot]]
name = "R{1..3}"
at = "random"
size = ["0.7 m", "0.3 m"]
drive = { max_speed = "0.8 m/s", max_acceleration = "0.9 m/s2", max_turn_acceleration = "3 rad/s2", heading = "40 deg" }
[[robot]]
name = "W{1..2}"
at = "random"
radius = "0.2 m"
"#;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn worlds_of_robots_that_drive_and_act_are_resumed_as_they_were() {
    let lab = Lab::new();
    let scenario = lab.write("actors.toml", ACTORS);
    let mut processes = [
        ("F*", "forager", 1),
        ("R*", "rover", 2),
        ("W*", "sweeper", 2),
    ];
    let forward = launch_of(&lab, "forward.toml", &scenario, &processes);
    processes.reverse();
    let backward = launch_of(&lab, "backward.toml", &scenario, &processes);

    let plain = [
        "launch",
        &forward,
        "--no-console",
        "--speed",
        "max",
        "--run",
        "whole",
    ];
    lab.ok(&plain);
    let whole = lab.bytes("whole");
    let text = String::from_utf8(whole.clone()).unwrap();
    for event in [
        "blocked",
        "site_changed",
        "site_refused",
        "conflict",
        "layer_changed",
        "layer_refused",
    ] {
        assert!(text.contains(event), "no {event}");
    }
    lab.ok(&["verify", "whole"]);
    let ticks = lab.summary("whole")["ticks"].as_u64().unwrap();
    assert!(ticks > 60, "{ticks}");

    let resumed = killed_and_resumed(&lab, "resumed", &backward, [15, 40]);
    assert_same(("whole", &whole), ("resumed", &resumed));
    lab.ok(&["verify", "resumed"]);
}

#[test]
fn a_new_epoch_with_another_seed_is_the_run_of_that_seed() {
    let lab = Lab::new();
    let scenario = lab.write("world.toml", WORLD);
    let file = launch_of(&lab, "launch.toml", &scenario, &[("S*", "cars-bidder", 4)]);
    let args = [
        "launch",
        &file,
        "--no-console",
        "--paused",
        "--speed",
        "max",
    ];
    let mut launch = lab.start("epochs", &args);
    lab.until_ready("epochs");
    lab.step("epochs", 12);
    lab.ok(&["ctl", "init", "--run", "epochs", "--seed", "12"]);
    eventually("the next epoch", || {
        let first = lab.file("epochs", "events-epoch1.jsonl");
        first.exists().then_some(())
    });
    lab.until_ready("epochs");
    lab.ok(&["ctl", "start", "--run", "epochs"]);
    launch.finish();

    let scenario = scenario.display().to_string();
    lab.ok(&["run", &scenario, "--seed", "12", "--run", "alone", "-q"]);
    assert_same(
        ("the second epoch", &lab.bytes("epochs")),
        ("a run", &lab.bytes("alone")),
    );
    lab.ok(&["verify", "epochs"]);
    lab.ok(&["fork", "epochs@20", "--run", "second", "-q"]);
    assert_same(
        ("the second epoch", &lab.bytes("epochs")),
        ("its fork", &lab.bytes("second")),
    );
}
