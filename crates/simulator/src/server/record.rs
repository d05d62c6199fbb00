//! The record of an epoch: what is written of its ticks, and, while a run that is resumed is executed again, what its record has.

use std::collections::BTreeMap;
use std::time::Instant;

use config::diagnostic::FileError;
use protocol::messages::{Awaited, End, LogRecord, Panel};
use protocol::{RobotName, RunName, Tick};
use record::RunFolder;
use record::summary::{Summary, Wall};

use super::event::{Exit, ServerError};
use super::replay_log::{Comparison, ReplayLog};
use crate::recorder::{Observed, Recorder};
use crate::simulation::{Simulation, TickRecord};
use protocol::event::WaitedFor;

/// Most lines about one tick, of those for whom the clock is held, that are recorded: robots can cause any number.
const MAX_LATE_LINES: usize = 64;

/// The record of an epoch.
pub(super) enum EpochRecord {
    /// It is written.
    Open(Box<OpenRecord>),
    /// The run is over, and this came of it.
    Closed(Box<Summary>),
}

/// A record that is written.
pub(super) struct OpenRecord {
    recorder: Recorder,
    /// What of the record of a run that is resumed has not been executed again. Meanwhile the recorder writes drafts.
    replay_log: Option<ReplayLog>,
    observing: Option<Observing>,
}

/// What is observed of the tick in progress, for the recording.
#[derive(Default)]
struct Observing {
    /// The tick of the last report of each robot, and when the first of that tick arrived.
    reports: BTreeMap<RobotName, (Tick, Instant)>,
    awaited: Vec<Awaited>,
    /// What people were told of the robots for which the clock is held.
    late: Vec<LogRecord>,
    panels: BTreeMap<RobotName, Panel>,
}

impl EpochRecord {
    /// Begins the record of an epoch; with a replay log, to write that of an epoch that is resumed once more.
    pub(super) fn begin(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
        replay_log: Option<ReplayLog>,
    ) -> Result<Self, FileError> {
        let mut recorder = match &replay_log {
            None => Recorder::begin(folder, run, simulation)?,
            Some(_) => Recorder::resume(folder, run, simulation)?,
        };
        let is_empty = replay_log.as_ref().is_some_and(ReplayLog::is_empty);
        if is_empty {
            recorder.supersede_record()?;
        }

        Ok(Self::Open(Box::new(OpenRecord {
            observing: recorder.is_recording().then(Observing::default),
            recorder,
            replay_log: replay_log.filter(|_| !is_empty),
        })))
    }

    fn open(&mut self) -> Option<&mut OpenRecord> {
        match self {
            Self::Open(open) => Some(open),
            Self::Closed(_) => None,
        }
    }

    fn observing(&mut self) -> Option<&mut Observing> {
        self.open()?.observing.as_mut()
    }

    pub(super) fn is_closed(&self) -> bool {
        matches!(self, Self::Closed(_))
    }

    /// What is left of the record of a run that is executed again.
    pub(super) fn replay_log(&self) -> Option<&ReplayLog> {
        match self {
            Self::Open(open) => open.replay_log.as_ref(),
            Self::Closed(_) => None,
        }
    }

    /// Whether the run is executed again up to the end of its record.
    pub(super) fn is_repeating(&self) -> bool {
        self.replay_log().is_some()
    }

    /// A robot's report has arrived.
    pub(super) fn observe_report(&mut self, robot: &RobotName, tick: Tick) {
        let Some(observing) = self.observing() else {
            return;
        };
        // The first one counts: a report is repeated when a clock is.
        let is_known = observing
            .reports
            .get(robot)
            .is_some_and(|last| last.0 == tick);
        if !is_known {
            let arrived = (tick, Instant::now());
            observing.reports.insert(robot.clone(), arrived);
        }
    }

    pub(super) fn observe_panel(&mut self, robot: RobotName, panel: Panel) {
        if let Some(observing) = self.observing() {
            observing.panels.insert(robot, panel);
        }
    }

    pub(super) fn observe_awaited(&mut self, awaited: &[Awaited]) {
        if let Some(observing) = self.observing() {
            observing.awaited = awaited.to_vec();
        }
    }

    /// People were told of the robots for which the clock is held.
    pub(super) fn observe_late(&mut self, line: LogRecord) {
        if let Some(observing) = self.observing()
            && observing.late.len() < MAX_LATE_LINES
        {
            observing.late.push(line);
        }
    }

    /// Notes a tick that is complete; `is_written` if it is to be written at once. Returns the lines of the log, for observers.
    pub(super) fn note(
        &mut self,
        simulation: &Simulation,
        record: &TickRecord,
        opened: Instant,
        is_written: bool,
    ) -> Result<Vec<LogRecord>, FileError> {
        let Some(open) = self.open() else {
            unreachable!("no tick takes place after the end of a run");
        };
        if let Some(observing) = &mut open.observing {
            open.recorder.observe(observing.take(record.tick, opened));
        }
        let lines = open.recorder.note(simulation, record)?;
        if is_written {
            open.recorder.write_noted()?;
        }
        Ok(lines)
    }

    /// The recorder, if it has a tick that is complete and not written.
    pub(super) fn pending(&mut self) -> Option<&mut Recorder> {
        let recorder = &mut self.open()?.recorder;
        recorder.has_noted().then_some(recorder)
    }

    /// Compares a tick of a run that is executed again with its record. Returns whether it was the last one: then the drafts have
    /// taken the place of the record.
    pub(super) fn compare(&mut self, record: &TickRecord) -> Result<bool, Exit> {
        let Self::Open(open) = self else {
            return Ok(false);
        };
        let Some(replay_log) = &mut open.replay_log else {
            return Ok(false);
        };

        match replay_log.compare(record)? {
            Comparison::Same => Ok(false),
            Comparison::Different(difference) => {
                Err(Exit::Failed(ServerError::NotRepeated(difference)))
            }
            Comparison::Last => {
                open.replay_log = None;
                open.recorder.supersede_record()?;
                Ok(true)
            }
        }
    }

    /// Ends the record of an epoch that another one follows.
    pub(super) fn supersede(&mut self) -> Result<(), FileError> {
        match self.open() {
            Some(open) => open.recorder.supersede(),
            None => Ok(()),
        }
    }

    /// Writes the end of the run. Returns the lines of the log.
    pub(super) fn close(
        &mut self,
        end: End,
        waited_for: Vec<WaitedFor>,
        simulation: &mut Simulation,
        wall: Wall,
    ) -> Result<Vec<LogRecord>, FileError> {
        let Some(OpenRecord { recorder, .. }) = self.open() else {
            return Ok(Vec::new());
        };
        let record = simulation.end_waiting(end, waited_for);
        let lines = recorder.write(simulation, &record)?;

        recorder.summary().wall = wall;
        let summary = recorder.finish(simulation)?;
        *self = Self::Closed(Box::new(summary));
        Ok(lines)
    }
}

impl Observing {
    /// Takes what was observed of a tick that is complete.
    fn take(&mut self, tick: Tick, opened: Instant) -> Observed {
        let mut reports = BTreeMap::new();
        for (robot, (reported, arrived)) in &self.reports {
            if *reported == tick {
                reports.insert(robot.clone(), *arrived);
            }
        }

        Observed {
            opened,
            reports,
            awaited: std::mem::take(&mut self.awaited),
            late: std::mem::take(&mut self.late),
            panels: std::mem::take(&mut self.panels),
        }
    }
}
