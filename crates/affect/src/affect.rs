//! Affect, the coarse state that emotions refine.

use crate::scalar::{Intensity, Urgency};
use serde::{Deserialize, Serialize};

/// Pleasant or unpleasant [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Valence {
    /// Pleasant.
    Positive,
    /// Unpleasant.
    Negative,
}

impl Valence {
    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Positive => "positive",
            Self::Negative => "negative",
        }
    }

    /// +1 for positive, -1 for negative.
    pub fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }

    /// How strongly an emotion of this valence is felt while the need is as urgent as this \[I\].
    ///
    /// Good feelings are strongest when nothing presses, bad ones when everything does: `1 - urgency` for a positive
    /// emotion, `urgency` for a negative one. So the signed intensity falls as the urgency rises, and HAPPY, CONFIDENT,
    /// CONCERNED and FRUSTRATED are in this order.
    pub fn felt(self, urgency: Urgency) -> Intensity {
        match self {
            Self::Positive => Intensity::saturating(1.0 - urgency.value()),
            Self::Negative => Intensity::saturating(urgency.value()),
        }
    }
}

/// A coarse affective state with two dimensions [D: S].
///
/// It is all that the sensory-motor level can see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affect {
    /// Pleasant or unpleasant.
    pub valence: Valence,
    /// Strength of the state.
    pub intensity: Intensity,
}

impl Affect {
    /// The affect of an emotion of this valence at this urgency.
    pub fn new(valence: Valence, urgency: Urgency) -> Self {
        Self {
            valence,
            intensity: valence.felt(urgency),
        }
    }

    /// Intensity with the sign of the valence, in `[-1, 1]` \[I\].
    pub fn signed(&self) -> f64 {
        self.valence.sign() * self.intensity.value()
    }
}
