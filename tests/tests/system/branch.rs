//! Branches of runs in memory, and runs that are re-seeded.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use lab::branch::{Branch, Trunk};
use lab::folder::recorded_epoch;
use lab::run::{execute, project_robots};
use protocol::Event;
use record::RunFolder;
use scenario::{Changes, Scenario};
use system_tests::{Lab, assert_same, root};

/// The shipped scenarios whose robots are of this process, brief.
fn scenarios() -> Vec<(String, Scenario)> {
    let mut found = Vec::new();
    let mut files: Vec<PathBuf> = std::fs::read_dir(root().join("configs"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .collect();
    files.sort();
    for file in files {
        let changes = Changes {
            duration_s: Some(150.0),
            ..Changes::default()
        };
        let scenario = Scenario::load(&file, &changes).unwrap();
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        let mut classes = scenario.robots.values().map(|robot| &robot.class);
        if classes.all(|class| robots::make(class).is_some()) {
            found.push((name, scenario));
        }
    }
    assert!(found.len() > 8, "{}", found.len());
    found
}

/// Plays a branch to its end; returns what happens in each tick.
fn rest(mut branch: Branch) -> Vec<Arc<Vec<Event>>> {
    let mut events = Vec::new();
    while let Some(record) = branch.step().unwrap() {
        events.push(record.events);
    }
    events
}

#[test]
fn a_copy_goes_on_as_the_run_does_in_every_shipped_scenario() {
    for (name, scenario) in scenarios() {
        let mut run = Branch::start(scenario.clone(), project_robots()).unwrap();
        let mut copies = vec![run.snapshot().unwrap()];
        let mut whole = Vec::new();
        while let Some(record) = run.step().unwrap() {
            if [1, scenario.ticks / 3, scenario.ticks - 2].contains(&record.tick) {
                copies.push(run.snapshot().unwrap());
            }
            whole.push(record.events);
        }

        for copy in copies {
            let tick = copy.tick() as usize;
            let again = rest(copy.snapshot().unwrap());
            let events = rest(copy);
            assert_eq!(events, whole[tick..], "{name} after tick {tick}");
            assert_eq!(again, events, "{name}: a copy of a copy");
        }
    }
}

#[test]
fn a_branch_of_a_record_is_the_rest_of_it() {
    for (name, mut scenario) in scenarios() {
        scenario.record.panels = false;
        let out = tempfile::tempdir().unwrap();
        let run = name.parse().unwrap();
        let folder = RunFolder::at(out.path().join(&name));
        let lock = folder.create(&scenario).unwrap();
        execute(scenario.clone(), &run, &folder, None).unwrap();
        drop(lock);

        let files = recorded_epoch(&folder, None).unwrap();
        let summary = lab::folder::read_summary(&folder).unwrap().unwrap();
        let mut trunk = Trunk::open(&files, scenario.clone(), project_robots(), false).unwrap();
        for tick in [0, 7, trunk.last() / 2] {
            trunk.go_to(tick).unwrap();
            let mut branch = trunk.snapshot().unwrap().into_branch().unwrap();
            branch.play().unwrap();
            assert_eq!(branch.digest(), summary.digest, "{name} after tick {tick}");
        }
        trunk.go_to(trunk.last()).unwrap();
        assert!(trunk.into_branch().unwrap().step().unwrap().is_some());
    }
}

const HALL: &str = "configs/hors_doeuvres.toml";

/// The lines of a run's events up to the end of a tick.
fn up_to(lab: &Lab, run: &str, tick: u64) -> String {
    let events = String::from_utf8(lab.bytes(run)).unwrap();
    let end = format!("{{\"tick\":{tick},\"event\":\"tick\"");
    let place = events.find(&end).expect("the tick is complete");
    events[..place].to_owned()
}

#[test]
fn a_fork_with_another_seed_shares_the_past_alone_and_is_the_same_in_every_way_to_play_it() {
    let lab = Lab::new();
    let loss = "network.commands.loss=0.2";
    lab.ok(&[
        "run",
        HALL,
        "--run",
        "parent",
        "--duration",
        "90 s",
        "--set",
        loss,
    ]);
    lab.ok(&["fork", "parent@60s", "--seed", "7", "-q"]);
    let fork = "parent-fork-120-seed-7";
    assert_eq!(up_to(&lab, "parent", 120), up_to(&lab, fork, 120));
    assert_ne!(lab.bytes("parent"), lab.bytes(fork));
    let said = lab.ok(&["verify", fork]);
    assert!(said.contains("the same, 180 ticks to the end"), "{said}");

    // A fork of a fork, of some kinds of chance only.
    let some = ["--seed", "7", "--reseed", "network,robot.But*"];
    let args = [
        &["fork", "latest@150", "--run", "second", "-q"][..],
        &some[..],
    ]
    .concat();
    lab.ok(&args);
    assert_eq!(up_to(&lab, fork, 150), up_to(&lab, "second", 150));
    let said = lab.ok(&["verify", "second"]);
    assert!(said.contains("the same, 180 ticks to the end"), "{said}");
    let events = up_to(&lab, "second", 180);
    for reseed in [
        "{\"tick\":121,\"event\":\"changed\",\"set\":\"reseed={ seed = 7 }\"}",
        "{\"tick\":151,\"event\":\"changed\",\"set\":\"reseed={ seed = 7, of = [\\\"network\\\", \\\"robot.But*\\\"] }\"}",
    ] {
        assert!(events.contains(reseed), "{reseed}");
    }

    // Processes learn it from their welcome.
    let scenario = lab.file("second", "scenario.toml");
    let launch = lab.write(
        "reseeded.toml",
        &format!(
            "scenario = {:?}\n[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
             [[process]]\nname = \"Leguin\"\ncommand = [\"cars-leguin\"]\n",
            scenario.display().to_string()
        ),
    );
    let file = launch.to_str().unwrap();
    lab.ok(&["launch", file, "--run", "launched", "--speed", "max"]);
    assert_same(
        ("the fork", &lab.bytes("second")),
        ("its scenario as processes", &lab.bytes("launched")),
    );

    for (kind, said) in [
        (
            "nets",
            "the kinds are network, guests, sensing, and robot.NAME",
        ),
        ("robot.Zed", "no robot is called Zed"),
    ] {
        let (_, error) = lab.fails(&["fork", "parent@60s", "--seed", "7", "--reseed", kind]);
        assert!(error.contains(said), "{error}");
    }
}

/// The commands that are lost by chance after a tick.
fn lost(events: &[Arc<Vec<Event>>]) -> Vec<String> {
    let all = events.iter().flat_map(|events| events.iter());
    let dropped = all.filter(|event| matches!(event, Event::CommandDropped { .. }));
    dropped.map(|event| format!("{event:?}")).collect()
}

#[test]
fn kinds_of_chance_are_drawn_anew_by_themselves() {
    let text = "seed = 4\nduration = \"100 s\"\n[guests]\ncount = 20\n[network]\ncommands = { loss = 0.3 }\n\
                [[robot]]\nname = \"S{1..3}\"\nclass = \"Scout\"\nat = \"random\"\n";
    let source = scenario::diagnostic::Source {
        name: "test".to_owned(),
        text: text.to_owned(),
    };
    let scenario = Scenario::parse(&source, ".".as_ref()).unwrap();
    let mut run = Branch::start(scenario, project_robots()).unwrap();
    for _ in 0..50 {
        run.step().unwrap();
    }

    let whole = rest(run.snapshot().unwrap());
    let mut differing = Vec::new();
    for kind in ["network", "guests", "sensing", "robot.S1"] {
        let mut branch = run.snapshot().unwrap();
        branch.reseed(9, &[kind.parse().unwrap()]);
        let events = rest(branch);
        // Scouts send at fixed times: what is lost depends on the network alone.
        assert_eq!(lost(&events) == lost(&whole), kind != "network", "{kind}");
        let guests = rest_of_guests(&run, kind);
        if guests != rest_of_guests(&run, "sensing") {
            differing.push(kind);
        }
    }
    // Nothing else than the network and the guests draws anything here.
    assert!(
        differing.contains(&"guests") && !differing.contains(&"robot.S1"),
        "{differing:?}"
    );
}

/// Where the first guest stands ten ticks after a kind of chance was drawn anew.
fn rest_of_guests(run: &Branch, kind: &str) -> String {
    let mut branch = run.snapshot().unwrap();
    branch.reseed(9, &[kind.parse().unwrap()]);
    for _ in 0..10 {
        branch.step().unwrap();
    }
    format!("{:?}", branch.simulation().world().guests())
}

/// Forks at each of 40 ticks of a hall of ten minutes, by two threads, and the time that they take. CARS_FORKS=200 is what people
/// wait for who ask what decided such a run.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn forks_from_forty_ticks_of_a_hall_play_it_to_its_end() {
    let forks = std::env::var("CARS_FORKS").map_or(2, |forks| forks.parse().unwrap());
    let out = tempfile::tempdir().unwrap();
    let changes = Changes {
        duration_s: Some(600.0),
        ..Changes::default()
    };
    let scenario = Scenario::load(&root().join("configs/hors_doeuvres.toml"), &changes).unwrap();
    let folder = RunFolder::at(out.path().join("hall"));
    let lock = folder.create(&scenario).unwrap();
    execute(scenario.clone(), &"hall".parse().unwrap(), &folder, None).unwrap();
    drop(lock);

    let begun = Instant::now();
    let files = recorded_epoch(&folder, None).unwrap();
    let mut trunk = Trunk::open(&files, scenario, project_robots(), true).unwrap();
    let last = trunk.last();
    let mut ticks = 0;
    let mut expected = 0;
    for index in 0..40 {
        trunk.go_to(last * index / 40).unwrap();
        expected += forks * (last - trunk.tick());
        let played = std::thread::scope(|scope| {
            let threads = [0, 1].map(|first| {
                let base = trunk.snapshot().unwrap();
                scope.spawn(move || {
                    let mut ticks = 0;
                    for number in (first..forks).step_by(2) {
                        let mut branch = base.snapshot().unwrap().into_branch().unwrap();
                        let from = branch.tick();
                        branch.reseed(number + 1, &[]);
                        branch.play().unwrap();
                        ticks += branch.tick() - from;
                    }
                    ticks
                })
            });
            threads.map(|thread| thread.join().unwrap())
        });
        ticks += played[0] + played[1];
    }
    let took = begun.elapsed();
    println!("{} forks, {ticks} ticks: {took:?}", 40 * forks);
    assert_eq!(ticks, expected);
}
