//! Runs that end when something holds: the same in one process and as processes, again, and as forks.

use system_tests::processes::nobody_is_left;
use system_tests::{Lab, assert_same};

const HALL: &str = "launch/hors_doeuvres.toml";
const SCENARIO: &str = "configs/hors_doeuvres.toml";
/// Holds before the hall's 600 s are over.
const SERVED: &str = r#"end_when={ robot = "Butler", variable = "served", at_least = 4 }"#;
const BECAUSE: &str = "`served` of Butler is 4";

fn last(lab: &Lab, run: &str) -> serde_json::Value {
    lab.events(run).pop().unwrap()
}

#[test]
fn a_run_ends_when_the_condition_holds_in_one_process_and_as_processes() {
    let lab = Lab::new();
    let said = lab.ok(&["run", SCENARIO, "--run", "local", "--set", SERVED]);
    assert!(said.contains(&format!("ended because {BECAUSE}")), "{said}");

    let end = last(&lab, "local");
    assert_eq!(end["event"], "end");
    assert_eq!(end["reason"], "finished");
    assert_eq!(end["because"], BECAUSE);
    let summary = lab.summary("local");
    assert_eq!(summary["end_because"], BECAUSE);
    let ticks = summary["ticks"].as_u64().unwrap();
    assert!(ticks < 1200, "{ticks} ticks");
    assert_eq!(end["tick"], ticks);
    assert_eq!(
        summary["robots"]["Butler"]["state_variables"]["served"],
        4.0
    );

    let launch = ["launch", HALL, "--no-console", "--speed", "max"];
    lab.ok(&[&launch[..], &["--run", "launched", "--set", SERVED]].concat());
    nobody_is_left("launched");
    assert_same(
        ("run", &lab.bytes("local")),
        ("launch", &lab.bytes("launched")),
    );

    for run in ["local", "launched"] {
        let said = lab.ok(&["verify", run]);
        assert!(
            said.contains(&format!("{ticks} ticks to the end")),
            "{said}"
        );
    }
}

#[test]
fn a_fork_ends_by_the_condition_of_its_parent_or_by_another_one() {
    let lab = Lab::new();
    lab.ok(&["run", SCENARIO, "--run", "parent", "--set", SERVED, "-q"]);
    let ticks = lab.summary("parent")["ticks"].as_u64().unwrap();

    let earlier = format!("parent@{}", ticks - 5);
    lab.ok(&["fork", &earlier, "--run", "same", "-q"]);
    assert_same(
        ("the run", &lab.bytes("parent")),
        ("the fork", &lab.bytes("same")),
    );

    let at_end = format!("parent@{ticks}");
    let (_, said) = lab.fails(&["fork", &at_end, "--run", "none"]);
    assert!(said.contains("by its `end_when`"), "{said}");
    let more = SERVED.replace('4', "8");
    lab.ok(&["fork", &at_end, "--run", "more", "--set", &more, "-q"]);
    let because = last(&lab, "more")["because"].to_string();
    let served = because.split("Butler is ").nth(1).unwrap();
    let served: u32 = served.trim_end_matches('"').parse().unwrap();
    assert!(served >= 8, "{because}");
    let said = lab.ok(&["verify", "more"]);
    assert!(said.contains("to the end"), "{said}");
}
