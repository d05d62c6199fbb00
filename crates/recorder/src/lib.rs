//! Writes the record of a run, of one process as over the bus. The events of every tick are written at once, so a crash of the
//! simulator loses at most the current one, and of the recording the current chunk; `record.sync` in the scenario says when they
//! also survive a crash of the machine.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use protocol::event::log_line;
use protocol::messages::{Awaited, LogRecord, Panel};
use protocol::{Line, RobotName, RunName, Tick};
use recording::{RecordedTick, WallTimes, WriteError, Writer};

use environment::recorded::{header, set_frame};
use environment::{Simulation, TickRecord};
use record::Record;
use record::folder::DRAFT;
use record::seal::Seal;
use record::summary::Summary;
use scenario::SyncPoint;

use record::names::{EVENTS, RECORDING, SUMMARY};
use record::{RecordError, RunFolder};

/// How often [`SyncPoint::Second`] synchronizes.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);

/// A file of the record. Its errors name it.
struct LineFile {
    path: PathBuf,
    file: BufWriter<File>,
}

impl LineFile {
    fn open(path: PathBuf, options: &OpenOptions) -> Result<Self, RecordError> {
        match options.open(&path) {
            Ok(file) => Ok(Self {
                path,
                file: BufWriter::new(file),
            }),
            Err(error) => Err(unwritable(&path, &error)),
        }
    }

    /// A new file: one that is there belongs to another record, or is a link.
    fn create(path: PathBuf) -> Result<Self, RecordError> {
        Self::open(path, File::options().create_new(true).write(true))
    }

    /// A file that grows from epoch to epoch.
    fn append(path: PathBuf) -> Result<Self, RecordError> {
        // To append follows links, and the line would be written elsewhere.
        if path.is_symlink() {
            return Err(unwritable(&path, &"it is a link"));
        }
        Self::open(path, File::options().create(true).append(true))
    }

    fn add(&mut self, line: &str) -> Result<(), RecordError> {
        writeln!(self.file, "{line}").map_err(|error| unwritable(&self.path, &error))
    }

    /// Hands everything to the operating system.
    fn flush(&mut self) -> Result<(), RecordError> {
        self.file
            .flush()
            .map_err(|error| unwritable(&self.path, &error))
    }

    /// Waits until everything is on the disk.
    fn sync(&self) -> Result<(), RecordError> {
        self.file
            .get_ref()
            .sync_data()
            .map_err(|error| unwritable(&self.path, &error))
    }
}

/// What is observed of the tick in progress beside its record. It differs from run to run, and nothing compares it.
#[derive(Debug, Default)]
pub struct Observed {
    /// When the tick was opened; `None` if its times are not recorded.
    pub opened: Option<Instant>,
    /// The tick of the last report of each robot, and when the first one of that tick arrived.
    reports: BTreeMap<RobotName, (Tick, Instant)>,
    /// Robots for which the clock was held.
    pub awaited: Vec<Awaited>,
    /// Lines of the log about that.
    late: Vec<LogRecord>,
    /// The newest panel of each robot from which one arrived.
    pub panels: BTreeMap<RobotName, Panel>,
}

/// Most lines about one tick, of those for whom the clock is held, that are recorded: robots can cause any number.
const MAX_LATE_LINES: usize = 64;

impl Observed {
    /// A robot's report arrives now. A report that is repeated, because its clock was, arrived when it did first.
    pub fn report(&mut self, robot: &RobotName, tick: Tick) {
        let is_known = self.reports.get(robot).is_some_and(|last| last.0 == tick);
        if !is_known {
            self.reports.insert(robot.clone(), (tick, Instant::now()));
        }
    }

    /// People were told for which robots the clock is held, or that it goes on.
    pub fn late(&mut self, line: LogRecord) {
        if self.late.len() < MAX_LATE_LINES {
            self.late.push(line);
        }
    }

    /// Takes the times of a tick that is complete now, and what is about it alone.
    fn take(&mut self, tick: Tick, begun: Instant) -> (WallTimes, BTreeMap<RobotName, Panel>) {
        // Each tick has the panels that arrived in it, whether its times are recorded or not.
        let panels = std::mem::take(&mut self.panels);
        let Some(opened) = self.opened.take() else {
            return (WallTimes::default(), panels);
        };

        let since = |time: Instant| time.saturating_duration_since(begun).as_nanos() as u64;
        let reports = self.reports.iter();
        let wall = WallTimes {
            opened_ns: since(opened),
            completed_ns: since(Instant::now()),
            reports_ns: reports
                .filter(|(_, (reported, _))| *reported == tick)
                .map(|(robot, (_, arrived))| (robot.clone(), since(*arrived)))
                .collect(),
            awaited: std::mem::take(&mut self.awaited),
            late: std::mem::take(&mut self.late),
        };
        (wall, panels)
    }
}

/// A tick that was noted and is not written: all that writing it needs.
struct PendingTick {
    record: TickRecord,
    lines: Vec<LogRecord>,
    /// `None` if the recording is to have no tick: for the end of the run, or without a recording.
    recorded: Option<RecordedTick>,
}

/// Writes the record of one epoch.
pub struct Recorder {
    folder: RunFolder,
    events: LineFile,
    /// The lines of `events` so far.
    seal: Seal,
    log: Option<LineFile>,
    recording: Option<Writer>,
    /// What was noted and is not written.
    noted: Option<PendingTick>,
    begun: Instant,
    /// Of the tick that is noted next, if every tick is recorded.
    observed: Option<Observed>,
    sync: SyncPoint,
    synced_at: Instant,
    summary: Summary,
    /// Names of files that are to replace those of the record of a run that is resumed.
    drafts: Vec<String>,
}

impl Recorder {
    /// Begins an epoch in a folder that [`RunFolder::make`] made. The files of an earlier epoch are renamed, as in
    /// `events-epoch1.jsonl`.
    ///
    /// # Errors
    /// [`RecordError`] if the files cannot be made.
    pub fn begin(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
    ) -> Result<Self, RecordError> {
        let scenario = simulation.scenario();
        let epoch = simulation.epoch();
        // The files of the epoch before are out of the way first: new ones are made only where there is
        // nothing.
        if epoch > 1 {
            folder.supersede(epoch)?;
            folder.write_scenario(scenario)?;
        }

        let record = &scenario.record;
        let path = folder.file(&record.log_name);
        // The log of a run goes on from epoch to epoch, under one name.
        let log = record.log.then(|| match epoch {
            1 => LineFile::create(path),
            _ => LineFile::append(path),
        });
        Self::open(folder, run, simulation, log.transpose()?, "")
    }

    /// Begins to write the record of an epoch once more, into drafts: [`Self::supersede_record`] puts them in the place of the
    /// record when they have all of it. Until then, and if they never do, the record is as it was.
    ///
    /// # Errors
    /// [`RecordError`] if the files cannot be made.
    pub fn resume(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
    ) -> Result<Self, RecordError> {
        let record = &simulation.scenario().record;
        let log_name = format!("{}{DRAFT}", record.log_name);
        for name in [EVENTS, RECORDING, &record.log_name] {
            remove_draft(&folder.file(&format!("{name}{DRAFT}")))?;
        }

        let mut log = None;
        if record.log {
            let mut draft = LineFile::create(folder.file(&log_name))?;
            copy_log_of_earlier_epochs(folder, &record.log_name, &mut draft)?;
            log = Some(draft);
        }
        let mut recorder = Self::open(folder, run, simulation, log, DRAFT)?;

        // Only what was opened: each of these takes the place of its file, and no other file is
        // touched.
        recorder.drafts.push(EVENTS.to_owned());
        if recorder.log.is_some() {
            recorder.drafts.push(record.log_name.clone());
        }
        if recorder.recording.is_some() {
            recorder.drafts.push(RECORDING.to_owned());
        }
        Ok(recorder)
    }

    /// Opens the files of the record, whose names end with `suffix`.
    fn open(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
        log: Option<LineFile>,
        suffix: &str,
    ) -> Result<Self, RecordError> {
        let record = &simulation.scenario().record;
        let mut recording = None;
        if record.frames {
            let path = folder.file(&format!("{RECORDING}{suffix}"));
            if path.symlink_metadata().is_ok() {
                return Err(unwritable(&path, &"it exists already"));
            }
            let scenario = simulation.scenario().to_toml()?;
            let writer = Writer::create(&path, &header(run, simulation), &scenario);
            recording = Some(writer.map_err(|error| unrecordable(&error))?);
        }

        Ok(Self {
            folder: folder.clone(),
            events: LineFile::create(folder.file(&format!("{EVENTS}{suffix}")))?,
            seal: Seal::default(),
            log,
            observed: recording.is_some().then(Observed::default),
            recording,
            noted: None,
            begun: Instant::now(),
            sync: record.sync,
            synced_at: Instant::now(),
            summary: simulation.begin_summary(run),
            drafts: Vec::new(),
        })
    }

    /// Puts the drafts of a run that is resumed in the place of its record.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be written or renamed.
    pub fn supersede_record(&mut self) -> Result<(), RecordError> {
        // All drafts are on the disk before the first takes the place of a file: a crash in between leaves the events of one and the
        // recording of the other, which are the same up to the end of the older one.
        self.write_noted()?;
        self.sync()?;
        for name in std::mem::take(&mut self.drafts) {
            let draft = self.folder.file(&format!("{name}{DRAFT}"));
            std::fs::rename(&draft, self.folder.file(&name))
                .map_err(|error| unwritable(&draft, &error))?;
        }
        Ok(())
    }

    /// What is observed of the tick that is noted next; `None` if ticks are not recorded.
    #[must_use]
    pub fn observed(&mut self) -> Option<&mut Observed> {
        self.observed.as_mut()
    }

    /// Writes a tick. Returns the lines of the log, for observers.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn write(
        &mut self,
        simulation: &Simulation,
        record: &TickRecord,
    ) -> Result<Vec<LogRecord>, RecordError> {
        let lines = self.note(simulation, record)?;
        self.write_noted()?;
        Ok(lines)
    }

    /// Notes all that is recorded of a tick, so that the next one may begin before [`Self::write_noted`] writes it; with
    /// `sync = "tick"` it is written here. Returns the lines of the log, for observers.
    ///
    /// # Errors
    /// [`RecordError`] if it, or the tick that was noted before, cannot be written.
    pub fn note(
        &mut self,
        simulation: &Simulation,
        record: &TickRecord,
    ) -> Result<Vec<LogRecord>, RecordError> {
        // One tick is noted at most, so they are written in their order.
        self.write_noted()?;

        let mut lines = Vec::new();
        let tick_s = simulation.scenario().tick_s;
        for event in record.events.iter() {
            simulation.count(&mut self.summary, record.tick, event);
            lines.extend(event.log_record(simulation.epoch(), record.tick, tick_s));
        }
        let observed = self.observed.as_mut();
        let taken = observed.map(|observed| observed.take(record.tick, self.begun));
        let (wall, panels) = taken.unwrap_or_default();
        let recording = self.recording.as_ref().filter(|_| !record.is_end());
        let recorded = recording.map(|recording| {
            let mut tick = recording.spare();
            set_frame(&mut tick.frame, simulation, record);
            tick.events = record.events.clone();
            tick.reports = simulation
                .reports_of(record.tick, |_| true)
                .into_iter()
                .collect();
            tick.panels = panels;
            tick.wall = wall;
            tick
        });

        self.noted = Some(PendingTick {
            record: record.clone(),
            lines: lines.clone(),
            recorded,
        });
        // Such a tick is on the disk before the next one begins.
        if matches!(self.sync, SyncPoint::Tick) {
            self.write_noted()?;
        }
        Ok(lines)
    }

    /// Whether a tick is noted and not written.
    #[must_use]
    pub fn has_noted(&self) -> bool {
        self.noted.is_some()
    }

    /// Writes the tick that was noted, if it is not written yet.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn write_noted(&mut self) -> Result<(), RecordError> {
        let Some(noted) = self.noted.take() else {
            return Ok(());
        };

        // The events of the end belong to the last tick, which is recorded already. The recording is finished first: a record
        // whose events have an end is whole.
        let is_end = noted.record.is_end();
        if is_end && let Some(recording) = self.recording.take() {
            finish(recording, &noted.record).map_err(|error| unrecordable(&error))?;
        }

        // Events before what is written beside them: what a reader sees of a tick elsewhere has its events.
        for line in noted.record.lines() {
            self.add_event(&line)?;
        }
        // Handed to the system at once: a crash of this process does not lose them.
        self.events.flush()?;
        if noted.record.tick == 0 && !is_end {
            self.folder.forget_replaced()?;
        }
        self.write_log(&noted.lines)?;

        if let (Some(recording), Some(tick)) = (&mut self.recording, noted.recorded) {
            recording.tick(tick).map_err(|error| unrecordable(&error))?;
        }

        if is_end || self.is_sync_due() {
            self.sync()?;
        }
        Ok(())
    }

    fn add_event(&mut self, line: &Line) -> Result<(), RecordError> {
        let mut text = line.to_json();
        if line.event.is_sealed() {
            // The seal is about all lines before and the beginning of this one; then the whole line
            // counts for the next.
            text = self.seal.seal(&text);
        }
        self.seal.add(text.as_bytes());
        self.events.add(&text)
    }

    fn write_log(&mut self, lines: &[LogRecord]) -> Result<(), RecordError> {
        let Some(log) = self.log.as_mut().filter(|_| !lines.is_empty()) else {
            return Ok(());
        };
        for line in lines {
            log.add(&log_line(line))?;
        }
        log.flush()
    }

    fn is_sync_due(&self) -> bool {
        match self.sync {
            SyncPoint::Tick => true,
            SyncPoint::Second => self.synced_at.elapsed() >= SYNC_INTERVAL,
            SyncPoint::End => false,
        }
    }

    fn sync(&mut self) -> Result<(), RecordError> {
        self.events.sync()?;
        if let Some(log) = &self.log {
            log.sync()?;
        }
        if let Some(recording) = &mut self.recording {
            recording.sync().map_err(|error| unrecordable(&error))?;
        }

        self.synced_at = Instant::now();
        Ok(())
    }

    /// The summary so far.
    #[must_use]
    pub fn summary(&mut self) -> &mut Summary {
        &mut self.summary
    }

    /// Ends an epoch that another one follows.
    ///
    /// # Errors
    /// [`RecordError`] if what remains to be recorded cannot be written.
    pub fn supersede(&mut self) -> Result<(), RecordError> {
        match self.recording.take() {
            Some(recording) => recording.finish().map_err(|error| unrecordable(&error)),
            None => Ok(()),
        }
    }

    /// Ends the epoch and writes the summary.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub fn finish(&mut self, simulation: &Simulation) -> Result<Summary, RecordError> {
        simulation.finish_summary(&mut self.summary);
        if !self.drafts.is_empty() {
            // The run was ended before it was resumed: its record is as it was.
            return Ok(self.summary.clone());
        }

        let text = self.summary.seal().map_err(RecordError::folder)?;
        self.folder.write_line(SUMMARY, &text)?;
        Ok(self.summary.clone())
    }
}

/// Removes a draft that a process left which was killed.
fn remove_draft(path: &Path) -> Result<(), RecordError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(unwritable(path, &error)),
        _ => Ok(()),
    }
}

/// Copies the lines of the log that are of epochs before the last one: a line for each event that people read.
fn copy_log_of_earlier_epochs(
    folder: &RunFolder,
    log: &str,
    to: &mut LineFile,
) -> Result<(), RecordError> {
    let mut epochs = folder.epochs();
    epochs.pop();
    // The log has no mark where an epoch begins, so its lines are counted by the events that they are
    // made of.
    let mut count = 0;
    for files in epochs {
        let mut record = Record::of_events(&files.events)?;
        while let Some(entry) = record.next_entry()? {
            let lines = entry.events.iter();
            let lines = lines.filter_map(|event| event.log_record(files.epoch, entry.tick, 0.0));
            count += lines.count();
        }
    }
    if count == 0 {
        return Ok(());
    }

    let path = folder.file(log);
    let file = File::open(&path).map_err(|error| RecordError::unreadable(&path, &error))?;
    for line in BufReader::new(file).lines().take(count) {
        to.add(&line.map_err(|error| RecordError::unreadable(&path, &error))?)?;
    }
    Ok(())
}

/// Ends a recording with the events of the end of the run.
fn finish(mut recording: Writer, end: &TickRecord) -> Result<(), WriteError> {
    for event in end.events.iter() {
        recording.end(end.tick, event.clone())?;
    }
    recording.finish()
}

fn unwritable(path: &Path, error: &dyn std::fmt::Display) -> RecordError {
    let place = path.display();
    RecordError::folder(format!("cannot write {place}: {error}")).with_help(format!(
        "what was recorded before is kept; `cars check {}` says how far it is good",
        path.parent().unwrap_or(path).display()
    ))
}

fn unrecordable(error: &WriteError) -> RecordError {
    unwritable(&error.path, &error.error)
}
