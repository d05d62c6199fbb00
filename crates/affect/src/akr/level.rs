//! The levels of the taxonomy, and the values that distinguish them.

use serde::{Deserialize, Serialize};

/// A level of the taxonomy (Figure 1 of the paper): each refines the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AffectiveLevel {
    /// The lasting character of an agent [D: S].
    Personality,
    /// Negative or positive affect: valence and intensity [D: S].
    Affect,
    /// A muted, long affect that is about nothing in particular [D: S].
    Mood,
    /// A short affect with a cause and all components [D: S].
    Emotion,
}

impl AffectiveLevel {
    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Personality => "personality",
            Self::Affect => "affect",
            Self::Mood => "mood",
            Self::Emotion => "emotion",
        }
    }

    /// Whether a node of this level can be below one of `parent`.
    pub fn refines(self, parent: Self) -> bool {
        match self {
            Self::Personality => parent == Self::Personality,
            Self::Affect => matches!(parent, Self::Personality | Self::Affect),
            Self::Mood => matches!(parent, Self::Affect | Self::Mood),
            Self::Emotion => matches!(parent, Self::Affect | Self::Emotion),
        }
    }

    /// How long a state of this level lasts [D: S, F2]; `None` for affect, which has no duration of its own.
    pub fn duration(self) -> Option<Duration> {
        match self {
            Self::Personality => Some(Duration::Lifetime),
            Self::Affect => None,
            Self::Mood => Some(Duration::Days),
            Self::Emotion => Some(Duration::Minutes),
        }
    }

    /// Whether a state of this level can be about this. An emotion has an event, an agent or an object that it is about
    /// \[I\]; all others have a global focality [D: S, F2].
    pub fn allows(self, focality: Focality) -> bool {
        (focality == Focality::Global) != (self == Self::Emotion)
    }
}

/// How long an affective state lasts [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Duration {
    /// As long as the agent.
    Lifetime,
    /// Days: moods.
    Days,
    /// Minutes: emotions, by default.
    Minutes,
}

impl Duration {
    /// The name used in files and state variables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lifetime => "lifetime",
            Self::Days => "days",
            Self::Minutes => "minutes",
        }
    }
}

/// What kind of thing an affective state is about. That focality distinguishes emotions from moods, whose focality is
/// global, is documented [D: S]; its other values are chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Focality {
    /// Nothing in particular.
    Global,
    /// Something that happens.
    Event,
    /// Another agent.
    Agent,
    /// A thing.
    Object,
}

impl Focality {
    /// The name used in files and state variables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Global => "global",
            Self::Event => "event",
            Self::Agent => "agent",
            Self::Object => "object",
        }
    }
}
