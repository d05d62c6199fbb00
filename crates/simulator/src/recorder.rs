//! The folder of a run. Everything in it is written as it happens: a crash loses at most the current tick.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use config::FileError;
use protocol::event::log_line;
use protocol::messages::{LogRecord, RecordedRobot, RecordedTick, RecordingHeader};
use protocol::{Epoch, Event, RobotName, RunName};

use crate::files::{LOCK, check_log_name};
use crate::scenario::Scenario;
use crate::simulation::{Simulation, TickRecord};
use crate::summary::Summary;

pub use crate::files::{
    ENDPOINT, EVENTS, LATEST, LOG, LOGS, OPERATOR_CONFIG, RECORDING, SCENARIO, SUMMARY,
};

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

    /// A folder that is known by its path.
    #[must_use]
    pub fn at(path: PathBuf) -> Self {
        Self { path }
    }

    /// Makes the folder, empty of an earlier run with this name, and writes the resolved scenario into it.
    ///
    /// The folder is the caller's as long as the returned lock lives: no other process overwrites a run in progress.
    ///
    /// # Errors
    /// [`FileError`] if that cannot be done, if the folder holds something that is not a run, or a run in progress.
    pub fn create(&self, scenario: &Scenario) -> Result<RunLock, FileError> {
        if self.path.exists() && !self.file(SCENARIO).exists() && has_entries(&self.path) {
            let text = format!(
                "{} is there and is not the folder of a run",
                self.path.display()
            );
            return Err(
                FileError::new(text).with_help("choose another --run or --out, or move it away")
            );
        }

        std::fs::create_dir_all(self.file(LOGS)).map_err(|error| self.failed("make", &error))?;
        let lock = self.lock()?;
        let log = self.log();
        let own =
            [EVENTS, RECORDING, SUMMARY, ENDPOINT, OPERATOR_CONFIG].map(|name| self.file(name));
        for file in self.superseded().into_iter().chain(own).chain([log]) {
            if file.exists() {
                std::fs::remove_file(&file).map_err(|error| self.failed("clear", &error))?;
            }
        }

        self.write_scenario(scenario)?;

        Ok(lock)
    }

    /// The one writer of [`SCENARIO`], once for each epoch.
    fn write_scenario(&self, scenario: &Scenario) -> Result<(), FileError> {
        std::fs::write(self.file(SCENARIO), scenario.to_toml()?)
            .map_err(|error| self.failed("write to", &error))
    }

    /// Points the link [`LATEST`] beside the folder at it. It is a convenience: where links cannot be made, runs are found
    /// by their names.
    pub fn point_latest(&self) {
        let link = self.path.with_file_name(LATEST);
        if link.is_symlink() {
            let _ = std::fs::remove_file(&link);
        }

        let Some(name) = self.path.file_name() else {
            return;
        };

        if let Err(error) = std::os::unix::fs::symlink(name, &link) {
            tracing::debug!(%error, "no link to the latest run");
        }
    }

    fn lock(&self) -> Result<RunLock, FileError> {
        let file = File::create(self.file(LOCK)).map_err(|error| self.failed("lock", &error))?;
        file.try_lock().map_err(|_| {
            FileError::new(format!("the run in {} is in progress", self.path.display()))
                .with_help("choose another --run, or end it with `cars ctl stop`")
        })?;
        Ok(RunLock { _file: file })
    }

    /// Files of epochs that `init` ended.
    fn superseded(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(&self.path)
            .into_iter()
            .flatten()
            .flatten();
        let is_superseded = |path: &PathBuf| {
            let name = path
                .file_name()
                .and_then(|name| name.to_str())
                .unwrap_or_default();
            PER_EPOCH
                .iter()
                .any(|file| name.starts_with(&superseded_prefix(file)))
        };

        entries
            .map(|entry| entry.path())
            .filter(is_superseded)
            .collect()
    }

    /// Keeps the files of the epoch before this one under its number.
    fn keep(&self, epoch: Epoch) -> Result<(), FileError> {
        for name in PER_EPOCH {
            let (file, suffix) = (self.file(name), name.rsplit('.').next().unwrap_or_default());
            if file.exists() {
                let kept = self.file(&format!(
                    "{}{}.{suffix}",
                    superseded_prefix(name),
                    epoch.saturating_sub(1)
                ));
                std::fs::rename(&file, kept)
                    .map_err(|error| self.failed("keep files in", &error))?;
            }
        }

        Ok(())
    }

    /// The readable log, wherever the scenario of the run puts it.
    #[must_use]
    pub fn log(&self) -> PathBuf {
        let scenario = std::fs::read_to_string(self.file(SCENARIO)).unwrap_or_default();
        let scenario: toml::Table = toml::from_str(&scenario).unwrap_or_default();
        let name = scenario
            .get("record")
            .and_then(|record| record.get("log_name")?.as_str());
        self.file(
            name.filter(|name| check_log_name(name).is_ok())
                .unwrap_or(LOG),
        )
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
    log: Option<BufWriter<File>>,
    recording: Option<BufWriter<File>>,
    summary: Summary,
}

impl Recorder {
    /// Begins an epoch in a folder that [`RunFolder::create`] made. What an epoch before it left is kept under its number, `events-epoch1.jsonl`.
    ///
    /// # Errors
    /// [`FileError`] if the files cannot be made.
    pub fn begin(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
    ) -> Result<Self, FileError> {
        let (scenario, epoch) = (simulation.scenario(), simulation.epoch());
        if epoch > 1 {
            folder.keep(epoch)?;
            folder.write_scenario(scenario)?;
        }

        let make = |name| {
            File::create(folder.file(name)).map_err(|error| folder.failed("write to", &error))
        };
        let log = || {
            let file = File::options()
                .create(true)
                .append(true)
                .open(folder.file(&scenario.record.log_name));
            file.map(BufWriter::new)
                .map_err(|error| folder.failed("write to", &error))
        };
        let mut recorder = Self {
            folder: folder.clone(),
            events: BufWriter::new(make(EVENTS)?),
            log: scenario.record.log.then(log).transpose()?,
            recording: scenario
                .record
                .frames
                .then(|| make(RECORDING).map(BufWriter::new))
                .transpose()?,
            summary: Summary::begin(run, simulation),
        };

        if let Some(recording) = &mut recorder.recording {
            writeln!(recording, "{}", json(&header(run, simulation))).map_err(unwritable)?;
        }

        Ok(recorder)
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
        let mut lines = Vec::new();
        for line in record.lines() {
            writeln!(self.events, "{}", line.to_json()).map_err(unwritable)?;
            self.summary.count(simulation, &line);
            if let Some((source, kind, text)) = line.event.readable() {
                let (epoch, tick) = (simulation.epoch(), line.tick);
                let time_s = simulation.time_s(tick);
                lines.push(LogRecord {
                    epoch,
                    tick,
                    time_s,
                    source,
                    kind,
                    text,
                });
            }
        }

        self.events.flush().map_err(unwritable)?;
        self.write_log(&lines).map_err(unwritable)?;

        // The end of a run is no tick of its own.
        if !matches!(record.events.last(), Some(Event::End { .. }))
            && let Some(recording) = &mut self.recording
        {
            writeln!(recording, "{}", json(&recorded(simulation))).map_err(unwritable)?;
            recording.flush().map_err(unwritable)?;
        }

        Ok(lines)
    }

    fn write_log(&mut self, lines: &[LogRecord]) -> std::io::Result<()> {
        let Some(log) = self.log.as_mut().filter(|_| !lines.is_empty()) else {
            return Ok(());
        };
        for line in lines {
            writeln!(log, "{}", log_line(line))?;
        }
        log.flush()
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
        let text = serde_json::to_string_pretty(&self.summary)
            .map_err(|error| FileError::new(error.to_string()))?;
        let file = self.folder.file(SUMMARY);
        std::fs::write(file, text + "\n")
            .map_err(|error| self.folder.failed("write to", &error))?;
        Ok(self.summary)
    }
}

/// Files of which every epoch has its own.
const PER_EPOCH: [&str; 3] = [SCENARIO, EVENTS, RECORDING];

fn superseded_prefix(file: &str) -> String {
    format!("{}-epoch", file.split('.').next().unwrap_or(file))
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn unwritable(error: std::io::Error) -> FileError {
    FileError::new(format!("cannot write the record of the run: {error}"))
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value)
        .unwrap_or_else(|error| unreachable!("a record is always JSON: {error}"))
}

fn header(run: &RunName, simulation: &Simulation) -> RecordingHeader {
    let scenario = simulation.scenario();
    RecordingHeader {
        run: run.clone(),
        epoch: simulation.epoch(),
        seed: scenario.seed,
        tick_s: scenario.tick_s,
        duration_s: scenario.duration_s(),
        field_m: scenario.field_m,
        body_m: scenario.body_m,
        obstacles: scenario.obstacles.iter().map(|at| [at.x, at.y]).collect(),
    }
}

fn recorded(simulation: &Simulation) -> RecordedTick {
    let robot = |name: &RobotName| {
        let report = simulation.report(name)?;
        Some(RecordedRobot {
            name: name.clone(),
            location: simulation.location(name)?,
            speed_mps: report.speed_mps,
            direction_rad: report.direction_rad,
            blocked: simulation.is_blocked(name),
            missed: report.tick != simulation.tick(),
            emotion_state: report.emotion_state.clone(),
            behavior_state: report.behavior_state.clone(),
            state_variables: report.state_variables.clone(),
        })
    };
    let guests = simulation.world().guests().iter();

    RecordedTick {
        tick: simulation.tick(),
        robots: simulation.names().iter().filter_map(robot).collect(),
        guests_mm: guests
            .flat_map(|guest| [guest.x, guest.y])
            .map(|at_m| (at_m * 1000.0).round() as i64)
            .collect(),
    }
}
