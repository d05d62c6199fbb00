//! Finding and reading the folder of a run.

use std::path::{Path, PathBuf};

use config::FileError;
use miette::{IntoDiagnostic, WrapErr};
use simulator::recorder::SUMMARY;
use simulator::{RunFolder, Summary};

/// The folder of a run that is given by its name, under `out`, or by the path of its folder.
#[must_use]
pub fn find(out: &Path, run: &Path) -> Option<RunFolder> {
    let candidates: [PathBuf; 2] = [out.join(run), run.to_owned()];
    candidates
        .into_iter()
        .find(|path| path.is_dir())
        .map(RunFolder::at)
}

/// The summary of a run, if its simulator came to write one.
///
/// # Errors
/// If it cannot be read, or is not a summary.
pub fn read_summary(folder: &RunFolder) -> miette::Result<Option<Summary>> {
    let path = folder.file(SUMMARY);
    if !path.exists() {
        return Ok(None);
    }

    let text =
        std::fs::read_to_string(&path).map_err(|error| FileError::unreadable(&path, &error))?;
    let summary = serde_json::from_str(&text)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} is not what the simulator writes", path.display()))?;
    Ok(Some(summary))
}
