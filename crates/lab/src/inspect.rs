//! Reads all that a run has left, and says what of it is damaged. Nothing is executed.

use std::io;
use std::path::{Path, PathBuf};

use config::Changes;
use environment::Simulation;
use environment::recorded;
use protocol::Event;
use protocol::event::log_line;
use protocol::messages::LogRecord;
use record::Record;
use record::difference::{between_headers, in_recording};
use record::names::{LAUNCHED, LOGS, SUMMARY};
use record::seal;
use record::seal::Checked;
use record::{EpochFiles, RunFolder, Summary};
use recording::Recording;
use scenario::Scenario;

use crate::error::LabError;
use crate::folder::{not_a_summary, recorded_epochs};
use crate::verify::check_scenario;

/// Ticks of a recording that are read at a time.
const PART: u64 = 256;
/// Half of the last digit of a time in the log, and a little, seconds.
const ROUNDED_S: f64 = 0.051;
/// What follows the time in a line of the log.
const UNIT: &str = " s  ";

/// What a run has left.
#[derive(Debug, Default)]
pub struct Inspection {
    /// The events of each epoch that are not damaged.
    pub epochs: Vec<Checked>,
    /// What is damaged, part by part.
    pub damages: Vec<LabError>,
}

/// Reads everything in the folder of a run.
///
/// # Errors
/// If it is not the folder of a run. Damage is part of what is returned.
pub fn inspect(folder: &RunFolder) -> Result<Inspection, LabError> {
    let mut inspection = Inspection::default();
    // Reading a pipe would wait for ever.
    check_files(folder.path())?;
    check_files(&folder.file(LOGS))?;
    let epochs = recorded_epochs(folder)?;
    let mut end = None;
    for (index, files) in epochs.iter().enumerate() {
        end = None;
        match seal::check(&files.events) {
            Ok(checked) => {
                end = Some(checked.clone());
                inspection.epochs.push(checked);
            }
            Err(error) => inspection.damages.push(error.into()),
        }
        let is_over = index + 1 < epochs.len() || has_ended(end.as_ref());
        inspection.note(inspect_recording(files, end.as_ref(), is_over));
    }

    let are_events_good = inspection.epochs.len() == epochs.len();
    inspection.note(inspect_summary(folder, end.as_ref()));
    inspection.note(inspect_launched(folder));
    if are_events_good {
        inspection.note(inspect_log(folder, &epochs, end.as_ref()));
    }
    inspection.note(read_all(folder.path()));
    inspection.note(read_all(&folder.file(LOGS)));
    Ok(inspection)
}

impl Inspection {
    fn note(&mut self, found: Result<(), LabError>) {
        self.damages.extend(found.err());
    }
}

/// Reads the scenario and the whole recording of an epoch, and compares them with each other and with the events.
fn inspect_recording(
    files: &EpochFiles,
    events: Option<&Checked>,
    is_over: bool,
) -> Result<(), LabError> {
    let scenario = Scenario::load(&files.scenario, &Changes::default())?;
    if !files.recording.exists() {
        if scenario.record.frames && is_over {
            let place = files.recording.display();
            return Err(LabError::record(format!(
                "the run was recorded, and {place} is not there"
            )));
        }
        return Ok(());
    }

    let recording = Recording::open(&files.recording)?;
    recording.check()?;
    if !has_begun(files)? {
        // It ended while robots were awaited: it has no tick.
        return Ok(());
    }
    for from in (0..recording.len()).step_by(PART as usize) {
        recording.read(from, from + PART)?;
    }
    check_scenario(files, &recording)?;
    let header = recording.header();
    let simulation = Simulation::new(scenario, files.epoch).map_err(LabError::refused)?;
    if let Some(difference) = between_headers(header, &recorded::header(&header.run, &simulation)) {
        let place = files.recording.display();
        return Err(LabError::record(format!(
            "{place} is not of its scenario: {difference}"
        )));
    }
    match events {
        Some(events) => compare_events(files, &recording, events),
        None => Ok(()),
    }
}

/// Compares the events of a recording with the file of the events.
fn compare_events(
    files: &EpochFiles,
    recording: &Recording,
    events: &Checked,
) -> Result<(), LabError> {
    let mut record = Record::open(files)?;
    while let Some(entry) = record.next_entry()? {
        if let Some(difference) = in_recording(&entry, &entry) {
            return Err(LabError::record(format!(
                "{} differs from {}: {difference}",
                files.recording.display(),
                files.events.display()
            )));
        }
    }

    let ticks = recording.len();
    let is_short = events.end.is_some() && (!recording.is_finished() || ticks != events.tick + 1);
    if is_short || ticks > events.tick + 1 {
        return Err(LabError::record(format!(
            "{} has {ticks} complete ticks, and {} goes to tick {}",
            files.recording.display(),
            files.events.display(),
            events.tick
        )));
    }
    Ok(())
}

/// Whether an epoch has a first tick.
fn has_begun(files: &EpochFiles) -> Result<bool, LabError> {
    let first = Record::of_events(&files.events)?.next_entry()?;
    let mut events = first.iter().flat_map(|entry| &entry.events);
    Ok(events.any(|event| matches!(event, Event::Init { .. })))
}

fn has_ended(events: Option<&Checked>) -> bool {
    events.is_some_and(|events| events.end.is_some())
}

/// Checks that nothing in a folder is a pipe, a socket or a device. There may be no such folder.
fn check_files(folder: &Path) -> Result<(), LabError> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    for entry in entries.flatten() {
        let path = entry.path();
        if path
            .metadata()
            .is_ok_and(|found| !found.is_file() && !found.is_dir())
        {
            let place = path.display();
            return Err(LabError::record(format!("{place} is not a file")));
        }
    }
    Ok(())
}

/// Compares the summary with its seal, and with the end of the run. What it counts is compared by [`crate::verify`].
fn inspect_summary(folder: &RunFolder, events: Option<&Checked>) -> Result<(), LabError> {
    let path = folder.file(SUMMARY);
    if !path.exists() {
        if has_ended(events) {
            return Err(LabError::record(format!(
                "the run has ended, and {} is not there",
                path.display()
            )));
        }
        return Ok(());
    }

    let text = read(&path)?;
    let summary: Summary =
        serde_json::from_str(&text).map_err(|error| not_a_summary(&path, &error))?;
    if summary.is_as_written(&text) == Some(false) {
        return Err(damaged(&path, &"it is not what was written"));
    }
    match events {
        Some(events) if summary.end != events.end || summary.ticks != events.tick => {
            Err(LabError::record(format!(
                "{} is not that of the run: it goes to tick {}, and the events go to tick {}",
                path.display(),
                summary.ticks,
                events.tick
            )))
        }
        Some(Checked {
            digest: Some(digest),
            ..
        }) if *digest != summary.digest => Err(LabError::record(format!(
            "{} is that of another run",
            path.display()
        ))),
        _ => Ok(()),
    }
}

/// Compares how the run was launched with its seal.
fn inspect_launched(folder: &RunFolder) -> Result<(), LabError> {
    let path = folder.file(LAUNCHED);
    if !path.exists() {
        return Ok(());
    }

    match seal::is_sealed_text_right(&read(&path)?) {
        Some(false) => Err(damaged(&path, &"it is not what was written")),
        _ => Ok(()),
    }
}

/// Compares the log with the events that people read.
fn inspect_log(
    folder: &RunFolder,
    epochs: &[EpochFiles],
    events: Option<&Checked>,
) -> Result<(), LabError> {
    let path = folder.log();
    if !path.exists() {
        let last = epochs
            .last()
            .map(|files| Scenario::load(&files.scenario, &Changes::default()));
        let is_logged = last
            .transpose()?
            .is_some_and(|scenario| scenario.record.log);
        if is_logged && has_ended(events) {
            return Err(LabError::record(format!(
                "the run was logged, and {} is not there",
                path.display()
            )));
        }
        return Ok(());
    }

    let text = read(&path)?;
    let all: Vec<&str> = text.lines().collect();
    let mut lines = all.iter().enumerate();
    let has_ended = has_ended(events);
    let is_cut = !text.is_empty() && !text.ends_with('\n');
    for files in epochs {
        let scenario = Scenario::load(&files.scenario, &Changes::default())?;
        if !scenario.record.log {
            return Ok(());
        }
        let mut record = Record::of_events(&files.events)?;
        while let Some(entry) = record.next_entry()? {
            for event in &entry.events {
                let Some(expected) = event.log_record(files.epoch, entry.tick, scenario.tick_s)
                else {
                    continue;
                };
                let Some((number, line)) = lines.next() else {
                    return if has_ended {
                        Err(damaged(&path, &"its end is missing"))
                    } else {
                        Ok(())
                    };
                };
                let is_last = is_cut && lines.len() == 0;
                if !is_line_of(line, &expected) && !is_last {
                    let reason = format!("line {} is not what was written", number + 1);
                    return Err(damaged(&path, &reason));
                }
            }
        }
    }
    match lines.next() {
        None if is_cut && has_ended => Err(damaged(&path, &"its end is missing")),
        Some((number, _)) if !is_cut => {
            let reason = format!("line {} follows the end of the record", number + 1);
            Err(damaged(&path, &reason))
        }
        _ => Ok(()),
    }
}

/// Whether a line of the log is that of an event. How many digits a time has is a matter of the version.
fn is_line_of(line: &str, expected: &LogRecord) -> bool {
    let written = log_line(expected);
    let (Some((time, rest)), Some((_, expected_rest))) =
        (line.split_once(UNIT), written.split_once(UNIT))
    else {
        return false;
    };

    let time: Option<f64> = time.trim().parse().ok();
    rest == expected_rest && time.is_some_and(|time| (time - expected.time_s).abs() < ROUNDED_S)
}

/// Reads every file of a folder to its end.
fn read_all(folder: &Path) -> Result<(), LabError> {
    let unreadable = LabError::unreadable(folder);
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(&unreadable)?,
    };
    for entry in entries {
        let path: PathBuf = entry.map_err(&unreadable)?.path();
        if path.is_file() {
            let read = std::fs::File::open(&path)
                .and_then(|mut file| io::copy(&mut file, &mut io::sink()));
            read.map_err(LabError::unreadable(&path))?;
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<String, LabError> {
    let bytes = std::fs::read(path).map_err(LabError::unreadable(path))?;
    String::from_utf8(bytes).map_err(|_| damaged(path, &"it is not UTF-8"))
}

fn damaged(path: &Path, reason: &dyn std::fmt::Display) -> LabError {
    LabError::record(format!("{} is damaged: {reason}", path.display()))
}
