//! Finds and reads the folder of a run.

use std::path::{Path, PathBuf};

use config::FileError;
use miette::{IntoDiagnostic, WrapErr};
use simulator::recorder::SUMMARY;
use simulator::{RunFolder, Summary};

/// Finds the folder of a run by the name of the run under `out`, or by the path of the folder.
#[must_use]
pub fn find(out: &Path, run: &Path) -> Option<RunFolder> {
    let candidates: [PathBuf; 2] = [out.join(run), run.to_owned()];
    let found = candidates.into_iter().find(|path| path.is_dir());
    found.map(RunFolder::at)
}

/// Reads the summary of a run; `None` if its simulator has not written one.
///
/// # Errors
/// If the file cannot be read or decoded.
pub fn read_summary(folder: &RunFolder) -> miette::Result<Option<Summary>> {
    let path = folder.file(SUMMARY);
    if !path.exists() {
        return Ok(None);
    }

    let text =
        std::fs::read_to_string(&path).map_err(|error| FileError::unreadable(&path, &error))?;
    let summary = serde_json::from_str(&text)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} is not a summary", path.display()))?;
    Ok(Some(summary))
}
