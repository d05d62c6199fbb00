//! A robot that is played from its record while the others live.

use std::path::Path;

use system_tests::{Lab, assert_same};

const HALL: &str = "launch/hors_doeuvres.toml";
const SCENARIO: &str = "configs/hors_doeuvres.toml";

fn launch(lab: &Lab, run: &str, args: &[&str]) {
    let all = [
        "launch",
        HALL,
        "--no-console",
        "--speed",
        "max",
        "--run",
        run,
    ];
    lab.ok(&[&all[..], args].concat());
}

/// Where a robot wanted to be, tick by tick.
fn proposals(lab: &Lab, run: &str, robot: &str) -> Vec<(f64, f64)> {
    let mut proposals = Vec::new();
    for tick in lab.recorded(run) {
        let report = tick.reports.iter().find(|(name, _)| name.as_str() == robot);
        let (_, report) = report.expect("it has reported");
        proposals.push((report.proposal.x, report.proposal.y));
    }
    proposals
}

#[test]
fn a_robot_that_is_played_from_its_record_repeats_its_part() {
    let lab = Lab::new();
    lab.ok(&["run", SCENARIO, "--run", "lived", "--duration", "60 s"]);
    launch(
        &lab,
        "replayed",
        &["--duration", "60 s", "--replay-robot", "Leguin=lived"],
    );

    assert_same(
        ("lived", &lab.bytes("lived")),
        ("replayed", &lab.bytes("replayed")),
    );
    let said = lab.ok(&["verify", "replayed"]);
    assert!(said.contains("the same, 120 ticks to the end"), "{said}");
    assert!(said.contains("Leguin could not be executed"), "{said}");
    let said = lab.ok(&["verify", "replayed", "--processes"]);
    assert!(said.contains("the same as processes, 120 ticks"), "{said}");
}

#[test]
fn the_others_live_and_after_its_record_it_stays() {
    let lab = Lab::new();
    lab.ok(&["run", SCENARIO, "--run", "lived", "--duration", "40 s"]);
    // Under another name than the default one, which would overwrite the record.
    let mut args = vec!["--duration", "60 s", "--replay-robot", "Leguin=latest"];
    args.extend(["--set", "robot.Butler.params.policy=rules"]);
    launch(&lab, "other", &args);

    let lived = proposals(&lab, "lived", "Leguin");
    let played = proposals(&lab, "other", "Leguin");
    assert_eq!(lived[..], played[..lived.len()]);
    let butler = proposals(&lab, "lived", "Butler");
    assert_ne!(
        butler[..],
        proposals(&lab, "other", "Butler")[..butler.len()]
    );

    let recorded = lab.recorded("other");
    let after: Vec<_> = recorded[lived.len()..]
        .iter()
        .map(|tick| {
            let (_, report) = tick
                .reports
                .iter()
                .find(|(name, _)| name.as_str() == "Leguin")
                .expect("it has reported");
            (report.speed_mps, report.behavior_state.clone())
        })
        .collect();
    assert_eq!(after.len(), 40);
    assert!(after.iter().all(|(speed_mps, behavior)| {
        *speed_mps == 0.0 && *behavior == after[0].1 && !behavior.is_empty()
    }));
}

#[test]
fn a_record_that_does_not_fit_is_refused_before_anything_starts() {
    let lab = Lab::new();
    let short = ["--duration", "5 s", "-q"];
    lab.ok(&[&["run", SCENARIO, "--run", "lived"], &short[..]].concat());
    let unrecorded = [
        "run",
        SCENARIO,
        "--run",
        "unrecorded",
        "--set",
        "record.frames=false",
    ];
    lab.ok(&[&unrecorded[..], &short].concat());
    let before = lab.bytes("lived");

    for (run, replayed, reason) in [
        ("new", "Leguin", "is not of the form ROBOT=RUN"),
        ("new", "Leguin=nobody", "there is no run nobody"),
        ("new", "Vonda=lived", "has no robot Vonda"),
        (
            "new",
            "Leguin=unrecorded",
            "what Leguin reported is unknown",
        ),
        ("lived", "Leguin=lived", "the launch would overwrite"),
    ] {
        let args = ["launch", HALL, "--run", run, "--replay-robot", replayed];
        let (_, said) = lab.fails(&args);
        let words: Vec<&str> = said
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect();
        let said = words.join(" ");
        assert!(said.contains(reason), "{replayed}: {said}");
    }
    assert_same(("before", &before), ("after", &lab.bytes("lived")));
    assert!(!Path::new(&lab.out().join("new")).exists());
}
