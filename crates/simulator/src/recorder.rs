//! The folder of a run. Everything in it is written as it happens: a crash loses at most the current tick.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use protocol::messages::LogRecord;
use protocol::{Epoch, RunName};

use crate::diagnostic::FileError;
use crate::event::log_line;
use crate::scenario::Scenario;
use crate::simulation::{Simulation, TickRecord};
use crate::summary::Summary;

/// File names within a run's folder.
pub const SCENARIO: &str = "scenario.toml";
/// What happened, for machines.
pub const EVENTS: &str = "events.jsonl";
/// What happened, for people.
pub const LOG: &str = "cars.log";
/// What came of it.
pub const SUMMARY: &str = "summary.json";
/// What each process printed.
pub const LOGS: &str = "logs";
/// Where the simulator of a run in progress listens.
pub const ENDPOINT: &str = "endpoint";
/// Held by the process that writes the record, as long as it lives.
const LOCK: &str = ".lock";

/// The folder of a run: `OUT/NAME`.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// The folder of run `run` under `out`.
    #[must_use]
    pub fn new(out: &Path, run: &RunName) -> Self {
        Self { path: out.join(run.as_str()) }
    }

    /// A folder that is known by its path.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self { path }
    }

    /// Makes the folder, empty of an earlier run with this name, and writes the resolved scenario into it.
    ///
    /// The folder is the caller's as long as the returned lock lives: nobody overwrites a run in progress.
    ///
    /// # Errors
    /// [`FileError`] if that cannot be done, if the folder holds something that is not a run, or a run in progress.
    pub fn create(&self, scenario: &Scenario) -> Result<RunLock, FileError> {
        if self.path.exists() && !self.file(SCENARIO).exists() && has_entries(&self.path) {
            let text = format!("{} is there and is not the folder of a run", self.path.display());
            return Err(FileError::new(text).with_help("choose another --run or --out, or move it away"));
        }
        std::fs::create_dir_all(self.file(LOGS)).map_err(|error| self.failed("make", &error))?;
        let lock = self.lock()?;
        for file in
            self.superseded_events().into_iter().chain([EVENTS, LOG, SUMMARY, ENDPOINT].map(|f| self.file(f)))
        {
            if file.exists() {
                std::fs::remove_file(&file).map_err(|error| self.failed("clear", &error))?;
            }
        }
        std::fs::write(self.file(SCENARIO), scenario.to_toml()?)
            .map_err(|error| self.failed("write", &error))?;
        Ok(lock)
    }

    fn lock(&self) -> Result<RunLock, FileError> {
        let file = File::create(self.file(LOCK)).map_err(|error| self.failed("lock", &error))?;
        file.try_lock().map_err(|_| {
            FileError::new(format!("the run in {} is in progress", self.path.display()))
                .with_help("choose another --run, or end it with `cars ctl stop`")
        })?;
        Ok(RunLock { _file: file })
    }

    /// Event files of epochs that `init` ended.
    fn superseded_events(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        let is_superseded = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with("events-epoch")
        };
        entries.map(|entry| entry.path()).filter(is_superseded).collect()
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

    fn failed(&self, doing: &str, error: &std::io::Error) -> FileError {
        FileError::new(format!("cannot {doing} {}: {error}", self.path.display()))
    }
}

/// The right to write a run's folder; the operating system takes it back when the process ends, however it ends.
#[derive(Debug)]
pub struct RunLock {
    _file: File,
}

fn has_entries(path: &Path) -> bool {
    std::fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some())
}

/// Writes one epoch into its folder.
pub struct Recorder {
    folder: RunFolder,
    events: BufWriter<File>,
    log: BufWriter<File>,
    summary: Summary,
}

impl Recorder {
    /// Begins an epoch. The events of an epoch before it are kept under its number, `events-epoch1.jsonl`.
    ///
    /// # Errors
    /// [`FileError`] if the files cannot be made.
    pub fn begin(folder: &RunFolder, run: &RunName, simulation: &Simulation) -> Result<Self, FileError> {
        let (events, epoch) = (folder.file(EVENTS), simulation.epoch());
        if events.exists() {
            let kept = folder.file(&superseded(epoch.saturating_sub(1)));
            std::fs::rename(&events, kept).map_err(|error| folder.failed("keep events in", &error))?;
        }
        let make = |name| File::create(folder.file(name)).map_err(|error| folder.failed("write to", &error));
        let append = File::options().create(true).append(true).open(folder.file(LOG));
        let log = append.map_err(|error| folder.failed("write to", &error))?;
        Ok(Self {
            folder: folder.clone(),
            events: BufWriter::new(make(EVENTS)?),
            log: BufWriter::new(log),
            summary: Summary::begin(run, simulation),
        })
    }

    /// Writes a tick; returns the lines of the readable log, for observers.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be written.
    pub fn write(
        &mut self,
        simulation: &Simulation,
        record: &TickRecord,
    ) -> Result<Vec<LogRecord>, FileError> {
        let failed =
            |error: std::io::Error| FileError::new(format!("cannot write the record of the run: {error}"));
        let mut lines = Vec::new();
        for line in record.lines() {
            writeln!(self.events, "{}", line.to_json()).map_err(failed)?;
            self.summary.count(simulation, &line);
            if let Some((source, kind, text)) = line.event.readable() {
                let time_s = simulation.time_s(line.tick);
                lines.push(LogRecord {
                    epoch: simulation.epoch(),
                    tick: line.tick,
                    time_s,
                    source,
                    kind,
                    text,
                });
            }
        }
        for line in &lines {
            writeln!(self.log, "{}", log_line(line)).map_err(failed)?;
        }
        self.events.flush().map_err(failed)?;
        if !lines.is_empty() {
            self.log.flush().map_err(failed)?;
        }
        Ok(lines)
    }

    /// What has been counted so far.
    #[must_use]
    pub fn summary(&mut self) -> &mut Summary {
        &mut self.summary
    }

    /// Ends the epoch: writes the summary.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be written.
    pub fn finish(mut self, simulation: &Simulation) -> Result<Summary, FileError> {
        self.summary.finish(simulation);
        let text =
            serde_json::to_string_pretty(&self.summary).map_err(|error| FileError::new(error.to_string()))?;
        let file = self.folder.file(SUMMARY);
        std::fs::write(file, text + "\n").map_err(|error| self.folder.failed("write to", &error))?;
        Ok(self.summary)
    }
}

fn superseded(epoch: Epoch) -> String {
    format!("events-epoch{epoch}.jsonl")
}
