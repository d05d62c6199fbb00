//! What of a scenario is in effect in a tick.

use std::collections::BTreeSet;

use protocol::messages::{FaultKind, Parameters, StreamReseed};
use protocol::{RobotName, Tick};

use super::change::Change;
use super::checked::Scenario;
use super::fault::{Fault, FaultEnd, Interruption};
use super::lateness::Lateness;
use super::network::Network;
use super::reseed::Reseed;

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

    /// The parameters of a robot before the one change and the next, up to a tick: the last first.
    #[must_use]
    pub fn parameters_before(&self, robot: &RobotName, tick: Tick) -> Vec<&Parameters> {
        let until = self.changes.partition_point(|change| change.at <= tick);
        let mut before = self.parameters_over(robot, &self.changes[..until]);
        before.pop();
        before.reverse();
        before
    }

    /// The parameters of a robot after each further change, from a tick on.
    pub fn parameters_after(
        &self,
        robot: &RobotName,
        tick: Tick,
    ) -> impl Iterator<Item = &Parameters> {
        let from = self.changes.partition_point(|change| change.at <= tick);
        Self::set_by(robot, &self.changes[from..])
    }

    /// The parameters that robots are given from a tick on, by its change and by those after it.
    #[must_use]
    pub fn parameters_from(&self, tick: Tick) -> Vec<(RobotName, Parameters)> {
        let from = self.changes.partition_point(|change| change.at < tick);
        let mut given = Vec::new();
        for name in self.robots.keys() {
            for parameters in Self::set_by(name, &self.changes[from..]) {
                given.push((name.clone(), parameters.clone()));
            }
        }
        given
    }

    /// All parameters that the scenario gives to robots, at the beginning and later.
    #[must_use]
    pub fn all_parameters(&self) -> Vec<(RobotName, Parameters)> {
        let mut all = Vec::new();
        for name in self.robots.keys() {
            for parameters in self.parameters_over(name, &self.changes) {
                all.push((name.clone(), parameters.clone()));
            }
        }
        all
    }

    /// The parameters of a robot at the beginning, and after each of these changes.
    fn parameters_over<'a>(
        &'a self,
        robot: &RobotName,
        changes: &'a [Change],
    ) -> Vec<&'a Parameters> {
        let first = self.robots.get(robot).map(|robot| &robot.parameters);
        first
            .into_iter()
            .chain(Self::set_by(robot, changes))
            .collect()
    }

    /// The parameters that these changes give a robot.
    fn set_by<'a>(
        robot: &RobotName,
        changes: &'a [Change],
    ) -> impl Iterator<Item = &'a Parameters> {
        let of_robot = changes
            .iter()
            .filter(|change| change.restarted.contains(robot));
        of_robot.filter_map(|change| change.parameters.get(robot))
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

    /// What stops the process of a robot, or starts it again, in the course of the run; without what leaves no trace in the record.
    #[must_use]
    pub fn interruptions(&self, robot: &RobotName) -> Vec<Interruption> {
        let mut interruptions = of_faults(&self.faults, robot);
        for change in &self.changes {
            interruptions.extend(of_faults(&change.faults, robot));
            if change.restarted.contains(robot) {
                interruptions.push(Interruption {
                    at: change.at,
                    fault: None,
                });
            }
        }
        interruptions
    }

    /// Robots that a fault wants to start again before a tick.
    pub fn restarts_wanted_at(&self, tick: Tick) -> BTreeSet<RobotName> {
        let faults = self.faults_at(tick).iter();
        let restarts = faults.filter(|fault| fault.is_restart() && fault.at == tick);
        restarts.map(|fault| fault.robot.clone()).collect()
    }

    /// The seed of what robots miss in a tick.
    #[must_use]
    pub fn sensing_seed(&self, tick: Tick) -> u64 {
        let mut begun = self.reseeds.iter().rev().filter(|one| one.at <= tick);
        let last = begun.find_map(Reseed::of_sensing);
        last.unwrap_or(self.seed)
    }

    /// The seed of a robot's stream in a tick.
    #[must_use]
    pub fn stream_seed(&self, robot: &RobotName, tick: Tick) -> u64 {
        let mut begun = self.reseeds.iter().rev().filter(|one| one.at <= tick);
        let last = begun.find_map(|one| one.of_robot(robot));
        last.map_or(self.seed, |reseed| reseed.seed)
    }

    /// Where a robot's stream is drawn anew after a tick.
    #[must_use]
    pub fn stream_reseeds(&self, robot: &RobotName, after: Tick) -> Vec<StreamReseed> {
        let later = self.reseeds.iter().filter(|one| one.at > after);
        later.filter_map(|one| one.of_robot(robot)).collect()
    }
}

/// The faults that interrupt a robot. One that only the wall clock knows holds the clock, and all robots of the process wait.
fn of_faults(faults: &[Fault], robot: &RobotName) -> Vec<Interruption> {
    let mut interruptions = Vec::new();
    for fault in faults.iter().filter(|fault| fault.robot == *robot) {
        let is_unseen = match fault.kind {
            FaultKind::Slow => true,
            FaultKind::Hang => matches!(fault.end, FaultEnd::After(_)),
            FaultKind::Crash | FaultKind::Restart => false,
        };
        if !is_unseen {
            interruptions.push(Interruption {
                at: fault.at,
                fault: Some((fault.kind, fault.end)),
            });
        }
    }
    interruptions
}
