//! The promise: the same seed gives the same run, byte for byte, however it is executed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use system_tests::{Lab, assert_same, root};

const FILE: &str = "launch/hors_doeuvres.toml";
/// Long enough for several exchanges, refills and interceptions.
const LENGTH: [&str; 4] = ["--duration", "150 s", "--speed", "max"];

fn launched(lab: &Lab, run: &str, file: &str, more: &[&str]) -> Vec<u8> {
    let mut args = vec!["launch", file, "--run", run];
    args.extend(LENGTH);
    args.extend(more);
    lab.ok(&args);
    lab.bytes(run)
}

fn in_process(lab: &Lab, run: &str, file: &str, more: &[&str]) -> Vec<u8> {
    let mut args = vec!["run", file, "--run", run];
    args.extend(LENGTH);
    args.extend(more);
    lab.ok(&args);
    lab.bytes(run)
}

#[test]
fn a_launch_and_a_run_in_one_process_are_the_same() {
    let lab = Lab::new();
    let local = in_process(&lab, "same-local", FILE, &["--seed", "3"]);
    let first = launched(&lab, "same-first", FILE, &["--seed", "3"]);
    let second = launched(&lab, "same-second", FILE, &["--seed", "3"]);
    assert_same(("run", &local), ("launch", &first));
    assert_same(("first launch", &first), ("second launch", &second));

    // Nothing would be shown by two runs in which nothing happens.
    let text = String::from_utf8(local).unwrap();

    for event in [
        "command_sent",
        "command_delivered",
        "emotion",
        "behavior",
        "blocked",
        "\"end\"",
    ] {
        assert!(text.contains(event), "no {event} in the run");
    }
}

#[test]
fn another_seed_is_another_run() {
    let lab = Lab::new();
    assert_ne!(
        in_process(&lab, "a", FILE, &["--seed", "3"]),
        in_process(&lab, "b", FILE, &["--seed", "4"])
    );
}

#[test]
fn three_robots_are_the_same_either_way() {
    let lab = Lab::new();
    let file = "launch/three_robots.toml";
    let local = in_process(&lab, "three-local", file, &[]);
    let launch = launched(&lab, "three-launch", file, &[]);
    assert_same(("run", &local), ("launch", &launch));
}

#[test]
fn the_order_in_which_robots_start_changes_nothing() {
    let lab = Lab::new();
    let scenario = root().join("configs/hors_doeuvres.toml");
    let process = |name: &str| {
        format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars-{}\"]\n",
            name.to_lowercase()
        )
    };
    let head = format!("scenario = {:?}\n", scenario.display().to_string());
    let forward = lab.write(
        "forward.toml",
        &(head.clone() + &process("Butler") + &process("Leguin")),
    );
    let backward = lab.write(
        "backward.toml",
        &(head + &process("Leguin") + &process("Butler")),
    );
    let forward = launched(&lab, "order-forward", forward.to_str().unwrap(), &[]);
    let backward = launched(&lab, "order-backward", backward.to_str().unwrap(), &[]);

    assert_same(("forward", &forward), ("backward", &backward));
}

/// Keeps every core busy until dropped.
struct Load(Arc<AtomicBool>, Vec<std::thread::JoinHandle<()>>);

impl Load {
    fn on_all_cores() -> Self {
        let (stop, cores) = (
            Arc::new(AtomicBool::new(false)),
            std::thread::available_parallelism().unwrap().get(),
        );
        let burn = |stop: Arc<AtomicBool>| move || while !stop.load(Ordering::Relaxed) {};
        let threads = (0..2 * cores)
            .map(|_| std::thread::spawn(burn(stop.clone())))
            .collect();
        Self(stop, threads)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        for thread in self.1.drain(..) {
            let _ = thread.join();
        }
    }
}

#[test]
fn load_on_all_cores_changes_nothing() {
    let lab = Lab::new();
    let calm = in_process(&lab, "load-calm", FILE, &[]);
    let load = Load::on_all_cores();
    let busy = launched(&lab, "load-busy", FILE, &[]);
    drop(load);
    assert_same(("calm", &calm), ("busy", &busy));
}

#[test]
fn several_robots_in_one_process_are_the_same() {
    let lab = Lab::new();
    let scenario = root().join("configs/three_robots.toml");
    let text = format!(
        "scenario = {:?}\n[[process]]\nname = \"refillers\"\ncommand = [\"cars-leguin\"]\nrobots = [\"Leguin\", \"Vonda\"]\n\
         [[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n",
        scenario.display().to_string()
    );
    let file = lab.write("together.toml", &text);
    let together = launched(&lab, "hosts-together", file.to_str().unwrap(), &[]);
    let apart = in_process(&lab, "hosts-apart", "configs/three_robots.toml", &[]);

    assert_same(("together", &together), ("apart", &apart));
}

#[test]
fn the_resolved_scenario_of_a_run_gives_the_same_run() {
    let lab = Lab::new();
    let first = in_process(
        &lab,
        "resolved-first",
        FILE,
        &["--seed", "5", "--set", "guests.count=60"],
    );
    let resolved = lab.file("resolved-first", "scenario.toml");
    lab.ok(&[
        "run",
        resolved.to_str().unwrap(),
        "--run",
        "resolved-second",
    ]);

    assert_same(("first", &first), ("second", &lab.bytes("resolved-second")));
}

/// The ticks of a recording without what differs from run to run.
fn reproducible(lab: &Lab, run: &str) -> Vec<recording::RecordedTick> {
    let mut ticks = lab.recorded(run);
    for tick in &mut ticks {
        tick.panels.clear();
        tick.wall = recording::WallTimes::default();
    }
    ticks
}

#[test]
fn a_lossy_network_is_part_of_the_seed() {
    let lab = Lab::new();
    let args = [
        "--duration",
        "120 s",
        "--set",
        "network.commands.loss=0.4",
        "--set",
        "robot.Butler.params.resend=on",
    ];
    let with = |first: [&'static str; 4]| first.into_iter().chain(args).collect::<Vec<_>>();
    lab.ok(&with([
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "lossy-run",
    ]));

    lab.start(
        "lossy-launch",
        &with(["launch", "launch/hors_doeuvres.toml", "--speed", "max"]),
    )
    .finish();
    assert_same(
        ("run", &lab.bytes("lossy-run")),
        ("launch", &lab.bytes("lossy-launch")),
    );

    // The recording of both is the same, too.
    let [first, second] = ["lossy-run", "lossy-launch"].map(|run| reproducible(&lab, run));
    assert_eq!(first.len(), second.len());
    for (first, second) in first.iter().zip(&second) {
        assert_eq!(first, second);
    }

    let dropped = lab
        .events("lossy-run")
        .iter()
        .filter(|event| event["event"] == "command_dropped")
        .count();
    let sent: Vec<_> = lab
        .events("lossy-run")
        .into_iter()
        .filter(|event| event["event"] == "command_sent")
        .collect();

    assert!(
        dropped > 0 && dropped < sent.len(),
        "{dropped} of {}",
        sent.len()
    );
    assert!(sent.iter().all(|event| event["performative"] == "achieve"));
}

/// The experiment of the paper with a cut between the two robots, commands and queries.
const CUT: &str = "network.partition=[{ groups = [[\"Butler\"], [\"Leguin\"]], from = \"60 s\", until = \"180 s\" }]";

#[test]
fn a_partition_is_part_of_the_seed_and_told_in_the_summary() {
    let lab = Lab::new();
    let with = |first: [&'static str; 4]| {
        first
            .into_iter()
            .chain(["--duration", "300 s", "--set", CUT])
            .collect::<Vec<_>>()
    };

    lab.ok(&with([
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "cut-run",
    ]));

    for run in ["cut-launch", "cut-again"] {
        lab.start(
            run,
            &with(["launch", "launch/hors_doeuvres.toml", "--speed", "max"]),
        )
        .finish();
        assert_same(("run", &lab.bytes("cut-run")), (run, &lab.bytes(run)));
    }

    let events = lab.events("cut-launch");
    let at = |kind: &str| -> Vec<u64> {
        events
            .iter()
            .filter(|event| event["event"] == kind)
            .map(|event| event["tick"].as_u64().unwrap())
            .collect()
    };

    assert_eq!(
        (at("link_cut"), at("link_healed")),
        (vec![120, 120], vec![360, 360])
    );

    let summary = lab.summary("cut-launch");
    let network = &summary["network"];
    assert_eq!(network, &lab.summary("cut-run")["network"]);

    let (there, back) = (
        &network["links"]["Butler -> Leguin"],
        &network["links"]["Leguin -> Butler"],
    );
    assert_eq!(
        (&there["unreachable_ticks"], &back["longest_stale_s"]),
        (&240.into(), &120.0.into())
    );
    assert_eq!(network["cuts"][0]["until_s"], 180.0);

    let dropped = at("command_dropped");
    assert!(
        !dropped.is_empty() && dropped.iter().all(|tick| (120..360).contains(tick)),
        "{dropped:?}"
    );
    assert_eq!(there["dropped"]["partition"], dropped.len());
}

#[test]
fn delays_and_doubles_are_the_same_as_processes_and_in_one() {
    let lab = Lab::new();
    let network = "network.commands={ loss = 0.2, duplication = 0.3, delay = { min = \"0 s\", mode = \"1 s\", max = \"10 s\" }, burst = { enter = 0.05, leave = 0.2 } }";
    let with = |first: [&'static str; 4]| {
        let more = [
            "--duration",
            "300 s",
            "--set",
            network,
            "--set",
            "network.queries.loss=0.2",
        ];
        first.into_iter().chain(more).collect::<Vec<_>>()
    };

    lab.ok(&with([
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "late-run",
    ]));

    lab.start(
        "late-launch",
        &with(["launch", "launch/hors_doeuvres.toml", "--speed", "max"]),
    )
    .finish();
    assert_same(
        ("run", &lab.bytes("late-run")),
        ("launch", &lab.bytes("late-launch")),
    );

    let events = lab.events("late-run");

    for kind in [
        "command_delayed",
        "command_duplicated",
        "command_dropped",
        "query_lost",
    ] {
        assert!(events.iter().any(|event| event["event"] == kind), "{kind}");
    }

    assert!(events.iter().all(|event| event["because"] != "missed"));
}
