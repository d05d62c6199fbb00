//! Differences between arms, paired by seed: runs with the same seed begin alike and have the same chance.

use std::collections::BTreeMap;

use serde::Serialize;

use super::file::Experiment;
use super::play::Outcome;
use crate::statistics::Estimate;

/// The difference between an arm and the baseline under one condition.
#[derive(Debug, Clone, Serialize)]
pub struct Contrast {
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Name of the arm that it is compared with.
    pub baseline: String,
    /// Arm minus baseline, by measure: mean and interval over the pairs of runs with the same seed.
    #[serde(flatten)]
    pub differences: BTreeMap<String, Estimate>,
}

impl Experiment {
    /// Differences of every arm to the baseline under each condition, in the order of the table; none without a baseline.
    #[must_use]
    pub fn contrast(&self, outcomes: &[Outcome]) -> Vec<Contrast> {
        let Some(baseline) = &self.baseline else {
            return Vec::new();
        };

        let mut contrasts = Vec::new();
        for condition in conditions_of(outcomes) {
            for arm in &self.arms {
                if arm.name == *baseline {
                    continue;
                }
                contrasts.push(Contrast {
                    condition: condition.to_owned(),
                    arm: arm.name.clone(),
                    baseline: baseline.clone(),
                    differences: self.differences(outcomes, condition, &arm.name, baseline),
                });
            }
        }
        contrasts
    }

    fn differences(
        &self,
        outcomes: &[Outcome],
        condition: &str,
        arm: &str,
        baseline: &str,
    ) -> BTreeMap<String, Estimate> {
        let runs = by_seed(outcomes, condition, arm);
        let others = by_seed(outcomes, condition, baseline);

        let mut differences = BTreeMap::new();
        for measure in &self.measures {
            if !measure.contrast {
                continue;
            }
            let mut values = Vec::new();
            for (seed, run) in &runs {
                if let Some(other) = others.get(seed) {
                    values.push(run.measures[&measure.name] - other.measures[&measure.name]);
                }
            }
            differences.insert(measure.name.clone(), Estimate::of(&values));
        }
        differences
    }
}

/// The conditions of the outcomes, each once, in their order.
fn conditions_of(outcomes: &[Outcome]) -> Vec<&str> {
    let mut conditions: Vec<&str> = Vec::new();
    for outcome in outcomes {
        if conditions.last() != Some(&outcome.condition.as_str()) {
            conditions.push(&outcome.condition);
        }
    }
    conditions
}

fn by_seed<'a>(outcomes: &'a [Outcome], condition: &str, arm: &str) -> BTreeMap<u64, &'a Outcome> {
    let mut runs = BTreeMap::new();
    for outcome in outcomes {
        if outcome.condition == condition && outcome.arm == arm {
            runs.insert(outcome.seed, outcome);
        }
    }
    runs
}
