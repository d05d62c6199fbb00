//! What the runs of one arm under one condition have in common, measure by measure.

use std::collections::BTreeMap;

use observe::{Measure, Measured};
use serde::Serialize;
use statistics::{CensoredTime, Estimate, Survival, quantile};

use super::file::Experiment;
use super::outcome::{FailedUnit, UnitOutcome};

/// One measure of the runs of an arm under a condition.
#[derive(Debug, Clone, Serialize)]
pub struct ArmMeasure {
    /// Name of the measure.
    pub measure: String,
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Its estimate.
    #[serde(flatten)]
    pub estimate: Estimated,
    /// The runs that it is not of.
    pub excluded: Excluded,
}

/// The estimate of a measure; each has its number of runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Estimated {
    /// Of a number of each run.
    Number {
        /// Mean with interval.
        mean: Estimate,
        /// Smallest value, lower quartile, median, upper quartile and largest value; `None` without values.
        quartiles: Option<[f64; 5]>,
    },
    /// Of the time to an event, which some runs do not reach.
    Time {
        /// Share of the runs at risk that have the event by their end.
        share: Estimate,
        /// The curve of the runs at risk.
        #[serde(flatten)]
        survival: Survival,
    },
}

/// How many runs have no number, by the reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Excluded {
    /// What the time begins with never happened.
    pub not_at_risk: usize,
    /// No pair of events, whose durations have no mean and no maximum.
    pub no_pair: usize,
    /// A pair of events was open at the end, so the number is known to be larger than some other.
    pub unfinished: usize,
    /// The run has no such number.
    pub missing: usize,
    /// The run could not be played to its end.
    pub failed: usize,
}

impl Excluded {
    pub(super) fn of<'a>(measured: impl Iterator<Item = &'a Measured>, failed: usize) -> Self {
        let mut excluded = Self {
            failed,
            ..Self::default()
        };
        for one in measured {
            match one {
                Measured::Value { .. } | Measured::Reached { .. } | Measured::NotReached { .. } => {
                }
                Measured::NotAtRisk => excluded.not_at_risk += 1,
                Measured::NoPair => excluded.no_pair += 1,
                Measured::Unfinished { .. } => excluded.unfinished += 1,
                Measured::Missing { .. } => excluded.missing += 1,
            }
        }
        excluded
    }

    /// Whether every run has a number.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl std::fmt::Display for Excluded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut parts = Vec::new();
        for (count, what) in [
            (self.not_at_risk, "not at risk"),
            (self.no_pair, "no pair"),
            (self.unfinished, "unfinished"),
            (self.missing, "missing"),
            (self.failed, "failed"),
        ] {
            if count > 0 {
                parts.push(format!("{count} {what}"));
            }
        }
        f.write_str(&parts.join(", "))
    }
}

impl Estimated {
    /// The estimate of what was measured in some runs.
    #[must_use]
    pub fn of(measure: &Measure, measured: &[&Measured]) -> Self {
        if measure.is_time() {
            let times: Vec<CensoredTime> = measured.iter().filter_map(|one| time_of(one)).collect();
            let survival = Survival::of(&times);
            return Self::Time {
                share: Estimate::share(survival.events, survival.n),
                survival,
            };
        }

        let numbers: Vec<f64> = measured.iter().filter_map(|one| one.value()).collect();
        Self::of_numbers(&numbers)
    }

    /// The estimate of numbers, such as times that every run has reached.
    #[must_use]
    pub fn of_numbers(numbers: &[f64]) -> Self {
        let quarter = |place: f64| quantile(numbers, place / 4.0).unwrap_or(f64::NAN);
        Self::Number {
            mean: Estimate::mean(numbers),
            quartiles: (!numbers.is_empty()).then(|| [0.0, 1.0, 2.0, 3.0, 4.0].map(quarter)),
        }
    }

    /// Number of runs that it is of.
    #[must_use]
    pub fn n(&self) -> usize {
        match self {
            Self::Number { mean, .. } => mean.n,
            Self::Time { survival, .. } => survival.n,
        }
    }
}

impl Experiment {
    /// Estimates of every measure over the seeds, for each arm under each condition that was run, in the order of the file.
    #[must_use]
    pub fn estimate(&self, outcomes: &[UnitOutcome], failures: &[FailedUnit]) -> Vec<ArmMeasure> {
        let mut cells = Vec::new();
        for measure in &self.measures {
            for condition in conditions_of(outcomes, failures) {
                for arm in &self.arms {
                    let measured = by_seed(outcomes, measure, condition, &arm.name);
                    let failed = failed(failures, condition, &arm.name);
                    if measured.is_empty() && failed == 0 {
                        continue;
                    }
                    let measured: Vec<&Measured> = measured.into_values().collect();
                    cells.push(ArmMeasure {
                        measure: measure.name.clone(),
                        condition: condition.to_owned(),
                        arm: arm.name.clone(),
                        estimate: Estimated::of(measure, &measured),
                        excluded: Excluded::of(measured.iter().copied(), failed),
                    });
                }
            }
        }

        cells
    }
}

/// The conditions of the units, each once, in the order of the units.
pub(super) fn conditions_of<'a>(
    outcomes: &'a [UnitOutcome],
    failures: &'a [FailedUnit],
) -> Vec<&'a str> {
    let mut units = BTreeMap::new();
    for outcome in outcomes {
        units.insert(outcome.unit, outcome.condition.as_str());
    }
    for failure in failures {
        units.insert(failure.unit, failure.condition.as_str());
    }

    let mut conditions: Vec<&str> = units.into_values().collect();
    conditions.dedup();
    conditions
}

/// Number of runs of an arm under a condition that could not be played to their end.
pub(super) fn failed(failures: &[FailedUnit], condition: &str, arm: &str) -> usize {
    failures
        .iter()
        .filter(|failure| failure.condition == condition && failure.arm == arm)
        .count()
}

/// What was measured in the runs of an arm under a condition, by seed.
pub(super) fn by_seed<'a>(
    outcomes: &'a [UnitOutcome],
    measure: &Measure,
    condition: &str,
    arm: &str,
) -> BTreeMap<u64, &'a Measured> {
    let mut measured = BTreeMap::new();
    for run in outcomes {
        if run.condition == condition
            && run.arm == arm
            && let Some(one) = run.measures.get(&measure.name)
        {
            measured.insert(run.seed, one);
        }
    }
    measured
}

/// The time of a run that was at risk.
pub(super) fn time_of(measured: &Measured) -> Option<CensoredTime> {
    let (time_s, is_event) = measured.time()?;
    Some(CensoredTime { time_s, is_event })
}
