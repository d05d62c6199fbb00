//! Measures of teams and places, and of runs that end early, through whole experiments.

use std::fs;

use serde_json::Value;
use system_tests::Lab;

use super::{cars, ok, root};

/// The rows of the table of units: values by the head of their column.
fn rows(lab: &Lab, folder: &str) -> Vec<Vec<(String, String)>> {
    let text = fs::read_to_string(lab.out().join(folder).join("runs.csv")).unwrap();
    let mut lines = text.lines();
    let heads: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut rows = Vec::new();
    for line in lines {
        let cells = heads.iter().zip(line.split(','));
        rows.push(
            cells
                .map(|(head, cell)| ((*head).to_owned(), cell.to_owned()))
                .collect(),
        );
    }
    rows
}

fn cell<'a>(row: &'a [(String, String)], head: &str) -> &'a str {
    let (_, cell) = row.iter().find(|(known, _)| known == head).unwrap();
    cell
}

#[test]
fn all_kinds_of_measures_of_teams_have_numbers() {
    let lab = Lab::new();
    let out = lab.out().join("teams");
    let out = out.to_str().unwrap();
    ok(&[
        "run",
        "configs/experiments/teams.toml",
        "--seeds",
        "2",
        "--out",
        out,
    ]);

    let rows = rows(&lab, "teams");
    assert_eq!(rows.len(), 4);
    for row in &rows {
        let number = |head: &str| cell(row, head).parse::<f64>().unwrap();
        assert!(number("distance") > 10.0);
        assert!(
            (number("served_per_meter") - number("served") / (number("distance") + 1.0)).abs()
                < 1e-9
        );
        assert!((0.0..=1.0).contains(&number("covered")));
        assert!((1.0..=3.0).contains(&number("components")));
        assert!((0.0..=60.0).contains(&number("at_the_table")));
        // Bodies are 2 ft wide, and do not overlap.
        assert!(number("nearest") >= 0.6);
        // A third if one of the three has walked alone.
        assert!((0.333..=1.0).contains(&number("fairness_of_distances")));
    }
}

/// An experiment whose runs end when Butler has served three guests.
fn early(end_when: &str) -> String {
    let scenario = root().join("configs/hors_doeuvres.toml");
    format!(
        r#"
question = "When are three served?"
scenario = {scenario:?}
duration = "300 s"
seeds = 2

[[arm]]
name = "one"
set = [{end_when:?}]

[[measure]]
name = "three"
time = {{ to = {{ robot = "Butler", variable = "served", at_least = 3 }} }}

[[measure]]
name = "lost"
time = {{ to = {{ event = "lost", robot = "Butler" }} }}
"#
    )
}

#[test]
fn times_are_censored_at_the_planned_end_of_runs_that_end_early() {
    let lab = Lab::new();
    let end_when = r#"end_when={ robot = "Butler", variable = "served", at_least = 3 }"#;
    let file = lab.write("early.toml", &early(end_when));
    let out = lab.out().join("early");
    ok(&[
        "run",
        file.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);

    for row in rows(&lab, "early") {
        assert_eq!(cell(&row, "three_state"), "reached");
        assert!(cell(&row, "three").parse::<f64>().unwrap() < 300.0);
        assert_eq!(cell(&row, "lost_state"), "not reached");
        assert_eq!(cell(&row, "lost").parse::<f64>().unwrap(), 300.0);
    }
    let results = fs::read_to_string(out.join("results.json")).unwrap();
    let _results: Value = serde_json::from_str(&results).unwrap();
}

#[test]
fn numbers_that_no_run_has_are_refused_with_their_place() {
    let lab = Lab::new();
    let text = early("network.commands.loss=0.1").replace(
        r#"{ event = "lost", robot = "Butler" }"#,
        r#"{ covered = { robots = "S*", radius = "1 m", cell = "1 m" }, above = 1 }"#,
    );
    let file = lab.write("wrong.toml", &text);
    let (code, said) = cars(&["run", file.to_str().unwrap()]);
    assert_ne!(code, 0);
    assert!(
        said.contains("no robot \"S*\"") && said.contains("wrong.toml:"),
        "{said}"
    );
}
