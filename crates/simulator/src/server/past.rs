//! The record of a run that is resumed. Up to its end the server executes the run again, as fast as the robots answer, and
//! compares every tick with the record.

use config::FileError;
use protocol::{Epoch, RobotName};

use crate::difference::{Difference, between};
use crate::record::{Entry, Record};
use crate::recorder::EpochFiles;
use crate::simulation::TickRecord;

/// What is left of the record of a run that is resumed.
pub struct Past {
    epoch: Epoch,
    record: Record,
    /// The tick that is executed next.
    next: Entry,
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
    /// The record of an epoch; `None` if no tick was completed.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read.
    pub fn open(files: &EpochFiles) -> Result<Option<Self>, FileError> {
        let mut record = Record::open(files)?;
        let first = record.next_entry()?;
        Ok(first.map(|next| Self {
            epoch: files.epoch,
            record,
            next,
        }))
    }

    /// The epoch of the record.
    pub(super) fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The operator's commands that were sent before the next tick.
    pub(super) fn commands(&self) -> Vec<(RobotName, String)> {
        let operator = RobotName::operator();
        let sent = self.next.commands_of(&operator).into_iter();
        sent.map(|sent| (sent.to, sent.command.command)).collect()
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
        if let Some(difference) = between(&self.next, &executed) {
            return Ok(Repeated::Different(Box::new(difference)));
        }

        match self.record.next_entry()? {
            Some(next) => self.next = next,
            None => return Ok(Repeated::Last),
        }
        Ok(Repeated::Same)
    }
}
