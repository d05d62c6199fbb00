//! Mood, the slow background of emotions: pleasant or unpleasant, more or less intense, about nothing in particular.
//!
//! That there are moods between personality and emotions, that they last for days, and that they have no agent and no
//! stimulus, is documented [D: S]. That a mood is the slow mean of what is felt, and how it acts, is chosen here \[I\].

use crate::parameters::{ParameterError, positive, within};
use serde::{Deserialize, Serialize};

/// The constants of a mood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MoodParameters {
    /// The mood at the start, the felt intensity with the sign of its valence, -1 to 1. Default 0 \[I\].
    pub start: f64,
    /// Time constant with which it follows what is felt, in seconds. Default one day \[I\]; that moods last for days [D: S].
    pub tau_s: f64,
    /// How much a mood of 1 lowers the pressure and one of -1 raises it, 0 to 1. Default 0 \[I\]: it acts on nothing.
    pub weight: f64,
}

impl Default for MoodParameters {
    fn default() -> Self {
        Self {
            start: 0.0,
            tau_s: 86_400.0,
            weight: 0.0,
        }
    }
}

impl MoodParameters {
    /// Validates the values.
    ///
    /// # Errors
    ///
    /// Returns the first [`ParameterError`] found.
    pub fn check(&self) -> Result<(), ParameterError> {
        within("mood.start", self.start, -1.0, 1.0)?;
        positive("mood.tau_s", self.tau_s)?;
        within("mood.weight", self.weight, 0.0, 1.0)
    }

    /// What a mood adds to the pressure: a bad one makes everything more pressing.
    pub fn shift(&self, mood: f64) -> f64 {
        self.weight * -mood
    }

    /// The mood after `dt_s` seconds of an affect, as intensity with the sign of its valence. It stays within -1 and 1.
    ///
    /// A plain share of the tick and no exponential: the two differ by less than a millionth for a mood of hours, and this one
    /// is the same to the last bit in every language.
    pub fn next(&self, mood: f64, felt: f64, dt_s: f64) -> f64 {
        mood + (felt - mood) * (dt_s / self.tau_s).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mood_follows_what_is_felt_with_its_time_constant() {
        let parameters = MoodParameters {
            tau_s: 100.0,
            ..MoodParameters::default()
        };
        let mut mood = 0.0;
        for _ in 0..200 {
            mood = parameters.next(mood, -0.8, 0.5);
        }
        let expected = -0.8 * (1.0 - libm::exp(-1.0));
        assert!((mood - expected).abs() < 0.002, "{mood} after 100 s");
    }

    #[test]
    fn a_mood_never_leaves_its_range() {
        let parameters = MoodParameters {
            tau_s: 0.1,
            ..MoodParameters::default()
        };
        for felt in [-1.0, 1.0] {
            assert_eq!(
                parameters.next(-felt, felt, 5.0),
                felt,
                "a tick longer than the time constant"
            );
        }
    }

    #[test]
    fn a_bad_mood_adds_pressure_and_one_without_weight_adds_none() {
        let heavy = MoodParameters {
            weight: 0.4,
            ..MoodParameters::default()
        };
        assert_eq!((heavy.shift(-0.5), heavy.shift(0.5)), (0.2, -0.2));
        assert_eq!(MoodParameters::default().shift(-1.0), 0.0);
    }

    #[test]
    fn limits_are_allowed_and_what_is_beyond_is_refused() {
        let check = |text: &str| {
            let parameters: MoodParameters = toml::from_str(text).unwrap();
            parameters.check().map_err(|error| error.to_string())
        };
        for text in [
            "start = -1.0",
            "start = 1.0",
            "weight = 0.0",
            "weight = 1.0",
        ] {
            assert_eq!(check(text), Ok(()));
        }
        assert_eq!(
            check("start = -1.1"),
            Err("mood.start must be from -1 to 1, not -1.1".to_owned())
        );
        assert_eq!(
            check("weight = 1.5"),
            Err("mood.weight must be from 0 to 1, not 1.5".to_owned())
        );
        assert_eq!(
            check("weight = nan"),
            Err("mood.weight must be from 0 to 1, not NaN".to_owned())
        );
        assert_eq!(
            check("tau_s = 0.0"),
            Err("mood.tau_s must be above 0, not 0".to_owned())
        );
    }
}
