//! Finds and reads the folder of a run.

use std::path::{Path, PathBuf};

use protocol::{Epoch, RunName};
use record::names::{LATEST, SUMMARY};
use record::{EpochFiles, RunFolder, Summary};
use recording::Recording;

use crate::error::LabError;

/// Why a run may have no recording.
pub(crate) const NOT_RECORDED: &str =
    "a run is recorded unless its scenario has `frames = false` under [record]";

/// Finds the folder of a run by the name of the run under `out`, or by the path of the folder.
///
/// # Errors
/// If there is none.
pub fn find(out: &Path, run: &Path) -> Result<RunFolder, LabError> {
    let candidates: [PathBuf; 2] = [out.join(run), run.to_owned()];
    if let Some(found) = candidates.into_iter().find(|path| path.is_dir()) {
        return Ok(RunFolder::at(found));
    }

    let out = out.display();
    if run == Path::new(LATEST) {
        return Err(LabError::record(format!("there is no run in {out}"))
            .with_help("name one, or start one with `cars run`"));
    }
    Err(LabError::record(format!(
        "there is no run {}, neither in {out} nor as a folder",
        run.display()
    ))
    .with_help("give a run's name, with --out where its folder is elsewhere, or its folder"))
}

/// The records of a run's epochs, the first epoch first.
///
/// # Errors
/// If the folder is not that of a run.
pub fn recorded_epochs(folder: &RunFolder) -> Result<Vec<EpochFiles>, LabError> {
    let mut epochs = folder.epochs();
    // A simulator that was killed while an epoch began has written no events of it yet.
    epochs.retain(|files| files.events.exists());
    if epochs.is_empty() {
        let place = folder.path().display();
        return Err(
            LabError::record(format!("{place} is not the folder of a run"))
                .with_help("name a folder with an events.jsonl, such as runs/latest"),
        );
    }
    Ok(epochs)
}

/// The record of one epoch of a run; without a number, of the last one.
///
/// # Errors
/// If the folder is not that of a run, or the run has no such epoch.
pub fn recorded_epoch(folder: &RunFolder, number: Option<Epoch>) -> Result<EpochFiles, LabError> {
    let mut epochs = recorded_epochs(folder)?;
    let last = epochs.len();
    let chosen = match number {
        None => epochs.pop(),
        Some(number) => epochs.into_iter().find(|files| files.epoch == number),
    };

    chosen.ok_or_else(|| {
        LabError::record(format!(
            "{} has no epoch {}, the last one is {last}",
            folder.path().display(),
            number.unwrap_or_default()
        ))
    })
}

/// The name of a recorded run: that of its folder, or, where the folder was copied or renamed to what is not the name of a run, the
/// one that is recorded.
#[must_use]
pub fn run_name(folder: &RunFolder) -> RunName {
    if let Ok(name) = folder.name() {
        return name;
    }

    let last = folder.epochs().pop();
    let recording = last.and_then(|files| Recording::open(&files.recording).ok());
    let recorded = recording.map(|recording| recording.header().run.clone());
    let summed_up = || read_summary(folder).ok().flatten();
    recorded
        .or_else(|| summed_up().map(|summary| summary.run))
        .unwrap_or_else(RunName::unknown)
}

/// Whether both paths lead to the same folder.
#[must_use]
pub fn is_same_place(one: &Path, other: &Path) -> bool {
    one.canonicalize().ok() == other.canonicalize().ok()
}

/// The recording of an epoch.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn recording(files: &EpochFiles) -> Result<Recording, LabError> {
    let opened = Recording::open(&files.recording);
    opened.map_err(|error| {
        let error = LabError::from(error);
        if files.recording.exists() {
            return error;
        }
        error.with_help(NOT_RECORDED)
    })
}

/// Reads the summary of a run; `None` if its simulator has not written one.
///
/// # Errors
/// If the file cannot be read or decoded.
pub fn read_summary(folder: &RunFolder) -> Result<Option<Summary>, LabError> {
    let path = folder.file(SUMMARY);
    if !path.exists() {
        return Ok(None);
    }

    let text = std::fs::read_to_string(&path).map_err(LabError::unreadable(&path))?;
    let summary = serde_json::from_str(&text).map_err(|error| not_a_summary(&path, &error))?;
    Ok(Some(summary))
}

/// The error of a file that has not the content of a summary.
pub(crate) fn not_a_summary(path: &Path, error: &serde_json::Error) -> LabError {
    LabError::record(format!("{} is not a summary: {error}", path.display()))
}
