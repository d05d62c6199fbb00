//! Personality: what stays the same for a lifetime.

use super::Refusal;
use super::affect::{Duration, Focality, Valence};
use crate::scalar::Caution;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A lasting disposition. The named ones are documented [D: F2]; the list is open there too.
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

/// How an agent deals with others. The named ones are documented [D: F2, S]; the list is open there too.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Does as it is done by.
    TitForTat,
    /// Takes its advantage.
    Cheat,
    /// Gives everyone their due. The default \[I\].
    #[default]
    Fair,
    /// Any other.
    Other(String),
}

/// What an agent wants of its own affect [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preference {
    /// Acts so that negative affect does not come.
    AvoidNegative,
    /// Does not like negative affect.
    DislikeNegative,
    /// Acts so that positive affect comes.
    SeekPositive,
    /// Likes positive affect.
    LikePositive,
}

impl Preference {
    /// The affect that it is about.
    pub fn valence(self) -> Valence {
        match self {
            Self::AvoidNegative | Self::DislikeNegative => Valence::Negative,
            Self::SeekPositive | Self::LikePositive => Valence::Positive,
        }
    }
}

/// What an agent is like, in every situation and for as long as it lives [D: S, F2].
///
/// Emotions do not depend on it: any personality can have any emotion [D: S]. It acts on how strongly
/// they are felt, through [`Caution`].
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
    /// How fast feelings rise.
    pub caution: Caution,
    /// Other traits.
    pub traits: BTreeSet<Trait>,
    /// How it deals with others.
    pub strategy: Strategy,
    /// What it wants of its own affect. Avoid negative and seek positive unless said otherwise [D: S].
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
    /// An otherwise ordinary personality of this caution.
    pub fn with_caution(caution: Caution) -> Self {
        Self {
            caution,
            ..Self::default()
        }
    }

    /// A lifetime.
    pub fn duration(&self) -> Duration {
        Duration::Lifetime
    }

    /// Global.
    pub fn focality(&self) -> Focality {
        Focality::Global
    }

    /// Whether it has a preference about affect of this valence: to have the positive, to be spared the
    /// negative.
    pub fn cares_about(&self, valence: Valence) -> bool {
        self.preferences
            .iter()
            .any(|preference| preference.valence() == valence)
    }
}

/// What a file may say of a personality; see the like of it for moods.
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
        let RawPersonality {
            caution,
            traits,
            strategy,
            preferences,
            ..
        } = raw;
        let preferences = preferences.unwrap_or_else(|| Self::default().preferences);
        Ok(Self {
            caution,
            traits,
            strategy,
            preferences,
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
