//! Exports a run for other programs: tables of its events and of its robots' states as CSV or Parquet, and a log for ShiViz.
//!
//! A run is read tick by tick, so its length does not matter. All files are complete before the first of them gets its name.

pub mod draft;
pub mod sheet;
mod shiviz;
mod tables;

use std::path::{Path, PathBuf};

use config::FileError;
use record::EpochFiles;

use crate::parts::is_part_of_record;
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
    /// Damage of recordings, with what it leaves out, a sentence each. What could be read before it is in the files.
    pub damage: Vec<String>,
}

/// Exports epochs of a run to a folder, which is made if it does not exist. Files of an earlier export are replaced.
///
/// # Errors
/// [`FileError`] if events are damaged, a file cannot be read, or one cannot be written. No file is written then. Damage of a
/// recording is no error here, but part of what is returned.
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
        let formats = &wanted.tables;
        let notes = &mut exported.notes;
        drafts.extend(tables::write_events(epochs, folder, formats, notes)?);
        let damages = &mut exported.damage;
        drafts.extend(tables::write_states(
            epochs, folder, formats, notes, damages,
        )?);
    }
    if wanted.has_shiviz {
        drafts.push(shiviz::write(epochs, &folder.join(SHIVIZ))?);
    }

    // A log may be called what a table is called.
    for draft in &drafts {
        let path = draft.path();
        if is_part_of_record(path) {
            return Err(draft::unwritable(path, &"a run keeps its record there"));
        }
    }
    for draft in drafts {
        exported.files.push(draft.publish()?);
    }
    Ok(exported)
}
