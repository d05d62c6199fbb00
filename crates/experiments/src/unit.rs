//! Plays one unit of an experiment and takes its measures.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::iter::successors;
use std::panic::AssertUnwindSafe;

use config::Override;
use observe::words::{MissingWord, Words};
use observe::{Measured, Observation, Probe};
use protocol::{RobotName, RunName};
use scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::follow::{EndedRun, Follow};
use super::launches::Launches;
use super::own::RunRobots;
use super::plan::{Plan, Robots, Unit};
use super::script::EmotionScript;
use lab::LabError;
use lab::run::{Local, check_faults, make_robots_with, play_with};

/// What a unit gives: its measures, or the reason why it has none.
pub type UnitResult = Result<Played, String>;

/// What was measured in a unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Played {
    /// Digest of the run.
    pub digest: String,
    /// The measures, by name.
    pub measures: BTreeMap<String, Measured>,
    /// The verdicts about expectations, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub verdicts: BTreeMap<String, String>,
    /// Words of the measures and of the experiment's expectations that did not occur.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unheard: Vec<MissingWord>,
}

/// What is measured of a run.
struct Gauge<'a> {
    /// The measures, by name.
    probes: Vec<(&'a str, Probe)>,
    words: Words,
}

impl Plan {
    /// Checks that every arm can be played under every condition.
    ///
    /// # Errors
    /// If a scenario has robots or faults that need processes, and there are none, or robots that only another program has.
    pub fn check(&self) -> Result<(), LabError> {
        self.check_own_robots()?;
        match self.needs_processes()? {
            Some(reason) => Err(reason),
            None => Ok(()),
        }
    }

    /// Why the units cannot be played in this process, if they are to be and cannot.
    ///
    /// # Errors
    /// If a scenario cannot be used.
    pub fn needs_processes(&self) -> Result<Option<LabError>, LabError> {
        if *self.robots() != Robots::InProcess {
            return Ok(None);
        }

        let seed = self.unit(0).seed;
        let source = self.robot_source();
        for cell in 0..self.cells() {
            let scenario = self.scenario(cell, seed, Vec::new())?;
            let robots = source.begin();
            let checked = check_faults(&scenario, 0).and_then(|()| {
                make_robots_with(&scenario, &self.experiment.scenario, &|name, class| {
                    robots.make(name, class)
                })
            });
            if let Err(reason) = checked {
                return Ok(Some(explained(robots.as_ref(), reason)));
            }
        }
        Ok(None)
    }

    /// Checks that robots in this process begin with their parameters, in every arm under every condition, and that those of some
    /// arm have the variables that are measured: plays tick 0. A plan that has been saved has passed this. A cell in which a robot
    /// of the caller's own fails is left to its units.
    ///
    /// # Errors
    /// If a robot does not begin, at the place of the change that it refuses, with the arm and the condition; or at a measure
    /// of a variable that it has in no arm. If robots of the caller's own fail in all cells, the first failure.
    pub fn check_begins(&self) -> Result<(), LabError> {
        if *self.robots() != Robots::InProcess {
            return Ok(());
        }

        let run = RunName::unknown();
        let source = self.robot_source();
        let file = &self.experiment.scenario;
        let begin = |scenario: Scenario, robots: &dyn RunRobots| {
            caught(|| {
                let made =
                    make_robots_with(&scenario, file, &|name, class| robots.make(name, class))?;
                let mut local = Local::with_robots(scenario, 1, &run, made)?;
                local.simulation.init(&mut local.robots)?;
                Ok(local)
            })
        };
        let mut published: BTreeMap<RobotName, BTreeSet<String>> = BTreeMap::new();
        let mut own_failures = Vec::new();

        let seed = self.unit(0).seed;
        for cell in 0..self.cells() {
            let scenario = self.scenario(cell, seed, Vec::new())?;
            let robots = source.begin();
            match begin(scenario, robots.as_ref()) {
                Ok(local) => add_variables(&mut published, &local),
                Err(reason) => {
                    if let Some(failure) = robots.failure() {
                        own_failures.push(failure);
                        continue;
                    }
                    let case = self.case(cell)?;
                    return Err(case
                        .refused(&reason, |scenario| {
                            begin(scenario, source.begin().as_ref()).err()
                        })
                        .into());
                }
            }
        }
        if own_failures.len() == self.cells()
            && let Some(first) = own_failures.first()
        {
            return Err(LabError::refused(first.clone()));
        }
        // What a robot that fails would publish is not known.
        if own_failures.is_empty() {
            self.experiment.check_variables(&published)?;
        }
        Ok(())
    }

    /// The measures that all of these units miss, for people; empty if one of the units failed, or there are none.
    #[must_use]
    pub fn missing_in_all(&self, played: &[&Played]) -> Vec<String> {
        let mut missing = Vec::new();
        let Some((first, others)) = played.split_first() else {
            return missing;
        };
        for (name, measured) in &first.measures {
            let Measured::Missing { reason } = measured else {
                continue;
            };
            let is_missing = |one: &&Played| {
                let measured = one.measures.get(name);
                matches!(measured, Some(Measured::Missing { .. }))
            };
            if others.iter().all(is_missing) {
                missing.push(format!("the measure \"{name}\": {reason}"));
            }
        }
        missing
    }

    /// Number of arms under all conditions.
    fn cells(&self) -> usize {
        self.conditions().len() * self.experiment.arms.len()
    }

    /// Plays a unit and takes its measures. A robot that panics is the failure of its unit.
    ///
    /// # Errors
    /// The reason why the unit cannot be played to its end, for people.
    pub fn play(&self, unit: &Unit<'_>, launches: &Launches) -> UnitResult {
        caught(|| self.measure(unit, launches))
    }

    /// The scenario of a unit. That of a yoked unit takes the run whose emotions its robots show, which is played for it: so
    /// units do not depend on each other.
    ///
    /// # Errors
    /// If the scenario cannot be used, or that run cannot be played.
    pub fn scenario_of(&self, unit: &Unit<'_>, launches: &Launches) -> Result<Scenario, LabError> {
        let Some((cell, seed)) = unit.yoke else {
            return Ok(self.scenario(unit.cell, unit.seed, Vec::new())?);
        };

        let other = self.scenario(cell, seed, Vec::new())?;
        let mut script = EmotionScript::default();
        self.follow(other, launches, &mut script)?;
        let script: Vec<Override> = script.changes().map_err(LabError::refused)?;
        Ok(self.scenario(unit.cell, unit.seed, script)?)
    }

    fn measure(&self, unit: &Unit<'_>, launches: &Launches) -> Result<Played, LabError> {
        let condition_s = unit.condition.time_s;
        // Where it lasts for the whole run there is no time after it, not even the last tick.
        let condition_s = condition_s.unwrap_or((0.0, f64::INFINITY));
        let experiment = &self.experiment;
        let mut gauge = Gauge {
            probes: Vec::new(),
            words: Words::of(&experiment.measures, &experiment.expectations),
        };
        let scenario = self.scenario_of(unit, launches)?;
        let setting = scenario.setting();
        for measure in &experiment.measures {
            let probe = Probe::new(measure, &setting, condition_s);
            gauge.probes.push((&measure.name, probe));
        }

        let ended = self.follow(scenario, launches, &mut gauge)?;
        let mut measures = BTreeMap::new();
        for (name, probe) in gauge.probes {
            let measured = probe.measured(&ended.summary, &measures);
            measures.insert(name.to_owned(), measured);
        }
        Ok(Played {
            digest: ended.digest,
            measures,
            verdicts: ended.verdicts,
            unheard: gauge.words.unheard(),
        })
    }

    /// Plays a scenario to its end.
    fn follow(
        &self,
        scenario: Scenario,
        launches: &Launches,
        follower: &mut impl Follow,
    ) -> Result<EndedRun, LabError> {
        match self.robots() {
            Robots::InProcess => self.follow_in_process(scenario, follower),
            Robots::Programs => launches.follow(scenario, None, follower),
            Robots::Launched(launch) => launches.follow(scenario, Some(launch), follower),
        }
    }

    fn follow_in_process(
        &self,
        scenario: Scenario,
        follower: &mut impl Follow,
    ) -> Result<EndedRun, LabError> {
        let source = self.robot_source();
        let robots = source.begin();
        follow_with(scenario, robots.as_ref(), follower)
            .map_err(|error| explained(robots.as_ref(), error))
    }
}

/// The error of a run, or what a robot of the caller's own says about it.
fn explained(robots: &dyn RunRobots, error: LabError) -> LabError {
    match robots.failure() {
        Some(reason) => LabError::failed(reason),
        None => error,
    }
}

/// Adds the variables that the robots of a run in tick 0 have.
fn add_variables(published: &mut BTreeMap<RobotName, BTreeSet<String>>, local: &Local) {
    for robot in local.simulation.names() {
        let names = published.entry(robot.clone()).or_default();
        if let Some(state) = local.simulation.robot_state(robot) {
            names.extend(
                state
                    .state_variables
                    .iter()
                    .map(|(name, _)| name.to_string()),
            );
        }
    }
}

/// Plays a scenario in this process to its end.
fn follow_with(
    scenario: Scenario,
    robots: &dyn RunRobots,
    follower: &mut impl Follow,
) -> Result<EndedRun, LabError> {
    let run = RunName::unknown();
    let mut summary = None;
    let make = |name: &_, class: &_| robots.make(name, class);
    let simulation = play_with(scenario, &run, &make, |simulation, record| {
        let summary = summary.get_or_insert_with(|| simulation.begin_summary(&run));
        for event in record.events.iter() {
            simulation.count(summary, record.tick, event);
        }
        follower.observe(&Observation {
            tick: record.tick,
            tick_s: simulation.scenario().tick_s,
            events: &record.events,
            state: &|robot| simulation.robot_state(robot),
            site: &|site| simulation.site_state(site),
            layer: &|layer| simulation.layers().cells(layer),
        });
        Ok(())
    })?;

    let mut summary = summary.ok_or_else(|| LabError::failed("the run has not begun"))?;
    simulation.finish_summary(&mut summary);
    EndedRun::of(&summary)
}

impl Follow for Gauge<'_> {
    fn observe(&mut self, observation: &Observation<'_>) {
        for (_, probe) in &mut self.probes {
            probe.observe(observation);
        }
        self.words.observe(observation);
    }
}

/// What comes of a unit, whose robots may panic.
fn caught<T>(measure: impl FnOnce() -> Result<T, LabError>) -> Result<T, String> {
    // Nothing that it has changed is used after a panic.
    match std::panic::catch_unwind(AssertUnwindSafe(measure)) {
        Ok(Ok(done)) => Ok(done),
        Ok(Err(error)) => Err(in_words(&error)),
        Err(panic) => Err(format!("a robot panicked: {}", message_of(panic.as_ref()))),
    }
}

/// An error as one line, with its causes.
fn in_words(error: &(dyn Error + 'static)) -> String {
    let mut causes = Vec::new();
    for cause in successors(Some(error), |&cause| cause.source()) {
        causes.push(cause.to_string());
    }
    causes.join(": ")
}

/// The message of a panic.
fn message_of(panic: &(dyn std::any::Any + Send)) -> &str {
    if let Some(text) = panic.downcast_ref::<&str>() {
        return text;
    }
    panic
        .downcast_ref::<String>()
        .map_or("no message", String::as_str)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_the_reason_of_a_failure() {
        assert_eq!(
            caught::<()>(|| panic!("no way out")),
            Err("a robot panicked: no way out".to_owned())
        );
        let number = 7;
        assert_eq!(
            caught::<()>(|| panic!("{number} ways out")),
            Err("a robot panicked: 7 ways out".to_owned())
        );

        #[derive(Debug, thiserror::Error)]
        #[error("outer")]
        struct Outer(#[source] std::fmt::Error);
        let words = format!("outer: {}", std::fmt::Error);
        let error = LabError::failed(Outer(std::fmt::Error));
        assert_eq!(caught::<()>(|| Err(error)), Err(words));
    }
}
