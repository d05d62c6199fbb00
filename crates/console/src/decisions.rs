//! What decided a recorded run, as the page draws it.

use recording::RunDecisions;
use serde::Serialize;
use timeline::RunDecision;

/// The answers of `cars why` about an epoch.
#[derive(Debug, Default, Serialize)]
pub(crate) struct ShownDecisions {
    answers: Vec<ShownDecision>,
    /// What cannot be shown, a sentence each.
    notes: Vec<String>,
}

/// An answer with its words.
#[derive(Debug, Serialize)]
struct ShownDecision {
    #[serde(flatten)]
    decision: RunDecision,
    /// What the curve is of.
    axis: String,
    /// Ends of its axis.
    range: (f64, f64),
    /// These in words.
    range_words: (String, String),
    /// The jumps in words.
    told: Vec<String>,
}

impl From<RunDecisions> for ShownDecisions {
    fn from(found: RunDecisions) -> Self {
        Self {
            answers: found.all.into_iter().map(ShownDecision::from).collect(),
            notes: found.notes,
        }
    }
}

impl From<RunDecision> for ShownDecision {
    fn from(decision: RunDecision) -> Self {
        let range = decision.range();
        let jumps = decision.jumps.iter();
        Self {
            axis: decision.axis(),
            range,
            range_words: (decision.number(range.0), decision.number(range.1)),
            told: jumps.map(|jump| decision.told(jump)).collect(),
            decision,
        }
    }
}
