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
use super::plan::{Plan, Robots, Unit};
use super::processes::{self, Launcher};
use super::script::EmotionScript;
use lab::LabError;
use lab::run::{Local, check_faults, make_robots, play};

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
    probes: Vec<(&'a str, Probe<'a>)>,
    words: Words,
}

impl Plan {
    /// Checks that every arm can be played under every condition.
    ///
    /// # Errors
    /// If a scenario has robots or faults that need processes, and there are none.
    pub fn check(&self) -> Result<(), LabError> {
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
        for cell in 0..self.cells() {
            let scenario = self.scenario(cell, seed, Vec::new())?;
            let checked = check_faults(&scenario, 0)
                .and_then(|()| make_robots(&scenario, &self.experiment.scenario));
            if let Err(reason) = checked {
                return Ok(Some(reason));
            }
        }
        Ok(None)
    }

    /// Checks that robots in this process begin with their parameters, in every arm under every condition, and that those of some
    /// arm have the variables that are measured: plays tick 0. A plan that has been saved has passed this.
    ///
    /// # Errors
    /// If a robot does not begin, at the place of the change that it refuses, with the arm and the condition; or at a measure
    /// of a variable that it has in no arm.
    pub fn check_begins(&self) -> Result<(), LabError> {
        if *self.robots() != Robots::InProcess {
            return Ok(());
        }

        let run = RunName::unknown();
        let begin = |scenario: Scenario| {
            caught(|| {
                let mut local = Local::new(scenario, &run)?;
                local.simulation.init(&mut local.robots)?;
                Ok(local)
            })
        };
        let mut published: BTreeMap<RobotName, BTreeSet<String>> = BTreeMap::new();

        let seed = self.unit(0).seed;
        for cell in 0..self.cells() {
            let scenario = self.scenario(cell, seed, Vec::new())?;
            match begin(scenario) {
                Ok(local) => add_variables(&mut published, &local),
                Err(reason) => {
                    let case = self.case(cell)?;
                    return Err(case
                        .refused(&reason, |scenario| begin(scenario).err())
                        .into());
                }
            }
        }
        self.experiment.check_variables(&published)?;
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
    pub fn play(&self, unit: &Unit<'_>, launcher: Launcher<'_>) -> UnitResult {
        caught(|| self.measure(unit, launcher))
    }

    /// The scenario of a unit. That of a yoked unit takes the run whose emotions its robots show, which is played for it: so
    /// units do not depend on each other.
    ///
    /// # Errors
    /// If the scenario cannot be used, or that run cannot be played.
    pub fn scenario_of(
        &self,
        unit: &Unit<'_>,
        launcher: Launcher<'_>,
    ) -> Result<Scenario, LabError> {
        let Some((cell, seed)) = unit.yoke else {
            return Ok(self.scenario(unit.cell, unit.seed, Vec::new())?);
        };

        let other = self.scenario(cell, seed, Vec::new())?;
        let mut script = EmotionScript::default();
        self.follow(other, launcher, &mut script)?;
        let script: Vec<Override> = script.changes().map_err(LabError::refused)?;
        Ok(self.scenario(unit.cell, unit.seed, script)?)
    }

    fn measure(&self, unit: &Unit<'_>, launcher: Launcher<'_>) -> Result<Played, LabError> {
        let condition_s = unit.condition.time_s;
        // Where it lasts for the whole run there is no time after it, not even the last tick.
        let condition_s = condition_s.unwrap_or((0.0, f64::INFINITY));
        let experiment = &self.experiment;
        let mut gauge = Gauge {
            probes: Vec::new(),
            words: Words::of(&experiment.measures, &experiment.expectations),
        };
        let scenario = self.scenario_of(unit, launcher)?;
        let roster = scenario.roster();
        for measure in &experiment.measures {
            let probe = Probe::new(measure, &roster, condition_s);
            gauge.probes.push((&measure.name, probe));
        }

        let ended = self.follow(scenario, launcher, &mut gauge)?;
        let mut measures = BTreeMap::new();
        for (name, probe) in gauge.probes {
            measures.insert(name.to_owned(), probe.measured(&ended.summary));
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
        launcher: Launcher<'_>,
        follower: &mut impl Follow,
    ) -> Result<EndedRun, LabError> {
        match self.robots() {
            Robots::InProcess => follow_in_process(scenario, follower),
            Robots::Programs => processes::follow(scenario, None, launcher, follower),
            Robots::Launched(launch) => {
                processes::follow(scenario, Some(launch), launcher, follower)
            }
        }
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

fn follow_in_process(scenario: Scenario, follower: &mut impl Follow) -> Result<EndedRun, LabError> {
    let run = RunName::unknown();
    let mut summary = None;
    let simulation = play(scenario, &run, |simulation, record| {
        let summary = summary.get_or_insert_with(|| simulation.begin_summary(&run));
        for event in record.events.iter() {
            simulation.count(summary, record.tick, event);
        }
        follower.observe(&Observation {
            tick: record.tick,
            tick_s: simulation.scenario().tick_s,
            events: &record.events,
            state: &|robot| simulation.robot_state(robot),
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
