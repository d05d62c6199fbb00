//! Mood: affect that is not about anything in particular.

use super::appraisal::Agency;
use super::refusal::Refusal;
use crate::affect::{Affect, Duration, Focality, Valence};
use crate::scalar::Intensity;
use serde::{Deserialize, Serialize};

/// An affective state that lasts days, has no particular object, and for which no agent is responsible [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawMood", into = "RawMood")]
pub struct Mood {
    affect: Affect,
}

impl Mood {
    /// Creates a mood, which consists of an affect only.
    pub fn new(affect: Affect) -> Self {
        Self { affect }
    }

    /// Valence and intensity.
    pub fn affect(&self) -> Affect {
        self.affect
    }

    /// Always [`Duration::Days`].
    pub fn duration(&self) -> Duration {
        Duration::Days
    }

    /// Always [`Focality::Global`].
    pub fn focality(&self) -> Focality {
        Focality::Global
    }
}

/// The serialized form of a mood.
///
/// It has the attributes that a mood must not have, so that the error can explain them.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMood {
    valence: Valence,
    intensity: Intensity,
    duration: Option<Duration>,
    focality: Option<Focality>,
    agency: Option<Agency>,
}

impl TryFrom<RawMood> for Mood {
    type Error = Refusal;

    fn try_from(raw: RawMood) -> Result<Self, Refusal> {
        if raw.agency.is_some() {
            return Err(Refusal::MoodAgency);
        }

        match raw.duration {
            None | Some(Duration::Days) => {}
            Some(other) => return Err(Refusal::MoodDuration(other)),
        }
        match raw.focality {
            None | Some(Focality::Global) => {}
            Some(_) => return Err(Refusal::MoodFocality),
        }

        Ok(Self::new(Affect {
            valence: raw.valence,
            intensity: raw.intensity,
        }))
    }
}

impl From<Mood> for RawMood {
    fn from(mood: Mood) -> Self {
        Self {
            valence: mood.affect.valence,
            intensity: mood.affect.intensity,
            duration: Some(mood.duration()),
            focality: Some(mood.focality()),
            agency: None,
        }
    }
}
