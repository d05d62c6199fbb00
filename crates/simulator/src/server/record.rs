//! The record of an epoch: what is written of its ticks, and, while a run that is resumed is executed again, what its record has.

use std::time::Instant;

use environment::{Simulation, TickRecord};
use protocol::RunName;
use protocol::event::WaitedFor;
use protocol::messages::{End, LogRecord};
use record::summary::{Summary, WallSummary};
use record::{RecordError, RunFolder};
use recorder::{Observed, Recorder};

use super::event::{ServerError, StopReason};
use super::replay_log::ReplayLog;

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
}

impl EpochRecord {
    /// Begins the record of an epoch; with a replay log, to write that of an epoch that is resumed once more.
    pub(super) fn begin(
        folder: &RunFolder,
        run: &RunName,
        simulation: &Simulation,
        replay_log: Option<ReplayLog>,
    ) -> Result<Self, RecordError> {
        let mut recorder = match &replay_log {
            None => Recorder::begin(folder, run, simulation)?,
            Some(_) => Recorder::resume(folder, run, simulation)?,
        };

        // With nothing to execute again, the drafts are the record from the beginning.
        let is_empty = replay_log.as_ref().is_some_and(ReplayLog::is_empty);
        if is_empty {
            recorder.supersede_record()?;
        }

        Ok(Self::Open(Box::new(OpenRecord {
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

    /// What is observed of the tick in progress, if ticks are recorded.
    pub(super) fn observed(&mut self) -> Option<&mut Observed> {
        self.open()?.recorder.observed()
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

    /// Notes a tick that is complete; `is_written` if it is to be written at once. Returns the lines of the log, for observers.
    pub(super) fn note(
        &mut self,
        simulation: &Simulation,
        record: &TickRecord,
        opened: Instant,
        is_written: bool,
    ) -> Result<Vec<LogRecord>, RecordError> {
        let Some(open) = self.open() else {
            unreachable!("no tick takes place after the end of a run");
        };

        if let Some(observed) = open.recorder.observed() {
            observed.opened = Some(opened);
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
    pub(super) fn compare(&mut self, record: &TickRecord) -> Result<bool, StopReason> {
        let Self::Open(open) = self else {
            return Ok(false);
        };
        let Some(replay_log) = &mut open.replay_log else {
            return Ok(false);
        };

        // The drafts are left behind then, and the record is as it was.
        if let Some(difference) = replay_log.compare(record)? {
            return Err(StopReason::Failed(ServerError::NotRepeated(difference)));
        }
        let is_last = replay_log.is_empty();
        if is_last {
            open.replay_log = None;
            open.recorder.supersede_record()?;
        }
        Ok(is_last)
    }

    /// Ends the record of an epoch that another one follows.
    pub(super) fn supersede(&mut self) -> Result<(), RecordError> {
        match self.open() {
            Some(open) => open.recorder.supersede(),
            None => Ok(()),
        }
    }

    /// Writes the end of a run that has not ended yet. Returns the lines of the log, and what came of the run.
    pub(super) fn close(
        &mut self,
        end: End,
        waited_for: Vec<WaitedFor>,
        simulation: &mut Simulation,
        wall: WallSummary,
    ) -> Result<(Vec<LogRecord>, Summary), RecordError> {
        let Some(OpenRecord { recorder, .. }) = self.open() else {
            unreachable!("a run ends once");
        };
        // The events get their end before the summary is written: a folder with a summary is one of a
        // run that is over.
        let record = simulation.end_waiting(end, waited_for);
        let lines = recorder.write(simulation, &record)?;

        recorder.summary().wall = wall;
        let summary = recorder.finish(simulation)?;
        *self = Self::Closed(Box::new(summary.clone()));
        Ok((lines, summary))
    }
}
