//! `cars check`: reads files of every kind (`kind.rs`) as the commands do that take them, and runs nothing; compares the record of a run with
//! its seals.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use config::{Changes, Source};
use experiments::{Experiment, Plan, Request, Robots};
use lab::inspect::inspect;
use lab::run::Local;
use launch::{LaunchFile, default_run_name, scenario_file};
use protocol::RunName;
use record::RunFolder;
use record::seal::Checked;
use scenario::{Scenario, roster};
use terminal::OutputError;

use crate::errors::{Context, Result, refusal, render};
use crate::experiment::equal_arms;
use crate::kind::{FileKind, class_of};
use crate::{named, remarks};

/// `cars check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Scenarios, launch files, experiments, plans of faults of links, parameters of robots, rosters, and folders of runs.
    #[arg(required = true, value_parser = named::any())]
    files: Vec<PathBuf>,
}

/// Checks every file, also after an error.
pub(crate) fn check(args: &CheckArgs) -> Result<ExitCode> {
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
                terminal::note(render(error.as_ref()));
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
fn describe(path: &Path) -> Result<String> {
    if path.is_dir() {
        return describe_run(path);
    }
    let kind = FileKind::of(path)?;
    if matches!(kind, FileKind::Launch | FileKind::Scenario) {
        // As `cars run` and `cars launch` name it.
        default_run_name(path)?;
    }

    match kind {
        FileKind::Experiment => describe_experiment(path),
        FileKind::Launch => describe_launch(path),
        FileKind::Links => {
            let faults = netem::FaultPlan::check(path)?;
            Ok(count(faults, "fault of a link", "faults of links"))
        }
        FileKind::Parameters => describe_parameters(path),
        FileKind::Roster => describe_roster(path),
        FileKind::Scenario => {
            let changes = Changes::default();
            let scenario = Scenario::load(path, &changes)?;
            remarks::show(path, &changes);
            Ok(content(&scenario))
        }
    }
}

fn describe_launch(path: &Path) -> Result<String> {
    let changes = Changes::default();
    let (file, scenario) = LaunchFile::load_with_scenario(path, &changes)?;
    remarks::show(&file.scenario, &changes);
    remarks::show_all(file.remarks(&scenario));

    let processes = count(file.processes.len(), "process", "processes");
    Ok(format!("{processes}, {}", content(&scenario)))
}

/// The parameters of a robot. Where its class comes with the programs, a robot of it takes them.
fn describe_parameters(path: &Path) -> Result<String> {
    let source = Source::read(path)?;
    let table: toml::Table = source.parse()?;
    let number = count(table.len(), "parameter", "parameters");

    let Some(class) = class_of(path) else {
        return Ok(format!(
            "{number}, for a class that decides about them itself"
        ));
    };

    let scenario = Scenario::parse(&scenario_with(class, path), Path::new(""))?;
    let run = RunName::new("check")?;
    let mut local = Local::new(scenario, &run)?;
    local
        .simulation
        .init(&mut local.robots)
        .context(path.display().to_string())?;
    Ok(format!("{number}, which {class} takes"))
}

/// A scenario with a robot of each class; one has the parameters of a file.
fn scenario_with(class: &str, parameters: &Path) -> Source {
    let parameters = std::path::absolute(parameters).unwrap_or_else(|_| parameters.to_owned());
    let parameters = toml::Value::from(parameters.display().to_string());
    let mut text = String::new();
    for (index, name) in robots::CLASSES.iter().enumerate() {
        text += &format!(
            "[[robot]]\nname = \"{name}\"\nat = [\"{} m\", \"5 m\"]\n",
            2 + 2 * index
        );
        if *name == class {
            text += &format!("params_from = {parameters}\n");
        }
    }

    Source {
        name: "a scenario with these parameters".to_owned(),
        text,
    }
}

/// A roster, as `cars launch --roster` takes it.
fn describe_roster(path: &Path) -> Result<String> {
    let roster = Source::read(path)?;
    let scenario = Scenario::parse(&roster::scenario_of(&roster)?, Path::new(""))?;
    Ok(format!("a roster: {}", content(&scenario)))
}

/// An experiment, every scenario of which has been read, and begun where its robots can run in this process.
fn describe_experiment(path: &Path) -> Result<String> {
    let mut experiment = Experiment::load(path)?;
    experiment.scenario = scenario_file(&experiment.scenario)?;
    let plan = Plan::new(&Request {
        name: String::new(),
        experiment,
        set: Vec::new(),
        robots: Robots::InProcess,
        own: None,
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

/// The record of a run, read whole: all that is damaged is the error.
fn describe_run(folder: &Path) -> Result<String> {
    let mut inspection = inspect(&RunFolder::at(folder.to_owned()))?;
    if inspection.damages.len() == 1
        && let Some(damage) = inspection.damages.pop()
    {
        return Err(damage.into());
    }
    if !inspection.damages.is_empty() {
        let mut damages = Vec::new();
        for damage in &inspection.damages {
            damages.push(damage.to_string());
        }
        return Err(refusal!("{}", damages.join("\n")));
    }

    let mut described = Vec::new();
    for checked in &inspection.epochs {
        let ticks = count_ticks(checked);
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
