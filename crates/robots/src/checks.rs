//! What the robots share to appraise their situation. "Checks" is the paper's word for it \[D\]; all numbers are \[I\].

use affect::akr::Appraisal;
use serde::{Deserialize, Serialize};

use crate::bounds::positive;

/// How far a robot looks to appraise its situation \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AppraisalParameters {
    /// How far ahead it predicts its measures, s. Default 5 \[I\].
    pub prediction_s: f64,
    /// How far back it judges what it does, s. Default 60 \[I\].
    pub recent_s: f64,
}

impl Default for AppraisalParameters {
    fn default() -> Self {
        Self {
            prediction_s: 5.0,
            recent_s: 60.0,
        }
    }
}

impl AppraisalParameters {
    /// # Errors
    /// The first value that is wrong.
    pub(crate) fn check(self) -> Result<(), String> {
        positive("appraisal.prediction_s", self.prediction_s)?;
        positive("appraisal.recent_s", self.recent_s)
    }
}

/// The appraisal of a robot that has perceived nothing yet.
pub(crate) fn initial() -> Appraisal {
    Appraisal::default()
        .with_novelty(0.0)
        .with_modifiability(0.5)
        .with_standards(1.0, 1.0)
}
