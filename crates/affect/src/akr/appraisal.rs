//! The appraisal components that distinguish one emotion from another.

use crate::affect::Valence;
use serde::{Deserialize, Serialize};

/// The facial expression of an emotion [D: S].
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
    /// No particular expression.
    Neutral,
}

impl FacialExpression {
    /// The valence that this expression shows.
    ///
    /// `None` for surprise, which may be either [D: S], and for a neutral face, which shows nothing \[I\].
    pub fn valence(self) -> Option<Valence> {
        match self {
            Self::Happy => Some(Valence::Positive),
            Self::Sad | Self::Disgusted | Self::Angry | Self::Fearful => Some(Valence::Negative),
            Self::Surprised | Self::Neutral => None,
        }
    }
}

/// The agent responsible for what elicited an emotion [D: S].
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Agency {
    /// The agent that feels the emotion.
    #[serde(rename = "self")]
    Oneself,
    /// Another agent or a thing, identified by name.
    Other(String),
}

/// Whether the eliciting event was expected. The dimension is documented [D: S], its values are not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Novelty {
    /// The event was expected.
    Match,
    /// The event was not expected.
    Mismatch,
}

/// Degree of controllability or modifiability \[I\].
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

/// Whether the agent is certain of what happens. The dimension is documented [D: S], its values are not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// The agent is certain.
    Certain,
    /// The agent is not certain.
    Uncertain,
}

/// Whether what happens agrees with a norm or standard. The dimensions are documented [D: S], their values are
/// not \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compatibility {
    /// Agrees.
    Compatible,
    /// Conflicts.
    Incompatible,
}
