//! Exports a run for other programs: tables of its events and of its robots' states as CSV or Parquet, and a log for ShiViz.
//!
//! A run is read tick by tick, so its length does not matter. All files are complete before the first of them gets its name.

pub mod draft;
pub mod sheet;
mod shiviz;
mod tables;

use std::path::{Path, PathBuf};

use config::FileError;
use simulator::EpochFiles;

use sheet::Format;

/// Name of the log for ShiViz.
const SHIVIZ: &str = "shiviz.log";

/// What is exported.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Formats of the tables; none without them.
    pub tables: Vec<Format>,
    /// Whether there is a log for ShiViz.
    pub has_shiviz: bool,
}

/// What was exported.
#[derive(Debug, Default)]
pub struct Exported {
    /// The files.
    pub files: Vec<PathBuf>,
    /// What they leave out, for people, a sentence each.
    pub notes: Vec<String>,
}

/// Exports epochs of a run to a folder, which is made if it does not exist. Files of an earlier export are replaced.
///
/// # Errors
/// [`FileError`] if the record cannot be read to its end, or a file cannot be written. No file is written then.
pub fn export(
    epochs: &[EpochFiles],
    folder: &Path,
    wanted: &Wanted,
) -> Result<Exported, FileError> {
    let is_new = !folder.exists();
    std::fs::create_dir_all(folder).map_err(|error| draft::unwritable(folder, &error))?;

    let exported = write(epochs, folder, wanted);
    if exported.is_err() && is_new {
        // Nothing but drafts was in it, which are removed; if it cannot be removed, the error to report is the first one.
        let _empty = std::fs::remove_dir(folder);
    }
    exported
}

fn write(epochs: &[EpochFiles], folder: &Path, wanted: &Wanted) -> Result<Exported, FileError> {
    let mut exported = Exported::default();
    let mut drafts = Vec::new();
    if !wanted.tables.is_empty() {
        let notes = &mut exported.notes;
        drafts.extend(tables::write_events(epochs, folder, &wanted.tables, notes)?);
        drafts.extend(tables::write_states(epochs, folder, &wanted.tables, notes)?);
    }
    if wanted.has_shiviz {
        drafts.push(shiviz::write(epochs, &folder.join(SHIVIZ))?);
    }

    for draft in drafts {
        exported.files.push(draft.publish()?);
    }
    Ok(exported)
}
