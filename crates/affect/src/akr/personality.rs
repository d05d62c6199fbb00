//! Personality: the dispositions that last a lifetime.

use super::refusal::Refusal;
use crate::affect::{Duration, Focality, Valence};
use crate::scalar::Caution;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A lasting disposition. The named ones are documented [D: F2]; the published list is open-ended, too.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trait {
    /// Ambitious.
    Ambitious,
    /// Prudent.
    Prudent,
    /// Spendthrift.
    Spendthrift,
    /// Vindictive.
    Vindictive,
    /// Playboy.
    Playboy,
    /// Self-centered.
    SelfCentered,
    /// Any other.
    Other(String),
}

/// How an agent deals with others. The named ones are documented [D: F2, S]; the published list is open-ended, too.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Treats others as they treated it.
    TitForTat,
    /// Takes advantage of others.
    Cheat,
    /// Treats others fairly. The default \[I\].
    #[default]
    Fair,
    /// Any other.
    Other(String),
}

/// An agent's preference about its own affect [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preference {
    /// Acts to avoid negative affect.
    AvoidNegative,
    /// Dislikes negative affect.
    DislikeNegative,
    /// Acts to experience positive affect.
    SeekPositive,
    /// Likes positive affect.
    LikePositive,
}

impl Preference {
    /// The valence that the preference is about.
    pub fn valence(self) -> Valence {
        match self {
            Self::AvoidNegative | Self::DislikeNegative => Valence::Negative,
            Self::SeekPositive | Self::LikePositive => Valence::Positive,
        }
    }
}

/// The lasting character of an agent, the same in every situation [D: S, F2].
///
/// Any personality can have any emotion [D: S]. Personality affects how strongly emotions are felt, through
/// [`Caution`].
///
/// ```
/// use affect::akr::Personality;
/// let careful: Personality = toml::from_str("caution = 0.9\ntraits = ['prudent', { other = 'shy' }]")?;
/// assert_eq!(careful.caution.value(), 0.9);
/// assert!(toml::from_str::<Personality>("duration = 'days'").is_err());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawPersonality", into = "RawPersonality")]
pub struct Personality {
    /// How fast the intensity of emotions rises.
    pub caution: Caution,
    /// Further traits.
    pub traits: BTreeSet<Trait>,
    /// How the agent deals with others.
    pub strategy: Strategy,
    /// Preferences about its own affect. By default it avoids negative and seeks positive affect [D: S].
    pub preferences: BTreeSet<Preference>,
}

impl Default for Personality {
    fn default() -> Self {
        Self {
            caution: Caution::default(),
            traits: BTreeSet::new(),
            strategy: Strategy::default(),
            preferences: BTreeSet::from([Preference::AvoidNegative, Preference::SeekPositive]),
        }
    }
}

impl Personality {
    /// The default personality with this caution.
    pub fn with_caution(caution: Caution) -> Self {
        Self {
            caution,
            ..Self::default()
        }
    }

    /// Always [`Duration::Lifetime`].
    pub fn duration(&self) -> Duration {
        Duration::Lifetime
    }

    /// Always [`Focality::Global`].
    pub fn focality(&self) -> Focality {
        Focality::Global
    }

    /// Whether the agent has a preference about affect of this valence.
    pub fn cares_about(&self, valence: Valence) -> bool {
        self.preferences
            .iter()
            .any(|preference| preference.valence() == valence)
    }
}

/// The serialized form of a personality.
///
/// It has the attributes that are fixed for personalities, so that the error can explain other values.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPersonality {
    #[serde(default)]
    caution: Caution,
    #[serde(default)]
    traits: BTreeSet<Trait>,
    #[serde(default)]
    strategy: Strategy,
    preferences: Option<BTreeSet<Preference>>,
    duration: Option<Duration>,
    focality: Option<Focality>,
}

impl TryFrom<RawPersonality> for Personality {
    type Error = Refusal;

    fn try_from(raw: RawPersonality) -> Result<Self, Refusal> {
        match raw.duration {
            None | Some(Duration::Lifetime) => {}
            Some(other) => return Err(Refusal::PersonalityDuration(other)),
        }
        match raw.focality {
            None | Some(Focality::Global) => {}
            Some(_) => return Err(Refusal::PersonalityFocality),
        }

        let default = Self::default();
        Ok(Self {
            caution: raw.caution,
            traits: raw.traits,
            strategy: raw.strategy,
            preferences: raw.preferences.unwrap_or(default.preferences),
        })
    }
}

impl From<Personality> for RawPersonality {
    fn from(personality: Personality) -> Self {
        Self {
            duration: Some(personality.duration()),
            focality: Some(personality.focality()),
            caution: personality.caution,
            traits: personality.traits,
            strategy: personality.strategy,
            preferences: Some(personality.preferences),
        }
    }
}
