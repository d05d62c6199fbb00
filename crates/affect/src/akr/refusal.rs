//! The errors of the taxonomy's constructors.

use super::appraisal::FacialExpression;
use crate::affect::{Duration, Valence};

/// Why attributes do not form a valid personality, mood or emotion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A personality that does not last a lifetime.
    #[error("a personality lasts a lifetime, not {0:?}")]
    PersonalityDuration(Duration),
    /// A personality that is about an event or an object.
    #[error("a personality is global, not about an event or object")]
    PersonalityFocality,
    /// A mood that does not last days.
    #[error("a mood lasts days, not {0:?}")]
    MoodDuration(Duration),
    /// A mood that is about an event or an object.
    #[error("a mood is global, not about an event or object")]
    MoodFocality,
    /// A mood for which an agent is responsible.
    #[error("a mood has no agency, since no specific stimulus elicits it")]
    MoodAgency,
    /// An emotion without a name.
    #[error("an emotion must have a name")]
    EmotionName,
    /// An emotion that does not last minutes.
    #[error(
        "{name} must last minutes: only moods last days, and only personalities last a lifetime"
    )]
    EmotionDuration {
        /// Name of the emotion.
        name: String,
    },
    /// An emotion that is not about an event or an object.
    #[error("{name} must be about an event or an object: only moods and personalities are global")]
    EmotionFocality {
        /// Name of the emotion.
        name: String,
    },
    /// A facial expression that contradicts the valence.
    ///
    /// Surprise goes with either valence [D: S], and so does a neutral face.
    #[error("{name} has {valence:?} valence, which contradicts its {face:?} face")]
    FaceContradictsValence {
        /// Name of the emotion.
        name: String,
        /// Its valence.
        valence: Valence,
        /// Its facial expression.
        face: FacialExpression,
    },
    /// An emotion without a definite valence, although only surprise may have either.
    #[error("{name} must have a valence: only surprise may have either")]
    ValenceOpen {
        /// Name of the emotion.
        name: String,
    },
    /// Another agent is responsible but not named.
    #[error("{name} holds another agent responsible, which must be named")]
    AgentUnnamed {
        /// Name of the emotion.
        name: String,
    },
}
