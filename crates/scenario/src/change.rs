//! `[[change]]`: what a scenario changes while the run goes on, and `[parent]`: the run from which such a run was forked.

use std::collections::BTreeMap;

use config::Override;
use protocol::messages::Parameters;
use protocol::{RobotName, RunName, Tick};

use super::fault::Fault;
use super::lateness::Lateness;
use super::network::Network;

/// A change of the network, the faults or the robots' parameters during a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// First tick in which it is in effect.
    pub at: Tick,
    /// What it sets.
    pub set: Vec<Override>,
    /// Whether a person has made it during the run, and not the scenario.
    pub is_by_hand: bool,
    /// The network from then on.
    pub network: Network,
    /// The rules for late robots from then on.
    pub lateness: Lateness,
    /// All faults of the run, as far as they begin from then on.
    pub faults: Vec<Fault>,
    /// The parameters of all robots from then on.
    pub parameters: BTreeMap<RobotName, Parameters>,
    /// Robots whose parameters are others than before. They start again with these, as further incarnations.
    pub restarted: Vec<RobotName>,
}

/// The run from which a run was forked. Up to that tick both are the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parent {
    /// Its name.
    pub run: RunName,
    /// The last tick that both have.
    pub tick: Tick,
    /// Digest of both at that tick.
    pub digest: String,
}
