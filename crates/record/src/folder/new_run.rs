//! The folder of a new run: one function makes it, and never takes what another command made.
//!
//! A folder is made by one call of the system, so two processes never get the same one.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use protocol::RunName;
use scenario::Scenario;
use scenario::files::{EVENTS, LATEST};

use super::{RunFolder, RunLock};
use crate::error::RecordError;

/// What a new run does where an entry with its name exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum IfTaken {
    /// It takes the next free name, as in `hall-2`.
    #[default]
    Number,
    /// It replaces the record of a run that is over. Anything else is an error.
    Replace,
    /// It is an error: other processes know the run by its name.
    Refuse,
    /// The folder was made for it by [`RunFolder::make`], in another process.
    Reserved,
}

/// The folder of a new run.
#[derive(Debug)]
pub struct NewRun {
    /// The name of the run, which may be another one than was asked for.
    pub run: RunName,
    /// Its folder.
    pub folder: RunFolder,
    /// While it is held, no other process writes a record into the folder.
    pub lock: RunLock,
    /// A sentence for people, if the name is another one than was asked for.
    pub notice: Option<String>,
    /// Where the link to the latest run led before.
    latest: Option<PathBuf>,
}

/// The folder of a new run that another process is to take.
#[derive(Debug)]
pub struct Reserved {
    /// The name of the run.
    pub run: RunName,
    /// Its folder.
    pub folder: RunFolder,
}

impl RunFolder {
    /// Makes the folder of a new run under `out`, without content. Where a run that is over is to be replaced, its record is kept aside
    /// until the new run has begun ([`Self::forget_replaced`]), or is put back ([`Self::restore_replaced`]).
    ///
    /// # Errors
    /// [`RecordError`] if the folder cannot be made, or the name is taken and `if_taken` does not help.
    pub fn make(out: &Path, run: &RunName, if_taken: IfTaken) -> Result<NewRun, RecordError> {
        std::fs::create_dir_all(out).map_err(|error| {
            RecordError::folder(format!("cannot make the folder {}: {error}", out.display()))
        })?;

        let folder = Self::new(out, run);

        match if_taken {
            IfTaken::Reserved => {
                let lock = folder.take_reserved()?;
                return Ok(NewRun::named(run, folder, lock));
            }
            IfTaken::Replace if folder.is_taken() => {
                let lock = folder.take_over()?;
                return Ok(NewRun::named(run, folder, lock));
            }
            IfTaken::Replace | IfTaken::Refuse | IfTaken::Number => {}
        }

        // One call of the system tells whether the name was free. To look first would let two processes
        // find it so.
        if let Some(lock) = folder.try_make()? {
            return Ok(NewRun::named(run, folder, lock));
        }
        if if_taken != IfTaken::Number {
            let place = folder.path.display();
            return Err(
                RecordError::folder(format!("{place} exists already")).with_help(
                    "choose another --run or --out; --replace replaces a run that is over",
                ),
            );
        }
        Self::make_numbered(out, run)
    }

    fn make_numbered(out: &Path, asked: &RunName) -> Result<NewRun, RecordError> {
        let mut number = 2;
        loop {
            let run = asked.numbered(number);
            let folder = Self::new(out, &run);
            if let Some(lock) = folder.try_make()? {
                let taken = out.join(asked.as_str());
                return Ok(NewRun {
                    notice: Some(format!(
                        "the run is {run}: {} exists already, and only --replace replaces a run that is over",
                        taken.display()
                    )),
                    ..NewRun::named(&run, folder, lock)
                });
            }

            // Another process may have taken this one as well. Then the next one is tried.
            number += 1;
        }
    }

    /// The name that a new run would get now.
    #[must_use]
    pub fn next_name(out: &Path, run: &RunName, if_taken: IfTaken) -> RunName {
        let is_free = |run: &RunName| !Self::new(out, run).is_taken();
        if if_taken != IfTaken::Number || is_free(run) {
            return run.clone();
        }
        let mut names = (2..).map(|number| run.numbered(number));
        names.find(is_free).unwrap_or_else(|| run.clone())
    }

    /// Whether there is anything at the path, also a link that leads nowhere.
    #[must_use]
    pub fn is_taken(&self) -> bool {
        self.path.symlink_metadata().is_ok()
    }

    /// Makes the folder and locks it; `None` if there is anything at the path.
    fn try_make(&self) -> Result<Option<RunLock>, RecordError> {
        match std::fs::create_dir(&self.path) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => return Ok(None),
            Err(error) => return Err(self.failed("make", &error)),
        }
        self.lock().map(Some)
    }

    /// Takes a folder that another process made for this one: it has no record.
    fn take_reserved(&self) -> Result<RunLock, RecordError> {
        self.check_itself()?;
        self.check_links()?;
        // Links are looked for before anything is opened for writing, the lock included.
        let lock = self.lock()?;
        // Under the lock: no other process can begin a record any more.
        if self.file(EVENTS).exists() {
            let place = self.path.display();
            return Err(RecordError::folder(format!("{place} has a run already")));
        }
        Ok(lock)
    }

    /// Takes the folder of a run that is over, and puts its record aside. Files that no run makes stay.
    fn take_over(&self) -> Result<RunLock, RecordError> {
        let place = self.path.display();
        let is_folder = self.path.symlink_metadata().is_ok_and(|at| at.is_dir());
        if !is_folder || !(self.has_record() || self.has_replaced()) {
            let error =
                RecordError::folder(format!("{place} is there and is not the folder of a run"));
            return Err(error.with_help("choose another --run or --out, or move it away"));
        }
        self.check_links()?;

        // First that of the launcher: its simulator may be about to take the other one.
        let _launcher = self.lock_of_launcher()?;
        let lock = self.lock()?;
        // Under both locks: neither a launcher nor a simulator is at work in the folder. A launch that was killed may have left a
        // record aside.
        self.restore_replaced()?;
        self.put_aside()
            .map_err(|error| self.failed("replace the record in", &error))?;
        Ok(lock)
    }

    /// Makes the folder, which must not exist, with the scenario.
    ///
    /// # Errors
    /// [`RecordError`] as [`Self::make`] and [`Self::fill`].
    pub fn create(&self, scenario: &Scenario) -> Result<RunLock, RecordError> {
        let out = self.path.parent().unwrap_or(Path::new(""));
        let made = Self::make(out, &self.named()?, IfTaken::Refuse)?;
        self.fill(scenario)?;
        Ok(made.lock)
    }

    /// The name of a folder that may not exist yet.
    fn named(&self) -> Result<RunName, RecordError> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        RunName::new(&name).map_err(RecordError::folder)
    }

    fn discard(&self) {
        let discarded = match self.restore_replaced() {
            Ok(false) => self.remove(),
            restored => restored.map(drop),
        };
        if let Err(error) = discarded {
            tracing::warn!("{} could not be removed: {error}", self.path.display());
        }
    }
}

impl NewRun {
    /// A run whose name is the one that was asked for.
    fn named(run: &RunName, folder: RunFolder, lock: RunLock) -> Self {
        Self {
            run: run.clone(),
            latest: std::fs::read_link(folder.path.with_file_name(LATEST)).ok(),
            folder,
            lock,
            notice: None,
        }
    }

    /// Takes back what was made for a run that has failed before a tick was complete, such as one with parameters that a robot refuses.
    pub fn undo_unless_begun(&self) {
        if !self.folder.has_begun() {
            self.undo();
        }
    }

    /// Takes back what was made for a run that has failed: its folder goes, or has the record again that it was to replace, and the link
    /// to the latest run leads where it did.
    pub fn undo(&self) {
        let folder = &self.folder;
        folder.discard();

        let link = folder.path.with_file_name(LATEST);
        let is_own = std::fs::read_link(&link)
            .is_ok_and(|target| Some(target.as_os_str()) == folder.path.file_name());
        if !is_own {
            return; // Another run has begun since.
        }
        match &self.latest {
            Some(latest) if link.with_file_name(latest).exists() => folder.point_latest_to(latest),
            _ => {
                // Without the link, runs have to be named.
                let _unlinked = std::fs::remove_file(&link);
            }
        }
    }

    /// Leaves the folder to another process, which takes it with [`IfTaken::Reserved`].
    #[must_use]
    pub fn reserve(self) -> Reserved {
        Reserved {
            run: self.run,
            folder: self.folder,
        }
    }
}

impl Reserved {
    /// Removes the folder of a run that does not begin, or puts back the record that it was to replace.
    pub fn discard(&self) {
        self.folder.discard();
    }
}
