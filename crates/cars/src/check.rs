//! `cars check`: reads scenario, launch and experiment files as a run does, and runs nothing; compares the record of a run with
//! its seals.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use config::{Changes, FileError, Source};
use lab::experiment::{Experiment, Plan, Request, Robots, is_experiment_file};
use lab::folder::recorded_epochs;
use launch::{LaunchFile, is_launch_file, scenario_file};
use miette::miette;
use scenario::Scenario;
use simulator::RunFolder;
use simulator::seal::{self, Checked};
use terminal::OutputError;

use crate::experiment::equal_arms;
use crate::named;

/// `cars check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Scenario files, launch files, experiment files, and folders of runs.
    #[arg(required = true, value_parser = named::any())]
    files: Vec<PathBuf>,
}

/// Checks every file, also after an error.
pub(crate) fn check(args: &CheckArgs) -> miette::Result<ExitCode> {
    let mut are_all_good = true;
    for path in &args.files {
        match describe(path) {
            Ok(text) => {
                let line = format!("ok {}: {text}", path.display());
                // The exit status is that of all files also where a reader has seen enough of them.
                OutputError::unless_closed(terminal::print_line(line))?;
            }
            Err(error) => {
                are_all_good = false;
                terminal::note(format_args!("{error:?}"));
            }
        }
    }

    if are_all_good {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

/// The content of a file in one line.
fn describe(path: &Path) -> miette::Result<String> {
    if path.is_dir() {
        return Ok(describe_run(path)?);
    }
    if is_experiment_file(path)? {
        return describe_experiment(path);
    }
    let file: serde_json::Value = Source::read(path)?.parse()?;
    if file.as_object().is_some_and(serde_json::Map::is_empty) {
        return Err(miette!(
            "{} is empty: it is neither a scenario nor a launch file nor an experiment",
            path.display()
        ));
    }

    let changes = Changes::default();
    if !is_launch_file(path)? {
        let scenario = Scenario::load(path, &changes)?;
        return Ok(content(&scenario));
    }

    let file = LaunchFile::load(path)?;
    let scenario = file.load_scenario(&changes)?;
    file.check_robots(&scenario)?;

    let processes = count(file.processes.len(), "process", "processes");
    Ok(format!("{processes}, {}", content(&scenario)))
}

/// An experiment, every scenario of which has been read, and begun where its robots can run in this process.
fn describe_experiment(path: &Path) -> miette::Result<String> {
    let mut experiment = Experiment::load(path)?;
    experiment.scenario = scenario_file(&experiment.scenario)?;
    let plan = Plan::new(&Request {
        name: String::new(),
        experiment,
        set: Vec::new(),
        robots: Robots::InProcess,
        origin: None,
    })?;
    let needs_processes = plan.needs_processes()?;
    if needs_processes.is_none() {
        plan.check_begins()?;
    }

    let experiment = &plan.experiment;
    let arms = count(experiment.arms.len(), "arm", "arms");
    let conditions = count(plan.conditions().len(), "condition", "conditions");
    let measures = count(experiment.measures.len(), "measure", "measures");
    let seeds = experiment.seeds.len();
    let mut text = format!("{arms}, {conditions}, {seeds} seeds, {measures}");
    for (one, other) in plan.equal_arms() {
        text += &format!("; {}", equal_arms(one, other));
    }
    if let Some(reason) = needs_processes {
        text += &format!("; to be played with --processes: {reason}");
    }
    Ok(text)
}

/// The record of a run: its events, those of earlier epochs, too.
fn describe_run(folder: &Path) -> Result<String, FileError> {
    let epochs = recorded_epochs(&RunFolder::at(folder.to_owned()))?;
    let mut described = Vec::new();
    for files in epochs {
        let checked = seal::check(&files.events)?;
        let ticks = count_ticks(&checked);
        let lines = count(checked.lines, "line", "lines");
        described.push(format!("{ticks}, {lines} as written"));
    }
    Ok(described.join("; then "))
}

/// How far a run has come, and how it ended.
fn count_ticks(checked: &Checked) -> String {
    let tick = checked.tick;
    let rest = count(checked.incomplete_lines, "line", "lines");
    match (checked.end.is_some(), checked.incomplete_lines) {
        (true, _) => format!("{tick} ticks to the end"),
        (false, 0) => format!("{tick} ticks, no end"),
        (false, _) => format!("{tick} ticks, no end, {rest} of a tick that was not completed"),
    }
}

fn content(scenario: &Scenario) -> String {
    let robots = count(scenario.robots.len(), "robot", "robots");
    let guests = count(scenario.guests.count, "guest", "guests");
    format!("{robots}, {guests}, {} ticks", scenario.ticks)
}

fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}
