//! What is demanded of every record: executed again in one process, it is the same; and from a tick after which nothing happened
//! by chance, a fork that changes nothing comes to the same end.

use std::collections::BTreeSet;

use environment::Event;
use protocol::{Epoch, RobotName, Tick};
use record::Entry;
use scenario::Scenario;

/// The record of an epoch.
pub(crate) struct Again<'a> {
    pub(crate) scenario: &'a Scenario,
    pub(crate) epoch: Epoch,
    /// Digest at its last tick.
    pub(crate) digest: String,
    pub(crate) recorded: Vec<Entry>,
}

impl Again<'_> {
    /// Executes the record again, and forks it. Returns the number of forks that came to the end of the record.
    pub(crate) fn check(&self) -> Result<u64, String> {
        let again = lab::first_difference(self.scenario.clone(), self.epoch, &self.recorded);
        match again {
            Err(error) => return Err(format!("it cannot be executed again: {error}")),
            Ok(Some(difference)) => {
                let [recorded, executed] = [difference.value(0), difference.value(1)];
                return Err(format!(
                    "executed again, it differs at {difference} (recorded: {recorded}; executed: {executed})"
                ));
            }
            Ok(None) => {}
        }

        let is_whole = self.recorded.len() as Tick > self.scenario.ticks;
        let is_made_here = self.classes().all(|class| robots::make(class).is_some());
        if !is_whole || !is_made_here {
            return Ok(0);
        }
        let mut forks = 0;
        for tick in self.forked_at() {
            forks += u64::from(self.fork(tick)?);
        }
        Ok(forks)
    }

    fn classes(&self) -> impl Iterator<Item = &str> {
        self.scenario.robots.values().map(|robot| &*robot.class)
    }

    /// Ticks before, at and after that of the last thing that happened to a robot, and of a fault of the scenario.
    fn forked_at(&self) -> BTreeSet<Tick> {
        let mut at = BTreeSet::from([self.last_by_chance()]);
        let mut happened = self.recorded.iter().filter(|entry| happens_to_robot(entry));
        at.extend(happened.next_back().map(|entry| entry.tick));
        for fault in &self.scenario.faults {
            at.insert(fault.at);
        }

        let mut ticks = BTreeSet::new();
        for tick in at {
            ticks.extend([tick.saturating_sub(1), tick, tick + 1]);
        }
        ticks.retain(|tick| *tick < self.scenario.ticks);
        ticks
    }

    /// The last tick that depends on more than the scenario.
    fn last_by_chance(&self) -> Tick {
        let operator = RobotName::operator();
        let is_planned = !self.scenario.faults.is_empty();
        let mut by_chance = self.recorded.iter().filter(|entry| {
            let is_commanded = !entry.commands_of(&operator).is_empty();
            is_commanded || (!is_planned && happens_to_robot(entry))
        });
        by_chance.next_back().map_or(0, |entry| entry.tick)
    }

    /// Forks the record after a tick, changing nothing. Returns whether it came to the end of the record; a robot that went on
    /// after a tick that it had missed cannot be forked.
    fn fork(&self, tick: Tick) -> Result<bool, String> {
        let recorded = &self.recorded[..=tick as usize];
        let digest = match lab::digest_from(self.scenario.clone(), self.epoch, recorded) {
            Ok(digest) => digest,
            Err(error) if has_missed(recorded) && error.to_string().contains("cannot go on") => {
                return Ok(false);
            }
            Err(error) => return Err(format!("forked after tick {tick}: {error}")),
        };

        let is_decided = tick >= self.last_by_chance();
        if is_decided && digest != self.digest {
            return Err(format!(
                "forked after tick {tick}, it comes to {digest} instead of {}",
                self.digest
            ));
        }
        Ok(is_decided)
    }
}

fn happens_to_robot(entry: &Entry) -> bool {
    let mut events = entry.events.iter();
    events.any(|event| match event {
        Event::Joined { generation, .. } => generation.is_some(),
        Event::Missed { .. } | Event::Lost { .. } | Event::DoneLate { .. } => true,
        _ => false,
    })
}

fn has_missed(recorded: &[Entry]) -> bool {
    recorded.iter().any(|entry| entry.missed().next().is_some())
}
