//! The simulated network between robots: it decides which commands arrive, and when.

use std::collections::BTreeMap;

use protocol::messages::{CommandId, Cut};
use protocol::random::{stream, unit};
use protocol::{RobotName, Seq, Tick};

use crate::scenario::Network;

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

/// What the network does at the beginning of a tick.
#[derive(Debug, Default)]
pub struct Decision {
    /// Commands that arrive now, by target, each list ordered by sender and number.
    pub delivered: BTreeMap<RobotName, Vec<CommandId>>,
    /// Commands that were lost on the way, in the order in which they were sent.
    pub dropped: Vec<Underway>,
}

/// The network: what is sent in a tick arrives at the next, unless it is lost.
#[derive(Debug, Clone)]
pub struct Medium {
    seed: u64,
    network: Network,
    arrivals: BTreeMap<Tick, Vec<Underway>>,
}

impl Medium {
    /// The network of a run with this seed.
    #[must_use]
    pub fn new(seed: u64, network: Network) -> Self {
        Self { seed, network, arrivals: BTreeMap::new() }
    }

    /// Takes over a command that was sent in `tick`.
    pub fn accept(&mut self, tick: Tick, command: Underway) {
        self.arrivals.entry(tick + 1).or_default().push(command);
    }

    /// What becomes of the commands whose time has come at `tick`.
    pub fn decide(&mut self, tick: Tick) -> Decision {
        let mut decision = Decision::default();
        for command in self.arrivals.remove(&tick).unwrap_or_default() {
            if self.loses(tick, &command) {
                decision.dropped.push(command);
                continue;
            }
            let id = CommandId { from: command.from, seq: command.seq };
            decision.delivered.entry(command.to).or_default().push(id);
        }
        decision.delivered.values_mut().for_each(|ids| ids.sort());
        decision
    }

    /// Whether a command is lost. Drawn by counter, from a stream that is the command's own, so that no other message and
    /// no other robot changes its fate.
    fn loses(&self, tick: Tick, command: &Underway) -> bool {
        let Underway { to, from, seq } = command;
        // A person at the console is not on the robots' network.
        let loss = if from.is_operator() { 0.0 } else { self.network.commands(from, to).loss };
        loss > 0.0 && { unit(&mut stream(self.seed, &format!("medium/{tick}/{from}/{to}/{seq}"))) < loss }
    }

    /// Pairs of robots between which nothing passes now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        Vec::new()
    }
}
