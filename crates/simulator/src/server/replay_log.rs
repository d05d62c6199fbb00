//! The record of a run that is resumed. Up to its end the server executes the run again, as fast as the robots answer, and
//! compares every tick with the record.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use environment::TickRecord;
use lockstep::{Attendance, Sent};
use protocol::messages::CommandText;
use protocol::{Epoch, RobotName, Tick};

use record::EpochFiles;
use record::difference::{Difference, between};
use record::{Entry, Record, RecordError};

/// What is left of the record of a run that is resumed.
pub struct ReplayLog {
    epoch: Epoch,
    record: Option<Record>,
    /// The tick that is executed next; `None` if no tick was completed.
    next: Option<Entry>,
    /// Robots that did a tick too late, by tick. Their events are in the tick in which they took part again, which is later.
    done_late: BTreeMap<Tick, BTreeSet<RobotName>>,
}

impl ReplayLog {
    /// The record of an epoch.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be read.
    pub fn open(files: &EpochFiles) -> Result<Self, RecordError> {
        let mut record = None;
        let mut next = None;
        let mut done_late = BTreeMap::new();

        if files.events.exists() {
            // The whole record is read once in advance: an answer that came too late is noted in a
            // later tick than the one that it is of.
            done_late = read_done_late(&files.events)?;
            let mut events = Record::of_events(&files.events)?;
            next = next_tick(&mut events)?;
            record = Some(events);
        }

        Ok(Self {
            epoch: files.epoch,
            record,
            next,
            done_late,
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
    pub(super) fn commands(&self) -> Vec<Sent<CommandText>> {
        let operator = RobotName::operator();
        let next = self.next.iter();
        next.flat_map(|entry| entry.commands_of(&operator))
            .collect()
    }

    /// What was set by hand before the next tick.
    pub(super) fn changes_by_hand(&self) -> Vec<String> {
        let next = self.next.iter();
        next.flat_map(Entry::changes_by_hand).collect()
    }

    /// Who takes part in the next tick. A robot that does it too late is not absent: it does the tick again.
    pub(super) fn attendance(&self) -> Attendance {
        let Some(next) = &self.next else {
            return Attendance::default();
        };

        let mut attendance = next.attendance();
        attendance
            .absent
            .retain(|robot| !self.is_done_late(robot, next.tick));
        attendance
    }

    /// The robots that take part again from the next tick on.
    pub(super) fn joined(&self) -> impl Iterator<Item = &RobotName> {
        self.next.iter().flat_map(Entry::joined)
    }

    /// Whether a robot did a tick too late for its answer to count.
    pub(super) fn is_done_late(&self, robot: &RobotName, tick: Tick) -> bool {
        let robots = self.done_late.get(&tick);
        robots.is_some_and(|robots| robots.contains(robot))
    }

    /// Compares a tick that was executed again, and goes on to the next one. Returns the first difference, if there is one.
    ///
    /// # Errors
    /// [`RecordError`] if the record cannot be read on.
    pub(super) fn compare(
        &mut self,
        executed: &TickRecord,
    ) -> Result<Option<Box<Difference>>, RecordError> {
        let executed = Entry {
            tick: executed.tick,
            events: executed.events.to_vec(),
            ..Entry::default()
        };
        let recorded = self.next.take().unwrap_or_default();
        if let Some(difference) = between(&recorded, &executed) {
            return Ok(Some(Box::new(difference)));
        }

        if let Some(record) = &mut self.record {
            self.next = next_tick(record)?;
        }
        Ok(None)
    }
}

/// Reads which robots did which ticks too late.
fn read_done_late(events: &Path) -> Result<BTreeMap<Tick, BTreeSet<RobotName>>, RecordError> {
    let mut record = Record::of_events(events)?;
    let mut done_late: BTreeMap<Tick, BTreeSet<RobotName>> = BTreeMap::new();
    while let Some(entry) = next_tick(&mut record)? {
        for (robot, ticks) in entry.done_late() {
            for tick in ticks {
                done_late.entry(*tick).or_default().insert(robot.clone());
            }
        }
    }
    Ok(done_late)
}

/// The next tick of a record. The end of a run that was stopped is not a tick: the run goes on after its last one.
fn next_tick(record: &mut Record) -> Result<Option<Entry>, RecordError> {
    let next = record.next_entry()?;
    Ok(next.filter(|entry| !entry.is_end()))
}
