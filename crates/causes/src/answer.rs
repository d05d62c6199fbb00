//! What is known of a run in the end, as the file of the answer has it.

use protocol::{RunName, Tick};
use serde::{Deserialize, Serialize};
use statistics::Estimate;
use timeline::{DecisionJump, DecisionPoint, ForkOutcomes};

use super::plan::{ForkOutcome, ForkPlan};
use super::question::Question;

/// What decided a run. What is shown of it is read as [`RunDecision`](timeline::RunDecision).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WhyAnswer {
    /// Version of the program.
    pub version: String,
    /// The run.
    pub run: RunName,
    /// Its digest at its last tick.
    pub digest: String,
    /// What was asked.
    pub question: Question,
    /// Whether outcomes are 1 or 0, so that their means are probabilities.
    pub is_share: bool,
    /// The outcome of the run itself; `None` if it has no number.
    pub recorded: Option<f64>,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// The last tick of the run.
    pub last: Tick,
    /// The expected outcome after ticks, in their order.
    pub curve: Vec<DecisionPoint>,
    /// The ticks in which it jumps, in their order.
    pub jumps: Vec<Jump>,
    /// What the kinds of chance can change, each by itself from the first tick on.
    pub kinds: Vec<KindEffect>,
    /// What partitions and faults of the scenario change.
    pub planned: Vec<PlannedEffect>,
    /// The smallest change in a tick that counts as a jump.
    pub least_jump: f64,
    /// The number of forks.
    pub forks: u64,
    /// Those in which a robot failed, if there are any.
    pub failed: Option<FailedForks>,
    /// Whether the budget was enough to look at all that is worth a look.
    pub is_complete: bool,
    /// The answer in a sentence.
    pub sentence: String,
}

/// Forks in which a robot failed. They have no outcome, so the answer is about runs in which none does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FailedForks {
    /// Their number.
    pub forks: u64,
    /// How the first of them begins.
    pub first: ForkPlan,
    /// Its number.
    pub number: u64,
    /// Why its robot failed, and in which tick.
    pub because: String,
}

/// What outcomes of forks give, of which some have none.
#[must_use]
pub(super) fn outcomes_of(outcomes: &[ForkOutcome], is_share: bool) -> ForkOutcomes {
    let failed = outcomes
        .iter()
        .filter(|outcome| matches!(outcome, ForkOutcome::Failed(_)))
        .count();

    let values: Vec<f64> = outcomes.iter().filter_map(ForkOutcome::number).collect();
    let estimate = if is_share {
        let ones = values.iter().filter(|value| **value == 1.0).count();
        Estimate::share(ones, values.len())
    } else {
        Estimate::mean(&values)
    };
    let bounds = estimate.bounds();

    ForkOutcomes {
        n: values.len() as u64,
        value: estimate.value.is_finite().then_some(estimate.value),
        low: bounds.map(|(low, _)| low),
        high: bounds.map(|(_, high)| high),
        failed: failed as u64,
    }
}

/// A tick in which the expected outcome jumps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Jump {
    /// What is shown of it. The outcomes on both sides are those of forks that took no part in finding it.
    #[serde(flatten)]
    pub shown: DecisionJump,
    /// The p value of the difference, after Holm's correction for all ticks that were tested.
    pub p: f64,
    /// Each cause that was tried.
    pub tried: Vec<TriedCause>,
}

/// A cause that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriedCause {
    /// In words.
    pub what: String,
    /// The forks without it.
    pub plan: ForkPlan,
    /// The expected outcome without it.
    pub without: ForkOutcomes,
    /// The p value of the difference to the expected outcome after the tick, after Holm's correction for all causes of the jump.
    pub p: f64,
    /// Whether the outcome is restored without it: at least half of the jump is gone.
    pub restores: bool,
}

/// What a kind of chance can change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindEffect {
    /// The kind.
    pub kind: String,
    /// The share of forks with another outcome than the run, if only this kind is another one from the first tick on.
    pub changed: ForkOutcomes,
}

/// What something that the scenario plans changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedEffect {
    /// In words.
    pub what: String,
    /// The tick in which it begins.
    pub tick: Tick,
    /// The expected outcome with it.
    pub with: ForkOutcomes,
    /// The expected outcome without it.
    pub without: ForkOutcomes,
    /// The p value of the difference, after Holm's correction for all that the scenario plans.
    pub p: f64,
    /// Whether it matters.
    pub matters: bool,
}
