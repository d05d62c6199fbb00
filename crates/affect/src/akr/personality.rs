//! Personality: the dispositions that last a lifetime.

use crate::affect::Valence;
use crate::scalar::Caution;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// An agent's preference about its own affect [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preference {
    /// Acts to avoid negative affect.
    AvoidNegative,
    /// Acts to experience positive affect.
    SeekPositive,
}

impl Preference {
    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::AvoidNegative => "avoid_negative",
            Self::SeekPositive => "seek_positive",
        }
    }
}

/// The lasting character of an agent, the same in every situation [D: S, F2].
///
/// Any personality can have any emotion [D: S]. Caution determines how fast emotions rise, and the preferences determine
/// which anticipated affect counts in a decision. The published taxonomy also has traits such as "vindictive" and
/// interactive strategies such as "tit for tat" [D: F2, S]: a node of [`Schemata`](crate::Schemata) can name them, and no
/// documented robot has one that changes what it does.
///
/// ```
/// use affect::akr::{Personality, Valence};
/// let careful: Personality = toml::from_str("caution = 0.9\npreferences = ['avoid_negative']")?;
/// assert!(careful.cares_about(Valence::Negative) && !careful.cares_about(Valence::Positive));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Personality {
    /// How fast the urgency of emotions rises.
    pub caution: Caution,
    /// Preferences about its own affect. By default it avoids negative and seeks positive affect [D: S].
    pub preferences: BTreeSet<Preference>,
}

impl Default for Personality {
    fn default() -> Self {
        Self {
            caution: Caution::default(),
            preferences: BTreeSet::from([Preference::AvoidNegative, Preference::SeekPositive]),
        }
    }
}

impl Personality {
    /// Whether the agent has a preference about affect of this valence.
    pub fn cares_about(&self, valence: Valence) -> bool {
        let preference = match valence {
            Valence::Negative => Preference::AvoidNegative,
            Valence::Positive => Preference::SeekPositive,
        };
        self.preferences.contains(&preference)
    }
}
