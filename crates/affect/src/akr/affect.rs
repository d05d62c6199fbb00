//! Affect, the coarse state above moods and emotions, and the attributes that tell levels apart.

use crate::scalar::Intensity;
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
    /// +1 for positive, -1 for negative.
    pub fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }
}

/// How long an affective phenomenon lasts [D: S].
///
/// The seed says in one place that moods are shorter than emotions, and in the description of this
/// attribute that moods last days and emotions minutes. The attribute is what is implemented.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Duration {
    /// An emotion.
    Minutes,
    /// A mood.
    Days,
    /// A personality.
    Lifetime,
}

/// What an affective phenomenon is about. That it separates moods from emotions is documented [D: S]; the
/// values besides global are chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Focality {
    /// Nothing in particular.
    Global,
    /// Something that happens.
    Event,
    /// A thing or an agent.
    Object,
}

/// A coarse affective state: two dimensions and no more [D: S].
///
/// The figure of the taxonomy lists duration and focality here, too [D: F2]; they have values only where a state is a
/// mood or an emotion, and stand there. Moods and emotions contain one. It is all that the sensory-motor level may see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affect {
    /// Pleasant or unpleasant.
    pub valence: Valence,
    /// How strongly.
    pub intensity: Intensity,
}

impl Affect {
    /// Intensity with the sign of the valence, in `[-1, 1]` \[I\].
    pub fn signed(&self) -> f64 {
        self.valence.sign() * self.intensity.value()
    }
}
