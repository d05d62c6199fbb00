//! The taxonomy: personality, affect, mood and emotion, distinguished by their attributes.
//!
//! The attributes and most of their values are documented [D: S, F2]. The figure that lists the values of novelty,
//! controllability, modifiability, certainty and the two compatibilities was not readable; the values used here are
//! marked \[I\] where they are defined.
//!
//! Combinations that the taxonomy excludes either cannot be expressed or return a [`Refusal`] with the reason. For
//! example, [`Mood`] has no agency, and deserializing a mood that specifies one is an error.
//!
//! ```
//! use affect::akr::Mood;
//! let mood: Mood = toml::from_str("valence = 'negative'\nintensity = 0.3")?;
//! let error = toml::from_str::<Mood>("valence = 'negative'\nintensity = 0.3\nagency = 'self'").unwrap_err();
//! assert!(error.to_string().contains("a mood has no agency"));
//! # Ok::<(), toml::de::Error>(())
//! ```

mod appraisal;
mod emotion;
mod mood;
mod personality;
mod refusal;
mod tendency;

pub use crate::affect::{Affect, Duration, Focality, Valence};
pub use appraisal::{Agency, Certainty, Compatibility, Degree, FacialExpression, Novelty};
pub use emotion::{Account, Clause, ClauseKind, Components, Emotion, GoalStatus, Signal};
pub use mood::Mood;
pub use personality::{Personality, Preference, Strategy, Trait};
pub use refusal::Refusal;
pub use tendency::{ActionTendency, PrimaryTendency, TABLE_1, TABLE_2, TaskTendency};
