//! What the runs of one arm under one condition have in common, measure by measure.

use std::collections::BTreeMap;

use observe::Measure;
use serde::Serialize;
use statistics::{Estimate, Survival, TimeTo, quantile};

use super::file::Experiment;
use super::outcome::Outcome;

/// One measure of the runs of an arm under a condition.
#[derive(Debug, Clone, Serialize)]
pub struct Cell {
    /// Name of the measure.
    pub measure: String,
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Its estimate.
    #[serde(flatten)]
    pub estimate: Estimated,
}

/// The estimate of a measure; each has its number of runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Estimated {
    /// Of a number of each run.
    Number {
        /// Mean with interval.
        #[serde(flatten)]
        mean: Estimate,
        /// Smallest value, lower quartile, median, upper quartile and largest value.
        quartiles: [f64; 5],
    },
    /// Of the time to an event, which some runs do not reach.
    Time(Survival),
}

impl Experiment {
    /// Estimates of every measure over the seeds, for each arm under each condition that was run, in the order of the file.
    #[must_use]
    pub fn estimate(&self, outcomes: &[Outcome]) -> Vec<Cell> {
        let mut cells = Vec::new();
        for measure in &self.measures {
            for condition in conditions_of(outcomes) {
                for arm in &self.arms {
                    if let Some(estimate) = estimated(outcomes, measure, condition, &arm.name) {
                        cells.push(Cell {
                            measure: measure.name.clone(),
                            condition: condition.to_owned(),
                            arm: arm.name.clone(),
                            estimate,
                        });
                    }
                }
            }
        }

        cells
    }
}

/// The conditions of the outcomes, each once, in their order.
pub(super) fn conditions_of(outcomes: &[Outcome]) -> Vec<&str> {
    let mut conditions: Vec<&str> = Vec::new();
    for outcome in outcomes {
        if conditions.last() != Some(&outcome.condition.as_str()) {
            conditions.push(&outcome.condition);
        }
    }
    conditions
}

/// The numbers of the runs of an arm under a condition, by seed.
pub(super) fn numbers(
    outcomes: &[Outcome],
    measure: &Measure,
    condition: &str,
    arm: &str,
) -> BTreeMap<u64, f64> {
    let mut numbers = BTreeMap::new();
    for run in runs_of(outcomes, condition, arm) {
        if let Some(value) = run.measures[&measure.name].value() {
            numbers.insert(run.seed, value);
        }
    }

    numbers
}

/// The times of the runs of an arm under a condition, by seed.
pub(super) fn times(
    outcomes: &[Outcome],
    measure: &Measure,
    condition: &str,
    arm: &str,
) -> BTreeMap<u64, TimeTo> {
    let mut times = BTreeMap::new();
    for run in runs_of(outcomes, condition, arm) {
        if let Some((time_s, is_event)) = run.measures[&measure.name].time() {
            times.insert(run.seed, TimeTo { time_s, is_event });
        }
    }

    times
}

/// The estimate of a measure; `None` without runs.
fn estimated(
    outcomes: &[Outcome],
    measure: &Measure,
    condition: &str,
    arm: &str,
) -> Option<Estimated> {
    if measure.is_time() {
        let times = times(outcomes, measure, condition, arm);
        let times: Vec<TimeTo> = times.into_values().collect();
        return (!times.is_empty()).then(|| Estimated::Time(Survival::of(&times)));
    }

    let numbers = numbers(outcomes, measure, condition, arm);
    let numbers: Vec<f64> = numbers.into_values().collect();
    let mut quartiles = [0.0; 5];
    for (quarter, value) in quartiles.iter_mut().enumerate() {
        *value = quantile(&numbers, quarter as f64 / 4.0)?;
    }
    Some(Estimated::Number {
        mean: Estimate::of(&numbers),
        quartiles,
    })
}

fn runs_of<'a>(
    outcomes: &'a [Outcome],
    condition: &'a str,
    arm: &'a str,
) -> impl Iterator<Item = &'a Outcome> {
    outcomes
        .iter()
        .filter(move |run| run.condition == condition && run.arm == arm)
}
