//! Verification: a recorded epoch is executed again from its scenario and compared with its record, tick by tick.

use std::collections::BTreeMap;
use std::path::PathBuf;

use config::Changes;
use environment::Simulation;
use environment::recorded;
use protocol::{RobotName, RunName, Tick};
use record::Record;
use record::difference::{Difference, between, between_headers, between_summaries, in_recording};
use record::names::{EVENTS, SUMMARY};
use record::{EpochFiles, Summary, seal};
use recording::Recording;
use scenario::Scenario;
use serde_json::Value;

use crate::error::LabError;
use crate::folder::not_a_summary;
use crate::reexecution::Reexecution;

/// What came of a verification.
#[derive(Debug)]
pub struct Verification {
    /// The last tick that was compared.
    pub ticks: Tick,
    /// Whether the record has the end of the run.
    pub has_end: bool,
    /// Digest of the run at that tick.
    pub digest: String,
    /// The last tick of which the record has the robots' reports, so that they were compared, too.
    pub reports_to: Option<Tick>,
    /// The robot that ended the comparison before the last tick of the events: it cannot be executed, and the simulator was killed
    /// before the recording had its next report.
    pub unreported: Option<RobotName>,
    /// Robots that were not executed in some ticks, and the first of these.
    pub from_record: BTreeMap<RobotName, Tick>,
    /// The first difference: recorded, then executed again.
    pub difference: Option<Difference>,
}

/// Executes an epoch again and compares.
///
/// # Errors
/// If the record cannot be read or is damaged where nothing differs, the scenario cannot be set up, or a robot is to be taken
/// from the record and the record has no reports.
pub fn verify(files: &EpochFiles) -> Result<Verification, LabError> {
    let mut record = Record::open(files)?;
    let scenario = Scenario::load(&files.scenario, &Changes::default())?;
    let has_recording = scenario.record.frames;
    if let Some(recording) = record.recording() {
        check_scenario(files, recording)?;
    }
    let mut again = Reexecution::new(scenario, files.epoch)?;
    let mut verification = Verification {
        ticks: 0,
        has_end: false,
        digest: String::new(),
        reports_to: None,
        unreported: None,
        from_record: BTreeMap::new(),
        difference: header_difference(&record, &again.local.simulation),
    };
    if verification.difference.is_some() {
        return Ok(verification);
    }

    let run = recorded_run(&record);
    let mut summary = again.local.simulation.begin_summary(&run);
    let mut next = record.next_entry()?;
    if next.is_none() {
        let events = files.events.display();
        return Err(LabError::record(format!("{events} has no complete tick")));
    }
    while let Some(recorded) = next {
        let executed = match again.play(&recorded) {
            Ok(executed) => executed,
            Err(error) => {
                // The recording is written in chunks, so that of a killed run ends before the events.
                let is_cut = record.recording().is_some_and(|file| !file.is_finished());
                verification.unreported = again.unreported(&recorded).filter(|_| is_cut).cloned();
                match verification.unreported {
                    Some(_) if recorded.tick > 0 => break,
                    Some(robot) => return Err(killed_too_soon(&robot)),
                    None => return Err(error),
                }
            }
        };
        let simulation = &again.local.simulation;
        for event in executed.record.events.iter() {
            simulation.count(&mut summary, executed.record.tick, event);
        }
        let executed = executed.into_entry();
        verification.difference =
            between(&recorded, &executed).or_else(|| in_recording(&recorded, &executed));
        if verification.difference.is_some() {
            break;
        }
        verification.ticks = recorded.tick;
        verification.has_end = recorded.is_end();
        if recorded.reports.is_some() {
            verification.reports_to = Some(recorded.tick);
        }
        next = record.next_entry()?;
    }

    verification.digest = again.local.simulation.digest();
    verification.from_record = again.from_record;
    if verification.difference.is_none() {
        // What nothing depends on may be damaged, too.
        seal::check(&files.events)?;
        if let Some(recording) = record.recording() {
            recording.check()?;
        }
        check_end(files, &record, &verification, has_recording)?;
        if verification.has_end && is_last(files) {
            again.local.simulation.finish_summary(&mut summary);
            check_run(files, &record)?;
            verification.difference = summary_difference(files, &record, &summary)?;
        }
    }
    Ok(verification)
}

/// Nothing of a run can be compared.
fn killed_too_soon(robot: &RobotName) -> LabError {
    LabError::record(format!(
        "{robot} cannot be executed in this process, and nothing of it was recorded: the simulator was killed, or is in the first \
         ticks of the run"
    ))
}

/// The name of the run, which a copy of its folder need not have.
fn recorded_run(record: &Record) -> RunName {
    let recording = record.recording();
    recording.map_or_else(RunName::unknown, |recording| recording.header().run.clone())
}

/// Whether an epoch is the last one of its run, of which the summary is.
fn is_last(files: &EpochFiles) -> bool {
    files.events.file_name().is_some_and(|name| name == EVENTS)
}

/// The first field of the summary of a run that does not follow from its record. There may be no summary: the simulator was killed
/// before it wrote one.
fn summary_difference(
    files: &EpochFiles,
    record: &Record,
    executed: &Summary,
) -> Result<Option<Difference>, LabError> {
    let Some((path, mut written)) = read_summary(files)? else {
        return Ok(None);
    };
    if written.get("wall").is_none_or(|wall| !wall.is_object()) {
        return Err(LabError::record(format!(
            "{} is not a summary",
            path.display()
        )));
    }
    // Another version counts other things.
    let version = match record.recording() {
        Some(recording) => recording.header().version.clone(),
        None => written["version"].as_str().unwrap_or_default().to_owned(),
    };
    if version != executed.version {
        return Ok(None);
    }
    // Before summaries had seals, a robot that was lost stayed in its last state.
    if written["wall"].get("seal").is_none() {
        for (name, robot) in &executed.robots {
            let recorded = &mut written["robots"][name.as_str()];
            if recorded.is_object() {
                recorded["emotions_s"] =
                    serde_json::to_value(&robot.emotions_s).map_err(LabError::failed)?;
                recorded["behaviors_s"] =
                    serde_json::to_value(&robot.behaviors_s).map_err(LabError::failed)?;
            }
        }
    }
    Ok(between_summaries(&written, executed))
}

/// Checks that a summary names the run and the version of the recording beside it.
fn check_run(files: &EpochFiles, record: &Record) -> Result<(), LabError> {
    let (Some((path, written)), Some(recording)) = (read_summary(files)?, record.recording())
    else {
        return Ok(());
    };

    let header = recording.header();
    if written["run"] != header.run.as_str() || written["version"] != header.version.as_str() {
        let place = path.display();
        return Err(LabError::record(format!(
            "{place} is that of another run than the recording"
        )));
    }
    Ok(())
}

/// The summary beside the record of an epoch, if there is one.
fn read_summary(files: &EpochFiles) -> Result<Option<(PathBuf, Value)>, LabError> {
    let path = files.events.with_file_name(SUMMARY);
    if !path.exists() {
        return Ok(None);
    }

    let text = std::fs::read_to_string(&path).map_err(LabError::unreadable(&path))?;
    let written = serde_json::from_str(&text).map_err(|error| not_a_summary(&path, &error))?;
    Ok(Some((path, written)))
}

/// The first field of the recording's header that is not that of the scenario.
fn header_difference(record: &Record, simulation: &Simulation) -> Option<Difference> {
    let header = record.recording()?.header();
    between_headers(header, &recorded::header(&header.run, simulation))
}

/// Checks that the scenario beside the record is the one that the recording contains.
pub(crate) fn check_scenario(files: &EpochFiles, recording: &Recording) -> Result<(), LabError> {
    let recorded = recording.scenario()?;
    let scenario =
        std::fs::read_to_string(&files.scenario).map_err(LabError::unreadable(&files.scenario))?;
    if scenario != recorded {
        return Err(LabError::record(format!(
            "{} was changed since the run",
            files.scenario.display()
        ))
        .with_help(
            "the recording contains the scenario of the run, as the attachment scenario.toml",
        ));
    }
    Ok(())
}

/// Checks that the parts of the record end alike.
fn check_end(
    files: &EpochFiles,
    record: &Record,
    verification: &Verification,
    has_recording: bool,
) -> Result<(), LabError> {
    let events = files.events.display();
    let recording = files.recording.display();
    let last = verification.ticks;

    let summary = files.events.with_file_name(SUMMARY);
    if !verification.has_end && is_last(files) && summary.exists() {
        return Err(LabError::record(format!(
            "{events} ends at tick {last} without an end of the run, and the run has ended: it has a summary"
        )));
    }
    match record.recording() {
        None if has_recording && verification.has_end => Err(LabError::record(format!(
            "the run was recorded, and {recording} is not there"
        ))),
        Some(file) if verification.has_end && !file.is_finished() && file.len() == last + 1 => {
            Err(LabError::record(format!(
                "{recording} is unfinished: it has all ticks, and its end is missing"
            ))
            .with_help("`mcap recover` writes the end of the file, which has the index"))
        }
        Some(file) if verification.has_end && (!file.is_finished() || file.len() != last + 1) => {
            Err(LabError::record(format!(
                "{recording} is not whole: it has {} complete ticks, and the events go to the end at tick {last}",
                file.len()
            )))
        }
        Some(file) if file.len() > last + 1 => Err(LabError::record(format!(
            "{events} ends at tick {last}, and {recording} has {} ticks",
            file.len()
        ))),
        _ => Ok(()),
    }
}
