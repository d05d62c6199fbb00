//! Affect, the coarse state that moods and emotions refine, and the attributes that distinguish the levels.

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
/// The paper contradicts itself: it calls moods shorter than emotions in one place, and in the description of this
/// attribute moods last days and emotions minutes. This crate implements the attribute.
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

/// What an affective phenomenon is about.
///
/// That this attribute separates moods from emotions is documented [D: S]. The values other than `Global` are
/// chosen here \[I\].
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

/// A coarse affective state with two dimensions [D: S].
///
/// Every mood and every emotion contains one, and it is all that the sensory-motor level can see. The figure of the
/// taxonomy also lists duration and focality here [D: F2]. Those only have values for moods and emotions, which
/// provide them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affect {
    /// Pleasant or unpleasant.
    pub valence: Valence,
    /// Strength of the state.
    pub intensity: Intensity,
}

impl Affect {
    /// Intensity with the sign of the valence, in `[-1, 1]` \[I\].
    pub fn signed(&self) -> f64 {
        self.valence.sign() * self.intensity.value()
    }
}
