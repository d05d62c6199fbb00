//! What is known of a run in the end, as the file of the answer has it.

use protocol::{RunName, Tick};
use serde::{Deserialize, Serialize};
use statistics::Estimate;

use super::plan::ForkPlan;
use super::question::Question;

/// What decided a run.
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
    pub curve: Vec<CurvePoint>,
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
    /// Whether the budget was enough to look at all that is worth a look.
    pub is_complete: bool,
    /// The answer in a sentence.
    pub sentence: String,
}

/// The expected outcome of a number of forks, with its interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ForkEstimate {
    /// The forks with an outcome.
    pub n: usize,
    /// Their mean; `None` without one.
    pub value: Option<f64>,
    /// Lower end, if there is an interval.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

impl ForkEstimate {
    /// The estimate of outcomes, of which some forks have none.
    #[must_use]
    pub fn of(outcomes: &[Option<f64>], is_share: bool) -> Self {
        let values: Vec<f64> = outcomes.iter().flatten().copied().collect();
        let estimate = if is_share {
            let ones = values.iter().filter(|value| **value == 1.0).count();
            Estimate::share(ones, values.len())
        } else {
            Estimate::mean(&values)
        };
        let bounds = estimate.bounds();
        Self {
            n: values.len(),
            value: estimate.value.is_finite().then_some(estimate.value),
            low: bounds.map(|(low, _)| low),
            high: bounds.map(|(_, high)| high),
        }
    }
}

/// The expected outcome after a tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// The tick.
    pub tick: Tick,
    /// The estimate; of the last tick, the outcome itself, without an interval.
    #[serde(flatten)]
    pub outcome: ForkEstimate,
}

/// A tick in which the expected outcome jumps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Jump {
    /// The tick.
    pub tick: Tick,
    /// The expected outcome after the tick before, from forks that took no part in finding the jump.
    pub before: ForkEstimate,
    /// The expected outcome after the tick.
    pub after: ForkEstimate,
    /// The p value of the difference, after Holm's correction for all ticks that were tested.
    pub p: f64,
    /// What happened in the tick, in words.
    pub events: Vec<String>,
    /// What caused it, if one event or one kind of chance did.
    pub cause: Option<JumpCause>,
    /// Each cause that was tried.
    pub tried: Vec<TriedCause>,
}

/// The cause of a jump.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JumpCause {
    /// In words.
    pub what: String,
    /// Whether it is an event; else it is a kind of chance.
    pub is_event: bool,
    /// The expected outcome without it.
    pub without: ForkEstimate,
}

/// A cause that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriedCause {
    /// In words.
    pub what: String,
    /// The forks without it.
    pub plan: ForkPlan,
    /// The expected outcome without it.
    pub without: ForkEstimate,
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
    pub changed: ForkEstimate,
}

/// What something that the scenario plans changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedEffect {
    /// In words.
    pub what: String,
    /// The tick in which it begins.
    pub tick: Tick,
    /// The expected outcome with it.
    pub with: ForkEstimate,
    /// The expected outcome without it.
    pub without: ForkEstimate,
    /// The p value of the difference, after Holm's correction for all that the scenario plans.
    pub p: f64,
    /// Whether it matters.
    pub matters: bool,
}
