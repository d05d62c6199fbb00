//! What a unit of an experiment has given.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::plan::Unit;
use super::unit::Played;

pub use observe::Measured;

/// What was measured in one unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitOutcome {
    /// Number of the unit in the plan, from 0.
    pub unit: usize,
    /// Name of the condition.
    pub condition: String,
    /// The level of each factor, by the name of the factor, in the order of the file; empty for a named condition.
    pub levels: Vec<(String, String)>,
    /// Name of the arm.
    pub arm: String,
    /// Seed of the run.
    pub seed: u64,
    /// Seed of the run whose emotions its robots showed, in a yoked arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yoked_to_seed: Option<u64>,
    /// Digest of the run.
    pub digest: String,
    /// The measures, by name.
    pub measures: BTreeMap<String, Measured>,
    /// The verdicts about expectations, by name: `pass`, `fail` or `undecided`.
    pub verdicts: BTreeMap<String, String>,
}

/// A unit that could not be played to its end.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedUnit {
    /// Number of the unit in the plan, from 0.
    pub unit: usize,
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Seed of the run.
    pub seed: u64,
    /// The reason.
    pub reason: String,
}

impl UnitOutcome {
    /// The outcome of a unit.
    pub(super) fn of(unit: &Unit<'_>, played: &Played) -> Self {
        Self {
            unit: unit.number,
            condition: unit.condition.name.clone(),
            levels: unit.condition.levels.clone(),
            arm: unit.arm.name.clone(),
            seed: unit.seed,
            yoked_to_seed: unit.yoked_to_seed(),
            digest: played.digest.clone(),
            measures: played.measures.clone(),
            verdicts: played.verdicts.clone(),
        }
    }
}
