//! What of a scenario is in effect in a tick.

use std::collections::BTreeSet;

use protocol::messages::Parameters;
use protocol::{RobotName, Tick};

use super::change::Change;
use super::checked::Scenario;
use super::fault::Fault;
use super::lateness::Lateness;
use super::network::Network;

impl Scenario {
    /// The changes that are in effect from a tick on, and not in the tick before.
    pub fn changes_at(&self, tick: Tick) -> impl Iterator<Item = &Change> {
        self.changes.iter().filter(move |change| change.at == tick)
    }

    /// The last change that is in effect in a tick.
    fn in_effect(&self, tick: Tick) -> Option<&Change> {
        self.changes.iter().rfind(|change| change.at <= tick)
    }

    /// The network in a tick.
    #[must_use]
    pub fn network_at(&self, tick: Tick) -> &Network {
        let change = self.in_effect(tick);
        change.map_or(&self.network, |change| &change.network)
    }

    /// The rules for late robots in a tick, as far as the scenario and its changes say.
    #[must_use]
    pub fn lateness_at(&self, tick: Tick) -> &Lateness {
        let change = self.in_effect(tick);
        change.map_or(&self.lateness, |change| &change.lateness)
    }

    /// The faults of the run, as they are known in a tick.
    #[must_use]
    pub fn faults_at(&self, tick: Tick) -> &[Fault] {
        let change = self.in_effect(tick);
        change.map_or(&self.faults, |change| &change.faults)
    }

    /// The parameters of a robot in a tick.
    #[must_use]
    pub fn parameters_at(&self, robot: &RobotName, tick: Tick) -> Option<&Parameters> {
        if let Some(change) = self.in_effect(tick) {
            return change.parameters.get(robot);
        }
        Some(&self.robots.get(robot)?.parameters)
    }

    /// Robots that start again before a tick, because their parameters are others, or because a fault wants it. One whose process is killed or stopped then has the new
    /// parameters when it takes part again.
    #[must_use]
    pub fn restarts_at(&self, tick: Tick) -> BTreeSet<RobotName> {
        let mut robots = BTreeSet::new();
        for change in self.changes_at(tick) {
            robots.extend(change.restarted.iter().cloned());
        }
        robots.extend(self.restarts_wanted_at(tick));
        for fault in self.faults_at(tick) {
            if fault.is_absence_at(tick) {
                robots.remove(&fault.robot);
            }
        }
        robots
    }

    /// Robots that a fault wants to start again before a tick.
    pub fn restarts_wanted_at(&self, tick: Tick) -> BTreeSet<RobotName> {
        let faults = self.faults_at(tick).iter();
        let restarts = faults.filter(|fault| fault.is_restart() && fault.at == tick);
        restarts.map(|fault| fault.robot.clone()).collect()
    }
}
