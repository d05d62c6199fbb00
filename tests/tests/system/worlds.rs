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

/// CBAA knows no robot that crashes: what it has bid for stays its own, unless bids have to be renewed.
#[test]
fn tasks_of_a_robot_that_crashes_are_done_by_others_where_bids_have_a_lease() {
    let lab = Lab::new();
    for (lease, ends) in [("", false), ("5 s", true)] {
        for sends in ["periodically", "on_change"] {
            let run = format!("{sends}{}", lease.len());
            let mut set = vec![
                "on_late=continue".to_owned(),
                r#"fault=[{ robot = "B1", do = "crash", at = "2 s" }]"#.to_owned(),
                format!("robot.B*.params.sends={sends}"),
            ];
            if ends {
                set.push(format!("robot.B*.params.lease={lease}"));
            }
            let mut arguments = vec!["run", "auction", "--run", &run, "--seed", "3"];
            for change in &set {
                arguments.extend(["--set", change]);
            }
            lab.ok(&arguments);
            let text = String::from_utf8(lab.bytes(&run)).unwrap();
            let done = text.matches(r#""event":"site_changed""#).count();
            assert_eq!(done == 12, ends, "{run}: {done} tasks");
        }
    }
}
