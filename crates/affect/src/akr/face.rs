//! Facial expressions.

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

    /// The name used in files and state variables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Happy => "happy",
            Self::Sad => "sad",
            Self::Surprised => "surprised",
            Self::Disgusted => "disgusted",
            Self::Angry => "angry",
            Self::Fearful => "fearful",
            Self::Neutral => "neutral",
        }
    }
}
