//! Temporary folders that do not outlive their processes for long: what a process that was killed has left is removed by the next
//! one that makes such a folder.

use std::fs::{File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Once;

use tempfile::{Builder, TempDir};

/// What the names of these folders begin with.
const PREFIX: &str = "cars-scratch-";
/// File that the process locks for as long as it needs the folder.
const LOCK: &str = "in-use.lock";
/// Name of that file before it is locked.
const NEW_LOCK: &str = "in-use.new";

/// A temporary folder, removed on drop.
#[derive(Debug)]
pub struct Scratch {
    folder: TempDir,
    _lock: File,
}

impl Scratch {
    /// Makes a folder, and removes those of processes that were killed.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn new() -> io::Result<Self> {
        static SWEPT: Once = Once::new();

        let folder = Builder::new().prefix(PREFIX).tempdir()?;
        // A folder with the lock file is in use, or abandoned: the file gets this name when it is locked.
        let new = folder.path().join(NEW_LOCK);
        let lock = File::create_new(&new)?;
        lock.try_lock()?;
        std::fs::rename(&new, folder.path().join(LOCK))?;

        let own = folder.path().metadata()?;
        SWEPT.call_once(|| sweep(&std::env::temp_dir(), &own));
        Ok(Self {
            folder,
            _lock: lock,
        })
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the abandoned folders of the user to whom `own` belongs.
fn sweep(temporary: &Path, own: &Metadata) {
    let entries = std::fs::read_dir(temporary).into_iter().flatten();
    for entry in entries.flatten() {
        let name = entry.file_name();
        let is_scratch = name.to_string_lossy().starts_with(PREFIX);
        let is_own = entry
            .metadata()
            .is_ok_and(|found| found.is_dir() && found.uid() == own.uid());
        if is_scratch && is_own && is_abandoned(&entry.path()) {
            // What cannot be removed is left to the next one.
            let _remains = std::fs::remove_dir_all(entry.path());
        }
    }
}

fn is_abandoned(folder: &Path) -> bool {
    let lock = File::open(folder.join(LOCK));
    lock.is_ok_and(|lock| lock.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_abandoned_when_its_process_has_ended() {
        let scratch = Scratch::new().unwrap();
        assert!(!is_abandoned(scratch.path()));
        let temporary = tempfile::tempdir().unwrap();
        let left = temporary.path().join(format!("{PREFIX}left"));
        std::fs::create_dir(&left).unwrap();
        let own = left.metadata().unwrap();

        // It has no lock yet: its process has just made it.
        sweep(temporary.path(), &own);
        assert!(left.exists());
        std::fs::write(left.join(LOCK), "").unwrap();
        std::fs::write(temporary.path().join("other"), "").unwrap();
        sweep(temporary.path(), &own);
        assert!(!left.exists());
        assert!(temporary.path().join("other").exists());
    }
}
