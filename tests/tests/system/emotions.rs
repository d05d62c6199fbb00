//! `cars emotions`: the tree of a robot's emotions, and what it feels in a tick of a run.

use system_tests::Lab;

const HALL: &str = "configs/hors_doeuvres.toml";

#[test]
fn the_tree_has_components_marks_and_what_is_inherited() {
    let lab = Lab::new();
    let tree = lab.ok(&["emotions", "Butler"]);
    assert!(
        tree.lines().all(|line| line.chars().count() <= 80),
        "{tree}"
    );

    let words: Vec<&str> = tree.split_whitespace().collect();
    let tree = words.join(" ");
    for part in [
        "personality (personality) traits caution [D: S]",
        "negative mood (mood) parent negative affect [D: S] duration days [D: S]",
        "CONCERNED (emotion) parent negative emotion [I]; that negative progress leads here [D: S]",
        "action_tendency monitor-progress-closely [D: S, Table 2]",
        "from negative affect valence negative",
    ] {
        assert!(tree.contains(part), "{part}: {tree}");
    }
    lab.ok(&["emotions", "Vonda"]);
    lab.ok(&["emotions", "--scenario", HALL]);
}

#[test]
fn a_moment_of_a_run_has_its_place_in_the_tree_and_all_components() {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "-q", "--run", "hall", "--set", "expect=[]"]);
    let felt = lab.ok(&["emotions", "Butler", "--at", "hall@31s"]);

    assert!(
        felt.starts_with("Butler at 31.0 s (tick 62) of hall"),
        "{felt}"
    );
    assert!(
        felt.lines().all(|line| line.chars().count() <= 80),
        "{felt}"
    );
    let is_marked = |line: &str| line.starts_with("> ") && line.ends_with("CONCERNED");
    assert_eq!(
        felt.lines().filter(|line| is_marked(line)).count(),
        1,
        "{felt}"
    );
    for name in [
        "valence",
        "intensity",
        "duration",
        "duration_s",
        "focality",
        "agency",
        "novelty",
        "controllability",
        "modifiability",
        "certainty",
        "external_norms",
        "internal_standards",
        "caution",
        "goal",
    ] {
        let begin = format!("  {name} ");
        assert!(
            felt.lines().any(|line| line.starts_with(&begin)),
            "{name}: {felt}"
        );
    }
    assert!(
        lab.ok(&["emotions", "--at", "hall@31s"])
            .contains("Leguin at 31.0 s")
    );
}

#[test]
fn what_is_unknown_is_refused_with_what_there_is() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        HALL,
        "-q",
        "--run",
        "hall",
        "--set",
        "expect=[]",
        "--duration",
        "5 s",
    ]);
    for (args, expected) in [
        (
            &["emotions", "Bob"][..],
            "Bob is neither a robot of the scenario",
        ),
        (
            &["emotions", "Bob", "--at", "hall@1"],
            "no robot called Bob reported in tick 1",
        ),
        (
            &["emotions", "--at", "hall@999"],
            "has no tick 999; it has 11",
        ),
        (&["emotions", "--at", "hall"], "RUN@TICK"),
    ] {
        let (_, text) = lab.fails(args);
        let words: Vec<&str> = text.split_whitespace().collect();
        let text = words.join(" ").replace("│ ", "");
        assert!(text.contains(expected), "{text}");
    }
}
