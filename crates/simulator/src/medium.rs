//! The simulated network between robots: it decides which commands arrive, and when.

use std::collections::BTreeMap;

use protocol::messages::CommandId;
use protocol::{RobotName, Seq, Tick};

/// A command on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Underway {
    /// To whom.
    pub to: RobotName,
    /// By whom.
    pub from: RobotName,
    /// Its number among the sender's.
    pub seq: Seq,
}

/// The network. This one is perfect: what is sent in a tick arrives at the next.
#[derive(Debug, Clone, Default)]
pub struct Medium {
    arrivals: BTreeMap<Tick, Vec<Underway>>,
}

impl Medium {
    /// Takes over a command that was sent in `tick`.
    pub fn accept(&mut self, tick: Tick, command: Underway) {
        self.arrivals.entry(tick + 1).or_default().push(command);
    }

    /// The commands that arrive at `tick`, by target, each list ordered by sender and number.
    pub fn decide(&mut self, tick: Tick) -> BTreeMap<RobotName, Vec<CommandId>> {
        let mut delivered: BTreeMap<RobotName, Vec<CommandId>> = BTreeMap::new();
        for command in self.arrivals.remove(&tick).unwrap_or_default() {
            let id = CommandId { from: command.from, seq: command.seq };
            delivered.entry(command.to).or_default().push(id);
        }
        delivered.values_mut().for_each(|ids| ids.sort());
        delivered
    }
}
