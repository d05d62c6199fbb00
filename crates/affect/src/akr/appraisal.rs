//! The components by which one emotion differs from another.

use super::affect::Valence;
use serde::{Deserialize, Serialize};

/// The face that goes with an emotion [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FacialExpression {
    /// A smile.
    Happy,
    /// Corners of the mouth down.
    Sad,
    /// Eyes and mouth open.
    Surprised,
    /// Nose wrinkled.
    Disgusted,
    /// Brows drawn together.
    Angry,
    /// Brows raised and drawn together.
    Fearful,
    /// None in particular.
    Neutral,
}

impl FacialExpression {
    /// The valence that this face shows; none for surprise, which may be either [D: S], and for a neutral
    /// face, which shows nothing \[I\].
    pub fn valence(self) -> Option<Valence> {
        match self {
            Self::Happy => Some(Valence::Positive),
            Self::Sad | Self::Disgusted | Self::Angry | Self::Fearful => Some(Valence::Negative),
            Self::Surprised | Self::Neutral => None,
        }
    }
}

/// Who is responsible for what elicited an emotion [D: S].
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Agency {
    /// The agent that feels it.
    #[serde(rename = "self")]
    Oneself,
    /// Somebody or something else, by name.
    Other(String),
}

/// Whether the eliciting event was expected. The dimension is documented [D: S], the values are not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Novelty {
    /// As expected.
    Match,
    /// Not as expected.
    Mismatch,
}

/// How far something is given. Values of controllability and modifiability \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Degree {
    /// Not at all.
    None,
    /// A little.
    Low,
    /// In part.
    Medium,
    /// Fully.
    High,
}

/// Whether the agent is sure of what happens. The dimension is documented [D: S], the values are not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Sure.
    Certain,
    /// Not sure.
    Uncertain,
}

/// Whether what happens agrees with a norm or standard. The dimensions are documented [D: S], the values are
/// not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compatibility {
    /// Agrees.
    Compatible,
    /// Conflicts.
    Incompatible,
}
