//! What experiments show of the teams, and what they do for yoked ones.

use std::collections::BTreeSet;
use std::os::unix::fs::symlink;

use serde_json::Value;
use system_tests::{Lab, root};

use super::{json, shipped, yoked};

#[test]
fn a_yoked_team_shows_the_emotions_of_the_next_seed_for_any_number_of_jobs() {
    let lab = Lab::new();
    let file = lab.write("yoked.toml", &yoked());
    let play = |jobs: &str| {
        let out = lab.out().join(jobs);
        let args = [
            "run",
            file.to_str().unwrap(),
            "--jobs",
            jobs,
            "-o",
            out.to_str().unwrap(),
        ];
        json(&args)
    };
    let all = play("1");
    assert!(all == play("3"));

    let runs = all["runs"].as_array().unwrap();
    let run = |condition: &str, arm: &str, seed: u64| {
        let mut found = runs.iter().filter(|run| {
            run["condition"] == condition && run["arm"] == arm && run["seed"] == seed
        });
        found.next().unwrap()
    };
    for condition in ["none", "crash"] {
        for seed in 1..=8 {
            let next = seed % 8 + 1;
            let yoked = run(condition, "yoked", seed);
            let other = run(condition, "emotions", next);
            let happy = |run: &Value| run["measures"]["happy_s"].clone();
            assert_eq!(yoked["yoked_to_seed"], next);
            assert_eq!(happy(yoked), happy(other), "{condition}, {seed}");
            assert_ne!(yoked["digest"], other["digest"]);
        }
    }

    let missed = |condition| {
        let run = run(condition, "emotions", 1);
        run["measures"]["missed"]["value"].as_f64().unwrap()
    };
    assert_eq!(missed("none"), 0.0);
    assert_eq!(missed("crash"), 60.0);
}

#[test]
fn every_line_of_an_experiment_has_its_difference_to_the_baseline() {
    let lab = Lab::new();
    let file = lab.write("yoked.toml", &yoked());
    let out = lab.out().join("results");
    let out = out.to_str().unwrap();
    let all = json(&["run", file.to_str().unwrap(), "--seeds", "9", "-o", out]);

    let served = |one: &&Value| one["measure"] == "served";
    let contrasts = all["contrasts"].as_array().unwrap();
    let contrasts: Vec<&Value> = contrasts.iter().filter(served).collect();
    assert_eq!(contrasts.len(), 2);
    let crash = contrasts[1];
    assert_eq!(crash["condition"], "crash");
    assert_eq!(crash["arm"], "yoked");
    assert_eq!(crash["n"], 9);
    let mean = |arm| mean_of(&all, "crash", arm, "served");
    let difference = mean("yoked") - mean("emotions");
    let found = crash["mean"]["value"].as_f64().unwrap();
    assert!((found - difference).abs() < 1e-9);
}

/// The mean of a measure over the runs of an arm under a condition.
fn mean_of(all: &Value, condition: &str, arm: &str, measure: &str) -> f64 {
    let mut cells = all["estimates"].as_array().unwrap().iter();
    let cell = cells.find(|cell| {
        cell["condition"] == condition && cell["arm"] == arm && cell["measure"] == measure
    });
    cell.unwrap()["mean"]["value"].as_f64().unwrap()
}

/// Plays a shipped experiment with other values of its factor, and returns the means by condition, arm and measure.
fn means(name: &str, change: (&str, &str), args: &[&str]) -> impl Fn(&str, &str, &str) -> f64 {
    let lab = Lab::new();
    let text = shipped(name);
    let (from, to) = change;
    assert!(text.contains(from));
    let file = lab.write(name, &text.replace(from, to));
    let out = lab.out().join("results");
    let fixed = [
        "run",
        file.to_str().unwrap(),
        "--seeds",
        "8",
        "-o",
        out.to_str().unwrap(),
    ];
    let all = json(&[&fixed, args].concat());

    move |condition, arm, measure| mean_of(&all, condition, arm, measure)
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn where_all_commands_are_lost_a_team_that_can_intercept_works_on() {
    let values = ("values = [0.0, 0.1, 0.25, 0.5, 1.0]", "values = [0.0, 1.0]");
    let mean = means("deadlock.toml", values, &["--duration", "200 s"]);

    // Every command lost: a team that only calls never gets treats; one that can intercept does, whatever decides about it.
    assert!(mean("1", "neither", "exchanges") < 1.0);
    for arm in ["emotions", "rules", "timer"] {
        let found = mean("1", arm, "exchanges");
        assert!(found > 1.0, "{arm}: {found}");
    }
    assert!(mean("0", "neither", "exchanges") > 1.5);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn with_emotions_the_team_works_on_while_it_is_cut_off_and_recovers() {
    let values = (
        "values = [\"0 s\", \"60 s\", \"120 s\", \"240 s\"]",
        "values = [\"0 s\", \"240 s\"]",
    );
    let mean = means("partition.toml", values, &[]);
    let uncut = mean("0 s", "neither", "after");
    let without = mean("240 s", "neither", "after");
    let with = mean("240 s", "emotions", "after");
    println!(
        "exchanges after 120 s uncut, without emotions: {uncut}; after a cut of 240 s: {without} without, {with} with"
    );

    // One lost call is the end for a team that calls once.
    assert!(with > 2.0 * without && with > 4.0, "{with} {without}");
    assert!(mean("240 s", "emotions", "during") > mean("240 s", "neither", "during") + 1.0);
}

/// The file at the top of the page about experiment files, pasted into the folder of the project, with two seeds.
#[test]
fn the_file_of_the_page_is_played_as_it_is_pasted() {
    let lab = Lab::new();
    symlink(root().join("configs"), lab.out().join("configs")).unwrap();
    let page = std::fs::read_to_string(root().join("docs/experiment-files.md")).unwrap();
    let text = page.split("```").nth(1).unwrap();
    let text = text.strip_prefix("toml\n").unwrap();
    assert!(text.contains("seeds = 16\n"));
    let file = lab.write("my.toml", &text.replace("seeds = 16\n", "seeds = 2\n"));
    let file = file.to_str().unwrap();

    let (code, text) = lab.cars_without_out(&["check", file]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("2 arms, 4 conditions, 2 seeds"), "{text}");

    let out = lab.out().join("my");
    let all = json(&["run", file, "-o", out.to_str().unwrap()]);
    let runs = all["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 16);
    let mut conditions = BTreeSet::new();
    for run in runs {
        let served = run["measures"]["served"]["value"].as_f64();
        assert!(served.unwrap() > 0.0, "{run}");
        conditions.insert(run["condition"].as_str().unwrap());
    }
    let expected = [
        "guests 150, loss 0",
        "guests 150, loss 0.5",
        "guests 50, loss 0",
        "guests 50, loss 0.5",
    ];
    assert_eq!(conditions, BTreeSet::from(expected));
}
