//! What changes a run from a tick on: its scenario, another chance, a person.

use protocol::messages::{Intervention, Parameters};
use protocol::random::stream;
use protocol::{Event, RobotName};
use scenario::{ChanceKind, Override, Reseed, Scenario};

use crate::medium::ForcedVerdict;

use super::Simulation;

impl Simulation {
    /// What the scenario or a person changes takes effect.
    pub(super) fn change_scenario(&mut self) {
        let mut network = None;
        for change in self.scenario.changes_at(self.now) {
            // Each change has the whole network as it is from then on, so the last one counts.
            network = Some(change.network.clone());
            for set in &change.set {
                self.events.push(Event::Changed {
                    set: set.to_string(),
                    by_hand: change.is_by_hand,
                });
            }
        }

        if let Some(network) = network {
            self.medium.set_network(network);
        }
    }

    /// Chance becomes another one. Robots take their part of it by themselves
    /// ([`Welcome::reseeds`](protocol::messages::Welcome::reseeds)), and sensing asks the scenario.
    pub(super) fn reseed_chance(&mut self) {
        for reseed in &self.scenario.reseeds {
            if reseed.at != self.now {
                continue;
            }
            if let Some(seeds) = reseed.of_network() {
                self.medium.reseed(seeds);
            }
            if let Some(seed) = reseed.of_guests() {
                self.world.reseed(stream(seed, "guests"));
            }
            self.events.push(Event::Changed {
                set: reseed.to_string(),
                by_hand: false,
            });
        }
    }

    /// Has the network decide something in the next tick that has not begun, whatever it draws.
    pub fn force(&mut self, verdict: ForcedVerdict) {
        self.medium.force(verdict);
    }

    /// Has chance be another one from the next tick on that has not begun; without kinds all of it, also where the scenario would
    /// re-seed the run later. Robots of this process must be told by themselves: [`Scenario::stream_reseeds`].
    pub fn reseed(&mut self, seed: u64, of: &[ChanceKind]) {
        let reseeds = &mut self.scenario.reseeds;
        let later = reseeds.partition_point(|one| one.at <= self.now + 1);
        if of.is_empty() {
            reseeds.truncate(later);
        }
        let reseed = Reseed {
            at: self.now + 1,
            seed,
            of: of.to_vec(),
        };
        reseeds.insert(later, reseed);
    }

    /// Goes on from the last tick as a run of another scenario, which is the same up to then. Its robots must be told by themselves of
    /// streams that are drawn anew later: [`Scenario::stream_reseeds`].
    pub fn go_on_as(&mut self, scenario: Scenario) {
        self.medium
            .set_network(scenario.network_at(self.now).clone());
        self.scenario = scenario;
    }

    /// Has something done to the run from the next tick on that has not begun, as a person wants it.
    ///
    /// # Errors
    /// In words, if it cannot be done; nothing has changed then.
    pub fn intervene(&mut self, what: &Intervention) -> Result<(), String> {
        let set = self
            .scenario
            .words_of(what, self.now + 1, |counted| self.medium.count(counted))?;
        self.change_by_hand(&set)
    }

    /// Ends the fault of a robot before the next tick that the wall clock would end, and without which the clock has gone on.
    ///
    /// # Errors
    /// In words, if the last fault of the robot is not of that kind; nothing has changed then.
    pub fn end_fault_for_a_time(&mut self, robot: &RobotName) -> Result<(), String> {
        let words = self.scenario.words_of_early_end(robot, self.now + 1)?;
        self.change_by_hand(&[words])
    }

    /// Sets something in the scenario from the next tick on that has not begun, as a person wants it.
    ///
    /// # Errors
    /// In words, if it is nothing that can change while a run goes on; nothing has changed then.
    pub fn change_by_hand(&mut self, set: &[Override]) -> Result<(), String> {
        let changed = self.scenario.with_change_by_hand(self.now + 1, set);
        let changed = changed.map_err(|error| error.reason().to_owned())?;
        if !self
            .medium
            .has_counted_for(changed.network_at(self.now + 1))
        {
            return Err(
                "commands with a text are counted from the beginning of a run or not at all: leave `text` out"
                    .to_owned(),
            );
        }

        // At the first time only: later ones find changes by hand among those of the scenario.
        self.planned
            .get_or_insert_with(|| self.scenario.changes.clone());
        self.scenario = changed;
        Ok(())
    }

    /// What an intervention would change the parameters of robots to, from the next tick on: nothing if it is refused anyway.
    #[must_use]
    pub fn parameters_set_by(&self, what: &Intervention) -> Vec<(RobotName, Parameters)> {
        let at = self.now + 1;
        let words = self
            .scenario
            .words_of(what, at, |counted| self.medium.count(counted));
        let Ok(changed) = words.map(|set| self.scenario.with_change_by_hand(at, &set)) else {
            return Vec::new();
        };

        changed.map_or_else(|_| Vec::new(), |changed| changed.parameters_from(at))
    }

    /// Sets by hand what a record says was set by hand before the next tick.
    ///
    /// # Errors
    /// In words, if the record says something that cannot be set.
    pub fn repeat_changes(&mut self, changes: &[String]) -> Result<(), String> {
        if changes.is_empty() {
            return Ok(());
        }
        let set: Result<Vec<Override>, String> = changes.iter().map(|set| set.parse()).collect();
        self.change_by_hand(&set?)
    }

    /// The scenario without what was done by hand.
    #[must_use]
    pub fn planned(&self) -> Scenario {
        let mut scenario = self.scenario.clone();
        if let Some(changes) = &self.planned {
            scenario.changes.clone_from(changes);
        }
        scenario
    }
}
