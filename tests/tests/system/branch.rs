//! Branches of runs in memory, and runs that are re-seeded.

use std::path::PathBuf;
use std::sync::Arc;

use lab::branch::{Branch, Trunk};
use lab::folder::recorded_epoch;
use lab::run::{execute, project_robots};
use protocol::Event;
use record::RunFolder;
use scenario::{Changes, Scenario};
use system_tests::root;

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
        for tick in [0, 7, scenario.ticks / 2] {
            trunk.go_to(tick).unwrap();
            let mut branch = trunk.snapshot().unwrap().into_branch().unwrap();
            branch.play().unwrap();
            assert_eq!(branch.digest(), summary.digest, "{name} after tick {tick}");
        }
        trunk.go_to(trunk.last()).unwrap();
        assert!(trunk.into_branch().unwrap().step().unwrap().is_some());
    }
}
