//! The worlds without emotions, as people would build them: nothing in the scenario or the robots is there for a measure.

use system_tests::{Lab, assert_same};

#[test]
fn a_world_is_the_same_in_one_process_and_as_processes() {
    let lab = Lab::new();
    for (world, events) in [
        (
            "auction",
            &["command_dropped", "site_changed", "blocked"][..],
        ),
        ("swarm", &["out_of_range", "REST"][..]),
    ] {
        for seed in ["1", "2", "3"] {
            let run = format!("{world}-{seed}");
            let launch = format!("{world}-{seed}-launched");
            lab.ok(&["run", world, "--run", &run, "--seed", seed]);
            lab.ok(&[
                "launch", world, "--run", &launch, "--seed", seed, "--speed", "max",
            ]);
            assert_same((&run, &lab.bytes(&run)), (&launch, &lab.bytes(&launch)));
            lab.ok(&["verify", &launch]);

            let text = String::from_utf8(lab.bytes(&run)).unwrap();
            for event in events {
                assert!(text.contains(event), "no {event} in {run}");
            }
        }
    }
}

/// Why a run of the shipped auction ended.
#[test]
fn an_auction_ends_when_all_tasks_are_done() {
    let lab = Lab::new();
    lab.ok(&["run", "auction", "--run", "auction"]);
    let text = String::from_utf8(lab.bytes("auction")).unwrap();
    assert_eq!(text.matches(r#""event":"site_changed""#).count(), 12);
    let end = text.lines().last().unwrap();
    assert!(end.contains(r#""because":"#), "{end}");
}
