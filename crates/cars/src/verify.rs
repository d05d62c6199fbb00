//! `cars verify` and `cars diff`: recorded runs, executed again and compared.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use config::Speed;
use config::units::Time;
use lab::diff::{Comparison, compare};
use lab::folder::{find, recorded_epoch, recorded_epochs};
use lab::scratch::Scratch;
use lab::verify::{Verification, verify as verify_epoch};
use launch::{Launch, LaunchOptions, RunOptions};
use protocol::{Event, RobotName};
use record::difference::Difference;
use record::{EpochFiles, IfTaken, RunFolder};
use record::{Record, RecordError};
use terminal::OutputError;

use crate::errors::{Result, refusal};

/// How long a process may take to exit before it is killed, seconds.
const GRACE_S: f64 = 3.0;

/// `cars verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// Name of the run, or its folder.
    run: PathBuf,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Start its processes again as they were launched, instead of executing it in this process.
    #[arg(long)]
    processes: bool,
}

/// `cars diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// Name of a run, or its folder.
    one: PathBuf,
    /// Name of the run that is compared with it, or its folder.
    other: PathBuf,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Executes a run again and compares it with its record.
pub(crate) fn verify(args: &VerifyArgs) -> Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let epochs = recorded_epochs(&folder)?;
    let last = epochs.len();
    if args.processes {
        return verify_processes(&folder, &epochs);
    }

    for (number, files) in (1..).zip(&epochs) {
        let verification = verify_epoch(files)?;
        let mut text = String::new();
        if last > 1 {
            text += &format!("epoch {}: ", files.epoch);
        }
        text += &describe(&verification, number < last);
        OutputError::unless_closed(terminal::print_line(text))?;
        if verification.difference.is_some() {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Launches a run once more, in a temporary folder, and compares.
fn verify_processes(folder: &RunFolder, epochs: &[EpochFiles]) -> Result<ExitCode> {
    let [files] = epochs else {
        return Err(refusal!(
            help = "`cars verify` without --processes executes each of them",
            "the run has several epochs, which were begun by hand"
        ));
    };
    if let Some(input) = input_of_chance(files)? {
        return Err(refusal!(
            help = "`cars verify` without --processes takes it from the record",
            "processes that are started again would not do the same: the run has {input}"
        ));
    }

    let scratch = Scratch::new()?;
    let mut launch = Launch::again(folder.path(), quiet_options(scratch.path()))?;
    let (outcome, again) = launch.play(|_| {})?;
    if let Some(failure) = &outcome.failure {
        terminal::note(failure);
    }
    let [files_again] = recorded_epochs(&again)?
        .try_into()
        .map_err(|_| refusal!("the run has begun another epoch"))?;
    let comparison = compare(files, &files_again)?;
    let text = if comparison.are_same() {
        format!("the same as processes, {} ticks", comparison.last[0])
    } else {
        describe_comparison(&comparison, ["recorded", "executed again"])
    };
    conclude(&text, comparison.are_same())
}

/// Prints what came of a comparison. The exit status is that of the comparison also where its text is not read.
fn conclude(text: &str, are_same: bool) -> Result<ExitCode> {
    OutputError::unless_closed(terminal::print_line(text))?;
    if are_same {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

/// What an epoch has that does not follow from its scenario: what a person did, or ticks that a robot missed without a fault of
/// the scenario. `None` if it has nothing of the kind.
fn input_of_chance(files: &EpochFiles) -> Result<Option<String>, RecordError> {
    let operator = RobotName::operator();
    let mut faulty: BTreeSet<RobotName> = BTreeSet::new();
    let mut record = Record::of_events(&files.events)?;
    while let Some(entry) = record.next_entry()? {
        let tick = entry.tick;
        if !entry.commands_of(&operator).is_empty() {
            return Ok(Some(format!(
                "commands of an operator, from tick {tick} on"
            )));
        }
        if !entry.changes_by_hand().is_empty() {
            return Ok(Some(format!("changes by hand, from tick {tick} on")));
        }

        // A robot of which a fault is over is on its way back.
        for event in &entry.events {
            match event {
                Event::Fault { robot, .. } => {
                    faulty.insert(robot.clone());
                }
                Event::Joined { robot, .. } => {
                    faulty.remove(robot);
                }
                _ => {}
            }
        }
        if let Some(robot) = entry.missed().find(|robot| !faulty.contains(*robot)) {
            return Ok(Some(format!(
                "ticks that {robot} missed without a fault of the scenario, from tick {tick} on"
            )));
        }
    }
    Ok(None)
}

/// Options of a launch that shows nothing, as fast as possible.
fn quiet_options(out: &Path) -> LaunchOptions {
    LaunchOptions {
        run: RunOptions {
            run: None,
            if_taken: IfTaken::Number,
            seed: None,
            duration: None,
            speed: Some(Speed(None)),
            out: out.to_owned(),
            set: Vec::new(),
        },
        is_paused: false,
        opens_browser: false,
        has_console: false,
        is_quiet: true,
        connect_port: None,
        listen: None,
        links: Vec::new(),
        secure: None,
        is_insecure: false,
        grace: Time(GRACE_S),
        replayed: BTreeMap::new(),
        stays: false,
    }
}

/// Compares two runs.
pub(crate) fn diff(args: &DiffArgs) -> Result<ExitCode> {
    let mut last = Vec::new();
    for run in [&args.one, &args.other] {
        let folder = find(&args.out, run)?;
        last.push(recorded_epoch(&folder, None)?);
    }
    let comparison = compare(&last[0], &last[1])?;
    let text = if args.json {
        serde_json::to_string_pretty(&comparison).unwrap_or_default()
    } else {
        describe_comparison(&comparison, ["first run", "second run"])
    };
    conclude(&text, comparison.are_same())
}

fn describe(verification: &Verification, is_followed: bool) -> String {
    let mut text = String::new();
    match &verification.difference {
        Some(difference) => {
            text += &describe_difference(difference, ["recorded", "executed again"]);
        }
        None => {
            let end = match (verification.has_end, is_followed) {
                (true, _) => "to the end",
                (false, true) => "to the epoch that was begun after it",
                (false, false) => {
                    "and no end (the simulator was killed, or the run is in progress)"
                }
            };
            text += &format!(
                "the same, {} ticks {end}, digest {}",
                verification.ticks, verification.digest
            );
            text += &match verification.reports_to {
                Some(tick) if tick >= verification.ticks => String::new(),
                Some(tick) => format!("\nthe robots' reports were compared up to tick {tick}"),
                None => "\nthe robots' reports were not recorded: events and digests were compared"
                    .to_owned(),
            };
            if let Some(robot) = &verification.unreported {
                text += &format!(
                    "\nthe events go on: {robot} cannot be executed in this process, and its reports were recorded no further"
                );
            }
        }
    }

    for (robot, tick) in &verification.from_record {
        text += &format!(
            "\n{robot} could not be executed in this process from tick {tick} on: its reports were taken from the record"
        );
    }
    text
}

fn describe_comparison(comparison: &Comparison, runs: [&str; 2]) -> String {
    let [last, other_last] = comparison.last;
    let mut text = match &comparison.first {
        None if last == other_last => return format!("the same, {last} ticks"),
        None => format!("the same up to where one ends: tick {last} and tick {other_last}"),
        Some(difference) => describe_difference(difference, runs),
    };

    text += &format!(
        "\n{} of {} ticks differ; the last ticks are {last} and {other_last}",
        comparison.differing, comparison.ticks
    );
    if !comparison.only_in.is_empty() {
        text += &format!(
            "\nevents in only one of the runs: kind, {}, {}",
            runs[0], runs[1]
        );
    }
    for (kind, [one, other]) in &comparison.only_in {
        text += &format!("\n  {kind:<20} {one:>6} {other:>6}");
    }
    text
}

fn describe_difference(difference: &Difference, runs: [&str; 2]) -> String {
    let mut text = format!("the first difference: {difference}");
    for (index, run) in runs.iter().enumerate() {
        text += &format!("\n  {run:<15} {}", difference.value(index));
    }
    text
}
