//! The folder of a run and its files. No link is followed or replaced.
//!
//! A folder is in use while one of its two locks is held: that of the process that writes the record, and that of the launcher, which
//! outlives it.

pub(crate) mod new_run;
mod replaced;

use std::ffi::OsStr;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use protocol::messages::End;
use protocol::{Epoch, Event, Line, RunName};
use scenario::Scenario;
use scenario::files::{
    ENDPOINT, EVENTS, LATEST, LAUNCHED, LINKS, LOCK, LOG, LOGS, OPERATOR_CONFIG, RECORDING,
    SCENARIO, SUMMARY, WHY, check_log_name,
};

use crate::error::RecordError;
use crate::seal::{self, RawLines};

/// The files of the record of one epoch.
#[derive(Debug, Clone)]
pub struct EpochFiles {
    /// The epoch.
    pub epoch: Epoch,
    /// Its scenario, complete.
    pub scenario: PathBuf,
    /// Its events.
    pub events: PathBuf,
    /// Its recording.
    pub recording: PathBuf,
}

/// With this their names end while a run that is resumed is executed again.
pub const DRAFT: &str = ".draft";
/// With this the name of a file ends while it is written.
const NEW: &str = ".new";
/// Files that every epoch has.
const PER_EPOCH: [&str; 3] = [SCENARIO, EVENTS, RECORDING];
/// Folders in the folder of a run.
const FOLDERS: [&str; 2] = [LOGS, WHY];
/// How the names of the files of answers end.
const ANSWER_ENDINGS: [&str; 2] = [".json", ".jsonl"];
/// How the names of the logs of processes end.
const LOG_ENDING: &str = ".log";
/// Name of the file in which the console keeps its address and its token, among the logs.
pub const CONSOLE_KEPT: &str = "console.kept";
/// Name of the file in which the console reads why the run has failed, among the logs.
pub const FAILED: &str = "failed.json";

/// The folder of a run: `OUT/NAME`.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// The folder of run `run` under `out`.
    #[must_use]
    pub fn new(out: &Path, run: &RunName) -> Self {
        Self {
            path: out.join(run.as_str()),
        }
    }

    /// The folder at a path.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self { path }
    }

    /// The folder itself, where the path is a link such as `latest`.
    ///
    /// # Errors
    /// [`RecordError`] if there is none.
    pub fn resolved(&self) -> Result<Self, RecordError> {
        let path = self.path.canonicalize();
        let path = path.map_err(|error| self.failed("find", &error))?;
        Ok(Self { path })
    }

    /// The folder itself, to write into it. The link `latest` is followed to the folder beside it, and no other link.
    ///
    /// # Errors
    /// [`RecordError`] if there is none, or it is reached by a link.
    pub fn resolved_to_write(&self) -> Result<Self, RecordError> {
        let mut path = self.path.clone();
        if self.path.file_name() == Some(OsStr::new(LATEST))
            && let Ok(target) = std::fs::read_link(&self.path)
            // A bare name: `latest` leads to a folder beside it, and nowhere else.
            && target.file_name() == Some(target.as_os_str())
        {
            path = self.path.with_file_name(target);
        }

        if path.is_symlink() {
            let place = path.display();
            return Err(RecordError::folder(format!(
                "{place} is a link, and no record is written through one"
            ))
            .with_help("name the folder to which it leads"));
        }
        Self { path }.resolved()
    }

    /// The name of the folder itself, for people, also where the path is a link.
    #[must_use]
    pub fn title(&self) -> String {
        let path = self.path.canonicalize();
        let path = path.as_ref().unwrap_or(&self.path);
        let name = path.file_name().unwrap_or(path.as_os_str());
        name.to_string_lossy().into_owned()
    }

    /// The name of the run by which its processes know it: that of its folder, also where the path is a link.
    ///
    /// # Errors
    /// [`RecordError`] if there is no folder, or it is not named like a run: it was copied or renamed.
    pub fn name(&self) -> Result<RunName, RecordError> {
        let path = self.resolved()?.path;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        RunName::new(&name).map_err(|error| {
            RecordError::folder(format!(
                "{} is not named like a run: {error}",
                path.display()
            ))
            .with_help("rename the folder")
        })
    }

    /// Whether a tick of the run is complete. A run does not begin where a robot refuses its parameters, for example.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        let Ok(mut lines) = RawLines::open(&self.file(EVENTS)) else {
            return false;
        };
        while let Ok(Some(raw)) = lines.next() {
            let line = Line::from_json(&raw.bytes);
            if line.is_ok_and(|line| matches!(line.event, Event::Tick { .. })) {
                return true;
            }
        }
        false
    }

    /// Checks that the path is that of a folder, and not of a link.
    fn check_itself(&self) -> Result<(), RecordError> {
        let found = self.path.symlink_metadata();
        let found = found.map_err(|error| self.failed("find", &error))?;
        if found.is_dir() {
            return Ok(());
        }
        let place = self.path.display();
        Err(RecordError::folder(format!("{place} is not a folder")))
    }

    /// Checks that no entry of the folder, and of those in it, is a link: what is written to one would be written elsewhere.
    fn check_links(&self) -> Result<(), RecordError> {
        check_no_links(&self.path)?;
        FOLDERS
            .iter()
            .try_for_each(|folder| check_no_links(&self.file(folder)))
    }

    /// Makes the folder of the logs and writes the scenario: from then on it is the folder of a run.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be written.
    pub fn fill(&self, scenario: &Scenario) -> Result<(), RecordError> {
        self.make_within(LOGS)?;
        self.write_scenario(scenario)
    }

    /// The folder of the answers about the run, which is made if it is not there.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be made, or is a link or has one.
    pub fn make_why(&self) -> Result<PathBuf, RecordError> {
        let why = self.make_within(WHY)?;
        check_no_links(&why)?;
        Ok(why)
    }

    /// Makes a folder in the folder, unless there is something with its name.
    fn make_within(&self, name: &str) -> Result<PathBuf, RecordError> {
        let folder = Self::at(self.file(name));
        match std::fs::create_dir(&folder.path) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                Err(folder.failed("make", &error))
            }
            _ => Ok(folder.path),
        }
    }

    /// Removes the record of a run.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be removed.
    pub fn clear(&self) -> Result<(), RecordError> {
        for file in self.files() {
            remove_if_there(&file).map_err(|error| self.failed("clear", &error))?;
        }
        Ok(())
    }

    /// Whether a path is that of a file which a run makes in its folder.
    #[must_use]
    pub fn is_of_run(file: &Path) -> bool {
        // Those of processes are one folder deeper.
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        file.ancestors().skip(1).take(2).any(|folder| {
            let folder = Self::at(folder.to_owned());
            // Also of a run that has lost its scenario, and of epochs that are to come.
            let mut prefixes = PER_EPOCH.iter().map(|file| superseded_prefix(file));
            let is_of_epoch = file.parent() == Some(folder.path())
                && prefixes.any(|prefix| name.starts_with(&prefix));
            let is_lock = file == folder.file(LOCK);
            folder.is_begun()
                && (is_lock || is_of_epoch || folder.files().iter().any(|own| own == file))
        })
    }

    /// Whether it is the folder of a run. A robot's folder has a scenario, too.
    fn has_record(&self) -> bool {
        self.is_begun() && self.file(SCENARIO).exists()
    }

    fn is_begun(&self) -> bool {
        self.file(LOCK).exists() || self.file(EVENTS).exists()
    }

    /// All files that runs make, whether they are there or not. The scenario has the name of the log, and makes the folder that of a
    /// run: it is the last.
    fn files(&self) -> Vec<PathBuf> {
        let mut files = self.superseded();
        for name in [EVENTS, RECORDING, SUMMARY, ENDPOINT, OPERATOR_CONFIG] {
            files.push(self.file(name));
        }
        files.extend([LAUNCHED, LINKS].map(|name| self.file(name)));
        files.push(self.log());

        for file in files.clone() {
            // What a process that was killed left of a file.
            for ending in [DRAFT, NEW] {
                files.push(with_ending(&file, ending));
            }
        }
        files.extend(self.logs_of_processes());
        files.extend(self.answers());
        files.push(self.file(SCENARIO));
        files
    }

    /// Removes the record of a run that has failed, and the folder unless there is something else in it.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be removed.
    pub fn remove(&self) -> Result<(), RecordError> {
        self.clear()?;
        remove_if_there(&self.file(LOCK)).map_err(|error| self.failed("remove", &error))?;

        let [logs, why] = FOLDERS.map(|folder| self.file(folder));
        for folder in [&logs, &why, &self.path] {
            match std::fs::remove_dir(folder) {
                Err(error)
                    if !matches!(
                        error.kind(),
                        ErrorKind::NotFound | ErrorKind::DirectoryNotEmpty
                    ) =>
                {
                    return Err(self.failed("remove", &error));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The logs that a launch has written.
    fn logs_of_processes(&self) -> Vec<PathBuf> {
        let mut logs = Vec::new();
        let entries = std::fs::read_dir(self.file(LOGS)).into_iter().flatten();
        for entry in entries.flatten() {
            let name = entry.file_name();
            let name = name.to_str().unwrap_or_default();
            if name.ends_with(LOG_ENDING) || [CONSOLE_KEPT, FAILED].contains(&name) {
                logs.push(entry.path());
            }
        }
        logs
    }

    /// The answers that were made of the run.
    fn answers(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.file(WHY)).into_iter().flatten();
        let files = entries.flatten().map(|entry| entry.path());
        files
            .filter(|file| {
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                ANSWER_ENDINGS.iter().any(|ending| name.ends_with(ending))
            })
            .collect()
    }

    /// Writes [`SCENARIO`], once for each epoch.
    pub fn write_scenario(&self, scenario: &Scenario) -> Result<(), RecordError> {
        self.write(SCENARIO, &scenario.to_toml()?)
    }

    /// Points the symbolic link [`LATEST`] to the folder, in one step. If links cannot be made, or something else has its name, runs
    /// have to be named.
    pub fn point_latest(&self) {
        if let Some(name) = self.path.file_name() {
            self.point_latest_to(Path::new(name));
        }
    }

    /// Points the link to another run beside this one, as [`Self::point_latest`] does.
    pub fn point_latest_to(&self, target: &Path) {
        if let Err(error) = self.try_point_latest(target) {
            tracing::debug!(%error, "no link to the latest run");
        }
    }

    fn try_point_latest(&self, target: &Path) -> std::io::Result<()> {
        let link = self.path.with_file_name(LATEST);
        let is_ours = link
            .symlink_metadata()
            .map_or(true, |found| found.is_symlink());
        if !is_ours {
            return Err(ErrorKind::AlreadyExists.into());
        }

        // Only the process that has the folder uses this name.
        let own = self.path.file_name().unwrap_or_default();
        let mut new = std::ffi::OsString::from(format!(".{LATEST}-"));
        new.push(own);
        let new = self.path.with_file_name(new);
        if new.is_symlink() {
            std::fs::remove_file(&new)?;
        }
        // A link cannot be changed, only replaced: by renaming a new one over it there is one at any
        // time.
        std::os::unix::fs::symlink(target, &new)?;
        std::fs::rename(&new, &link).inspect_err(|_| {
            let _stays = std::fs::remove_file(&new);
        })
    }

    /// Takes the folder of a run that was killed or stopped, to resume it, with the record of its last epoch, the files of which
    /// may not be there yet. The record is checked first.
    ///
    /// # Errors
    /// [`RecordError`] if it is not the folder of a run, the run is in progress or has ended, the record is damaged, or a link is
    /// in the place of a file.
    pub fn reopen(&self) -> Result<(RunLock, EpochFiles), RecordError> {
        let place = self.path.display();
        if !self.file(SCENARIO).exists() {
            let error = RecordError::folder(format!("{place} is not the folder of a run"));
            return Err(error.with_help("name a run under --out, or its folder"));
        }
        self.check_itself()?;
        self.check_links()?;

        let lock = self.lock()?;
        // Only under the lock: until then another process could still write, or begin a further epoch.
        let files = self.last_epoch();
        if files.events.exists() {
            let end = seal::check(&files.events)?.end;
            if end.is_some_and(|end| end != End::Stopped) {
                let error = RecordError::folder(format!("the run in {place} has ended"));
                return Err(error.with_help("start it again without --resume"));
            }
        }
        Ok((lock, files))
    }

    /// Takes the folder: while the lock is held, no other process writes a record into it.
    ///
    /// # Errors
    /// [`RecordError`] if another process has it.
    pub fn lock(&self) -> Result<RunLock, RecordError> {
        let path = self.file(LOCK);
        if path.is_symlink() {
            return Err(is_link(&path));
        }
        // The file stays: two processes that make it anew would lock two different ones.
        let file = File::options().create(true).append(true).open(&path);
        let file = file.map_err(|error| self.failed("lock", &error))?;
        self.try_lock(file)
    }

    /// Takes the lock of the launcher, if the run was launched: it is held for the whole launch, and the processes of the launch
    /// take the folder one after the other.
    ///
    /// # Errors
    /// [`RecordError`] if a launcher has it.
    pub fn lock_of_launcher(&self) -> Result<Option<RunLock>, RecordError> {
        // The file that a launcher writes anyway is its lock: a run that was not launched has none.
        match File::open(self.file(LAUNCHED)) {
            Ok(file) => self.try_lock(file).map(Some),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(self.failed("lock", &error)),
        }
    }

    fn try_lock(&self, file: File) -> Result<RunLock, RecordError> {
        file.try_lock().map_err(|_| {
            let path = self.path.display();
            RecordError::folder(format!("the run in {path} is in progress"))
                .with_help("choose another --run, or end it with `cars ctl stop`")
        })?;
        Ok(RunLock { _file: file })
    }

    /// Files of epochs that `init` has ended.
    fn superseded(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(&self.path)
            .into_iter()
            .flatten()
            .flatten()
        {
            let name = entry.file_name();
            let name = name.to_str().unwrap_or_default();
            let mut prefixes = PER_EPOCH.iter().map(|file| superseded_prefix(file));
            if prefixes.any(|prefix| name.starts_with(&prefix)) {
                files.push(entry.path());
            }
        }

        files
    }

    /// Renames the files of the epoch before this one, so that their names contain its number.
    pub fn supersede(&self, epoch: Epoch) -> Result<(), RecordError> {
        let before = epoch.saturating_sub(1);
        for name in PER_EPOCH {
            let file = self.file(name);
            if !file.exists() {
                continue;
            }

            let renamed = self.file(&superseded_name(name, before));
            // To rename would replace it: a record is never overwritten.
            if renamed.symlink_metadata().is_ok() {
                let error = ErrorKind::AlreadyExists.into();
                return Err(self.failed("keep files in", &error));
            }
            std::fs::rename(&file, renamed)
                .map_err(|error| self.failed("keep files in", &error))?;
        }

        // That of an epoch that has ended would say that the new one has.
        remove_if_there(&self.file(SUMMARY)).map_err(|error| self.failed("clear", &error))
    }

    /// The log, the name of which is in the scenario of the run.
    #[must_use]
    pub fn log(&self) -> PathBuf {
        let scenario = std::fs::read_to_string(self.file(SCENARIO)).unwrap_or_default();
        let scenario: toml::Table = toml::from_str(&scenario).unwrap_or_default();
        let record = scenario.get("record");
        let name = record.and_then(|record| record.get("log_name")?.as_str());
        let name = name.filter(|name| check_log_name(name).is_ok());
        self.file(name.unwrap_or(LOG))
    }

    /// Writes a file of one line that others wait for: they see it whole or not at all.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn write_line(&self, name: &str, line: &str) -> Result<(), RecordError> {
        self.write(name, &format!("{line}\n"))
    }

    /// Writes a file, which appears under its name when it is complete.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written, or a link has its name.
    pub fn write(&self, name: &str, text: &str) -> Result<(), RecordError> {
        let path = self.file(name);
        if path.is_symlink() {
            return Err(is_link(&path));
        }

        // On the disk under another name first: a crash leaves the file before or the new one, and no
        // half.
        let new = with_ending(&path, NEW);
        // A process that was killed may have left it.
        let written = remove_if_there(&new)
            .and_then(|()| write_new(&new, text))
            .and_then(|()| std::fs::rename(&new, &path));
        written.map_err(|error| {
            let _is_not_there = std::fs::remove_file(&new);
            RecordError::folder(format!("cannot write {}: {error}", path.display()))
        })
    }

    /// A file of the folder.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The folder itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The records of all epochs of the run, the first epoch first. The files of the last one may be missing.
    #[must_use]
    pub fn epochs(&self) -> Vec<EpochFiles> {
        let last = self.last_epoch();
        let mut epochs = Vec::new();
        for epoch in 1..last.epoch {
            epochs.push(EpochFiles {
                epoch,
                scenario: self.file(&superseded_name(SCENARIO, epoch)),
                events: self.file(&superseded_name(EVENTS, epoch)),
                recording: self.file(&superseded_name(RECORDING, epoch)),
            });
        }
        epochs.push(last);
        epochs
    }

    /// The record of the last epoch.
    fn last_epoch(&self) -> EpochFiles {
        // Counted from the files, so that there is no number that could disagree with them.
        let is_superseded = |epoch: &Epoch| self.file(&superseded_name(EVENTS, *epoch)).exists();
        let superseded = (1..).take_while(is_superseded).count();
        EpochFiles {
            epoch: superseded as Epoch + 1,
            scenario: self.file(SCENARIO),
            events: self.file(EVENTS),
            recording: self.file(RECORDING),
        }
    }

    fn failed(&self, doing: &str, error: &std::io::Error) -> RecordError {
        RecordError::folder(format!("cannot {doing} {}: {error}", self.path.display()))
    }
}

/// The lock of a run's folder. The operating system releases it when the process ends, also by a crash.
#[derive(Debug)]
pub struct RunLock {
    _file: File,
}

/// Checks that no entry of a folder is a link, symbolic or hard: what is written to one would be written elsewhere, too. There may be
/// no such folder.
///
/// # Errors
/// [`RecordError`] if the folder is a link, or has one.
pub fn check_no_links(folder: &Path) -> Result<(), RecordError> {
    if folder.is_symlink() {
        return Err(is_link(folder));
    }

    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(RecordError::unreadable(folder, &error)),
    };
    for entry in entries {
        let entry = entry.map_err(|error| RecordError::unreadable(folder, &error))?;
        let path = entry.path();
        let found = match path.symlink_metadata() {
            Ok(found) => found,
            // A program that writes there has given its draft the final name since.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(RecordError::unreadable(&path, &error)),
        };
        if found.is_symlink() {
            return Err(is_link(&path));
        }
        // Each folder has several links by nature, its own `.` among them.
        if found.is_file() && found.nlink() > 1 {
            return Err(has_hard_links(&path));
        }
    }
    Ok(())
}

fn is_link(path: &Path) -> RecordError {
    let place = path.display();
    RecordError::folder(format!(
        "{place} is a link, and nothing is written through one"
    ))
    .with_help("put what it leads to in its place, or choose another folder")
}

fn has_hard_links(path: &Path) -> RecordError {
    let place = path.display();
    RecordError::folder(format!(
        "{place} has a second name elsewhere (a hard link), and what is written to it would change that, too"
    ))
    .with_help("copy the folder without links, as `cp -r` does, and take the copy")
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut path = path.as_os_str().to_owned();
    path.push(ending);
    path.into()
}

/// Writes a file that must not exist, to the disk.
fn write_new(path: &Path, text: &str) -> std::io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_data()
}

fn remove_if_there(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// The name that a file has after the end of its epoch, as in `events-epoch1.jsonl`.
fn superseded_name(file: &str, epoch: Epoch) -> String {
    let prefix = superseded_prefix(file);
    let suffix = file.rsplit('.').next().unwrap_or_default();
    format!("{prefix}{epoch}.{suffix}")
}

fn superseded_prefix(file: &str) -> String {
    format!("{}-epoch", file.split('.').next().unwrap_or(file))
}
