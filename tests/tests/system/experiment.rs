//! `cars experiment`: what an experiment plays, and that its results do not depend on who plays it, when, and how often it is
//! interrupted.

mod folder;
mod kinds;
mod numbers;
mod refused;
mod states;
mod teams;
mod verdicts;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use system_tests::{programs, root};

const HALL: &str = "configs/hors_doeuvres.toml";

/// `cars experiment` in the project's root.
fn command(args: &[&str]) -> Command {
    let mut command = Command::new(programs().join("cars"));
    command
        .current_dir(root())
        .arg("experiment")
        .args(args)
        .stdin(Stdio::null())
        .env_remove("CARS_RUN")
        .env_remove("CARS_CONNECT");
    command
}

/// Runs `cars experiment`; returns its exit status and what it prints for people.
fn cars(args: &[&str]) -> (i32, String) {
    let output = command(args).output().unwrap();
    (output.status.code().unwrap_or(-1), notes(&output))
}

/// Runs `cars experiment`, which must succeed; returns what it prints for people.
fn ok(args: &[&str]) -> String {
    let (code, notes) = cars(args);
    assert_eq!(code, 0, "{args:?}: {notes}");
    notes
}

/// Plays an experiment; returns what it prints as JSON.
fn json(args: &[&str]) -> Value {
    let args = [args, &["--json"]].concat();
    let output = command(&args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", notes(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The standard error of a program in one line.
fn notes(output: &Output) -> String {
    in_one_line(&String::from_utf8_lossy(&output.stderr))
}

/// A text without the line breaks of a terminal and the bars at the beginnings of lines.
fn in_one_line(text: &str) -> String {
    let words = text.split_whitespace().filter(|word| *word != "│");
    words.collect::<Vec<_>>().join(" ")
}

/// Asserts that two folders have the same results, byte for byte.
fn assert_same_results(one: &Path, other: &Path) {
    for name in ["plan.json", "experiment.toml", "runs.csv", "results.json"] {
        let bytes = |folder: &Path| fs::read(folder.join(name)).unwrap();
        assert!(
            bytes(one) == bytes(other),
            "{name} of {} and {} differ",
            one.display(),
            other.display()
        );
    }
}

/// The fields of a line of CSV without line breaks in its fields.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut is_quoted = false;
    for c in line.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => fields.push(String::new()),
            c => fields.last_mut().unwrap().push(c),
        }
    }
    fields
}

/// The rows of a table in CSV, by the heads of their columns.
fn rows(folder: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let text = fs::read_to_string(folder.join("runs.csv")).unwrap();
    let mut lines = text.lines();
    let head = fields(lines.next().unwrap());
    let mut rows = Vec::new();
    for line in lines {
        let fields = fields(line);
        assert_eq!(fields.len(), head.len(), "{line}");
        let row = head.iter().zip(fields);
        rows.push(row.map(|(name, field)| (name.clone(), field)).collect());
    }
    rows
}

/// The files of units in the folder of an experiment.
fn files_of_units(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder.join("units")).into_iter().flatten() {
        files.push(entry.unwrap().path());
    }
    files.sort();
    files
}

/// The text of an experiment that ships with the project, whose scenario is found from any folder.
fn shipped(name: &str) -> String {
    let text = fs::read_to_string(root().join("configs/experiments").join(name)).unwrap();
    let scenario = format!("scenario = {:?}", root().join(HALL));
    let with = text.replace("scenario = \"../hors_doeuvres.toml\"", &scenario);
    assert_ne!(text, with);
    with
}

/// An experiment in which a team shows the emotions of the next run, with a crash as one condition.
fn yoked() -> String {
    let scenario = root().join(HALL);
    format!(
        r#"
question = "Are the emotions those of the next seed?"
procedure = "A crash."
scenario = {scenario:?}
seeds = 8
duration = "120 s"
baseline = "emotions"

[[condition]]
name = "none"
what = "no failure"
set = []

[[condition]]
name = "crash"
what = "Leguin crashes"
from = "40 s"
until = "70 s"
set = [
    'fault=[{{ robot = "Leguin", do = "crash", at = "{{from}}", until = "{{until}}" }}]',
    "on_late=continue",
]

[[arm]]
name = "emotions"
what = "own emotions"
set = []

[[arm]]
name = "yoked"
what = "emotions of the next seed"
yoked_to = "emotions"
set = []

[[measure]]
name = "served"
column = "served"
contrast = true
summary = "robots.Butler.state_variables.served"

[[measure]]
name = "happy_s"
summary = "robots.*.emotions_s.HAPPY"

[[measure]]
name = "missed"
summary = "robots.Leguin.missed"

[[measure]]
name = "deadlock"
column = "deadlock"
contrast = true
stalled = {{ progress = ["Butler.served", "Leguin.trips"], for = "20 s" }}
"#
    )
}
