//! The taxonomy: personality, affect, mood and emotion, told apart by their attributes.
//!
//! Attributes and most of their values are documented [D: S, F2]; the figure that lists the values of
//! novelty, controllability, modifiability, certainty and the two compatibilities was not readable, and what
//! stands here for them is marked \[I\] where it is defined.
//!
//! What the taxonomy excludes cannot be expressed, or is refused with a [`Refusal`] that says why: a mood has
//! no field for an agency, and a mood read from a file that names one is an error.
//!
//! ```
//! use affect::akr::Mood;
//! let mood: Mood = toml::from_str("valence = 'negative'\nintensity = 0.3")?;
//! let error = toml::from_str::<Mood>("valence = 'negative'\nintensity = 0.3\nagency = 'self'").unwrap_err();
//! assert!(error.to_string().contains("a mood has no agency"));
//! # Ok::<(), toml::de::Error>(())
//! ```

mod affect;
mod appraisal;
mod emotion;
mod mood;
mod personality;
mod tendency;

pub use affect::{Affect, Duration, Focality, Valence};
pub use appraisal::{Agency, Certainty, Compatibility, Degree, FacialExpression, Novelty};
pub use emotion::{Account, Clause, ClauseKind, Components, Emotion, GoalStatus, Signal};
pub use mood::Mood;
pub use personality::{Personality, Preference, Strategy, Trait};
pub use tendency::{ActionTendency, PrimaryTendency, TABLE_1, TABLE_2, TaskTendency};

/// Why something is not a personality, a mood or an emotion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A personality that does not last a lifetime.
    #[error("a personality lasts a lifetime, not {0:?}")]
    PersonalityDuration(Duration),
    /// A personality that is about something.
    #[error("a personality is global, not about an event or object")]
    PersonalityFocality,
    /// A mood that does not last days.
    #[error("a mood lasts days, not {0:?}")]
    MoodDuration(Duration),
    /// A mood that is about something.
    #[error("a mood is global, not about an event or object")]
    MoodFocality,
    /// A mood for which somebody is responsible.
    #[error("a mood has no agency, since no specific stimulus elicits it")]
    MoodAgency,
    /// An emotion without a name.
    #[error("an emotion has a name")]
    EmotionName,
    /// An emotion that lasts longer than emotions do.
    #[error(
        "{name} lasts minutes, as every emotion: what lasts days is a mood, what lasts a lifetime a personality"
    )]
    EmotionDuration {
        /// The emotion.
        name: String,
    },
    /// An emotion about nothing.
    #[error("{name} is about an event or an object: what is global is a mood or a personality")]
    EmotionFocality {
        /// The emotion.
        name: String,
    },
    /// A face that contradicts the valence. Only surprise may be either [D: S]; a neutral face says nothing.
    #[error("{name} is {valence:?}, which a {face:?} face contradicts")]
    FaceContradictsValence {
        /// The emotion.
        name: String,
        /// Its valence.
        valence: Valence,
        /// Its face.
        face: FacialExpression,
    },
    /// An emotion whose valence may be either, and that is not surprise.
    #[error("{name} needs a valence of its own: only surprise may be either")]
    ValenceOpen {
        /// The emotion.
        name: String,
    },
    /// Another agent is responsible, and has no name.
    #[error("{name} points to another agent, who must be named")]
    AgentUnnamed {
        /// The emotion.
        name: String,
    },
}
