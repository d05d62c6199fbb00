//! The record of a run that is resumed. Up to its end the server executes the run again, as fast as the robots answer, and
//! compares every tick with the record.

use config::FileError;
use protocol::{Epoch, RobotName};

use crate::difference::{Difference, between};
use crate::files::EpochFiles;
use crate::record::{Entry, Record};
use crate::simulation::TickRecord;

/// What is left of the record of a run that is resumed.
pub struct Past {
    epoch: Epoch,
    record: Option<Record>,
    /// The tick that is executed next; `None` if no tick was completed.
    next: Option<Entry>,
}

/// How a tick that was executed again compares with the record.
pub(super) enum Repeated {
    /// It is the same, and there are more.
    Same,
    /// It is the same, and the last one of the record.
    Last,
    /// It is not the same.
    Different(Box<Difference>),
}

impl Past {
    /// The record of an epoch.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read.
    pub fn open(files: &EpochFiles) -> Result<Self, FileError> {
        let mut record = None;
        let mut next = None;
        if files.events.exists() {
            let mut events = Record::of_events(&files.events)?;
            next = next_tick(&mut events)?;
            record = Some(events);
        }
        Ok(Self {
            epoch: files.epoch,
            record,
            next,
        })
    }

    /// The epoch of the record.
    pub(super) fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Whether no tick was completed, so that there is nothing to execute again.
    pub(super) fn is_empty(&self) -> bool {
        self.next.is_none()
    }

    /// The operator's commands that were sent before the next tick.
    pub(super) fn commands(&self) -> Vec<(RobotName, String)> {
        let operator = RobotName::operator();
        let next = self.next.iter();
        let sent = next.flat_map(|entry| entry.commands_of(&operator));
        sent.map(|sent| (sent.to, sent.command.command)).collect()
    }

    /// What was set by hand before the next tick.
    pub(super) fn changes_by_hand(&self) -> Vec<String> {
        let next = self.next.iter();
        next.flat_map(Entry::changes_by_hand).collect()
    }

    /// Compares a tick that was executed again.
    ///
    /// # Errors
    /// [`FileError`] if the record cannot be read on.
    pub(super) fn compare(&mut self, executed: &TickRecord) -> Result<Repeated, FileError> {
        let executed = Entry {
            tick: executed.tick,
            events: executed.events.clone(),
            reports: None,
        };
        let recorded = self.next.take().unwrap_or_default();
        if let Some(difference) = between(&recorded, &executed) {
            return Ok(Repeated::Different(Box::new(difference)));
        }

        if let Some(record) = &mut self.record {
            self.next = next_tick(record)?;
        }
        if self.is_empty() {
            Ok(Repeated::Last)
        } else {
            Ok(Repeated::Same)
        }
    }
}

/// The next tick of a record. The end of a run that was stopped is none: the run goes on after its last tick.
fn next_tick(record: &mut Record) -> Result<Option<Entry>, FileError> {
    let next = record.next_entry()?;
    Ok(next.filter(|entry| !entry.is_end()))
}
