//! The record of a run that another one is to replace: it is kept aside until that one has begun.

use std::io::ErrorKind;

use scenario::files::{LOGS, WHY};

use super::RunFolder;
use crate::error::RecordError;

/// Where the record of a run is that another one replaces, until that one has begun.
const REPLACED: &str = ".replaced";
/// The same while its files are moved, to there or back: both places together have the record.
const MOVED: &str = ".replaced-moved";

impl RunFolder {
    /// Puts the record aside.
    pub(super) fn put_aside(&self) -> std::io::Result<()> {
        // File by file, under a name that does not claim that all are there. What a process that is killed here has moved is put back
        // by the next one that takes the folder.
        let moved = self.file(MOVED);
        for file in self.files() {
            let Ok(name) = file.strip_prefix(&self.path) else {
                continue;
            };
            let aside = moved.join(name);
            if file.symlink_metadata().is_ok() {
                std::fs::create_dir_all(aside.parent().unwrap_or(&moved))?;
                std::fs::rename(&file, aside)?;
            }
        }
        // The new name states that the record is complete there.
        match std::fs::rename(&moved, self.file(REPLACED)) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            renamed => renamed,
        }
    }

    /// Puts back the record that this run was to replace, unless the run has begun. Returns whether it did.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be moved.
    pub fn restore_replaced(&self) -> Result<bool, RecordError> {
        if self.file(REPLACED).is_dir() {
            if self.has_begun() {
                self.forget_replaced()?;
                return Ok(false);
            }
            self.clear()?;
        }
        self.try_restore()
            .map_err(|error| self.failed("put the record back into", &error))
    }

    fn try_restore(&self) -> std::io::Result<bool> {
        // First the name, by one call of the system: a process that is killed here must not take what is back for a new record.
        let moved = self.file(MOVED);
        match std::fs::rename(self.file(REPLACED), &moved) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ if !moved.is_dir() => return Ok(false),
            _ => {}
        }

        // The inner folders first: a folder can be removed only when it is empty. A process that is killed in between leaves the rest
        // under this name, and the next one goes on.
        for folder in [moved.join(LOGS), moved.join(WHY), moved.clone()] {
            let Ok(entries) = std::fs::read_dir(&folder) else {
                continue; // A run without logs of processes, or without answers.
            };
            for entry in entries {
                let file = entry?.path();
                if let Ok(name) = file.strip_prefix(&moved)
                    && !file.is_dir()
                {
                    std::fs::rename(&file, self.path.join(name))?;
                }
            }
            std::fs::remove_dir(&folder)?;
        }
        Ok(true)
    }

    /// Removes the record that this run replaces, if there is one: the run has begun.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be removed.
    pub fn forget_replaced(&self) -> Result<(), RecordError> {
        match std::fs::remove_dir_all(self.file(REPLACED)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(self.failed("remove the record replaced in", &error))
            }
            _ => Ok(()),
        }
    }

    /// Whether a record is aside.
    pub(super) fn has_replaced(&self) -> bool {
        [REPLACED, MOVED]
            .iter()
            .any(|name| self.file(name).is_dir())
    }
}
