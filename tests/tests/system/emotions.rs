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
    // He has been HAPPY for most of the time.
    assert!(
        felt.lines().any(|line| line == ">     positive mood"),
        "{felt}"
    );
    let happy = lab.ok(&["emotions", "Leguin", "--at", "hall@1200"]);
    assert_eq!(happy.matches("positive affect").count(), 1, "{happy}");
    assert!(happy.contains("\n>     positive mood\n"), "{happy}");
    for name in [
        "mood",
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
            "has no tick 999: its last one is 10",
        ),
        (&["emotions", "--at", "hall"], "RUN@TICK"),
    ] {
        let (_, text) = lab.fails(args);
        let words: Vec<&str> = text.split_whitespace().collect();
        let text = words.join(" ").replace("│ ", "");
        assert!(text.contains(expected), "{text}");
    }
}

/// A robot's mood at the end of a run, and the one with which its record says that it began.
fn moods(lab: &Lab, run: &str, robot: &str) -> [f64; 2] {
    let folder = lab.out().join(run);
    let summary = std::fs::read_to_string(folder.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let scenario = std::fs::read_to_string(folder.join("scenario.toml")).unwrap();
    let scenario: toml::Value = toml::from_str(&scenario).unwrap();
    let robots = scenario["robot"].as_array().unwrap();
    let spec = robots
        .iter()
        .find(|spec| spec["name"].as_str() == Some(robot));
    let start = spec.and_then(|spec| spec["params"]["mood"].get("start"));

    [
        summary["robots"][robot]["state_variables"]["mood"]
            .as_f64()
            .unwrap(),
        start.and_then(toml::Value::as_float).unwrap_or(0.0),
    ]
}

#[test]
fn a_mood_is_carried_over_to_the_next_run_which_depends_on_no_other_record() {
    let lab = Lab::new();
    let museum = [
        "run",
        "configs/museum.toml",
        "-q",
        "--set",
        "expect=[]",
        "--run",
    ];
    lab.ok(&[&museum[..], &["morning"]].concat());
    // The run is looked for where `--out` puts runs.
    let from = "robot.*.params.mood.from=morning";
    lab.ok(&[&museum[..], &["noon", "--set", from]].concat());

    for robot in ["Butler", "Leguin"] {
        let [morning, start] = moods(&lab, "morning", robot);
        assert_eq!(start, 0.0);
        let [noon, start] = moods(&lab, "noon", robot);
        assert_eq!(start, morning, "{robot}");
        assert!(
            noon > morning && morning > 0.0,
            "{robot}: {morning}, {noon}"
        );
    }

    std::fs::remove_dir_all(lab.out().join("morning")).unwrap();
    lab.ok(&["verify", "noon"]);
    let (_, text) = lab.fails(&[&museum[..], &["night", "--set", from]].concat());
    assert!(text.contains("there is no run"), "{text}");
}

#[test]
fn a_change_that_takes_beliefs_away_takes_their_emotions_too() {
    let lab = Lab::new();
    let off = "change=[{ at = \"100 s\", set = [\"robot.*.params.deliberation.beliefs=off\"] }]";
    let pantry = [
        "run",
        "configs/pantry.toml",
        "-q",
        "--set",
        "expect=[]",
        "--set",
        off,
    ];
    lab.ok(&[
        &pantry[..],
        &["--seed", "4", "--duration", "200 s", "--run", "off"],
    ]
    .concat());

    let mut before = 0;
    for tick in lab.recorded("off") {
        for report in tick.reports.values() {
            let is_of_belief = matches!(report.emotion_state.as_str(), "DISCOURAGED" | "HOPEFUL");
            if tick.tick() < 200 {
                before += usize::from(is_of_belief);
            } else {
                assert!(!is_of_belief, "tick {}", tick.tick());
                assert!(report.state_variables.get("belief").is_none());
            }
        }
    }
    assert!(before > 0, "a robot was DISCOURAGED before");
    lab.ok(&["verify", "off"]);
}
