//! Every constant of the emotion dynamics, in one place and with a name.
//!
//! The equations and thresholds of the original robots are in a paper whose body this project could not
//! read. So each number below is a choice \[I\] unless marked otherwise, and whoever holds the original
//! tables only edits a file.

use crate::scalar::{Caution, IntensityLabel};
use serde::{Deserialize, Serialize};

/// Which emotions the standard ladder has. Both sets are documented [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StateSet {
    /// HAPPY, CONFIDENT, CONCERNED, FRUSTRATED: the waiter and the refiller.
    #[default]
    Murphy4,
    /// HAPPY, CONCERNED, FRUSTRATED, ANGRY: the example of the seed's dynamics section.
    Akr4,
}

/// The constants of the emotion dynamics.
///
/// Deserializes from a table in which any field may be absent; an unknown field is an error, since a
/// misspelled parameter would silently run another experiment.
///
/// ```
/// let parameters = affect::DynamicsParameters::from_toml("tau_up_s = 2.0\nstate_set = 'akr4'")?;
/// assert_eq!((parameters.tau_up_s, parameters.tau_down_s), (2.0, 3.0));
/// assert!(affect::DynamicsParameters::from_toml("tau_upp_s = 2.0").is_err());
/// # Ok::<(), affect::ParameterError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DynamicsParameters {
    /// Which emotions there are. Default `murphy4`; both sets [D: S].
    pub state_set: StateSet,
    /// Need ratio (dimensionless) at which intensity saturates for gain 1. Default 2 \[I\].
    pub rho_max: f64,
    /// Gain (dimensionless) of a robot without caution. Default 0.5 \[I\].
    pub caution_gain_base: f64,
    /// What full caution adds to the gain (dimensionless). Default 1 \[I\]; that it is not negative, so that a
    /// more cautious robot's feelings rise faster [D: S].
    pub caution_gain_slope: f64,
    /// Time constant, in seconds, with which intensity rises; divided by the gain. Default 1.5 \[I\].
    pub tau_up_s: f64,
    /// Time constant, in seconds, with which intensity falls. Default 3 \[I\].
    pub tau_down_s: f64,
    /// Intensity at which CONFIDENT is entered. Default 0.25 \[I\].
    pub th_confident: f64,
    /// Intensity at which CONCERNED is entered. Default 0.45 \[I\].
    pub th_concerned: f64,
    /// Intensity at which FRUSTRATED is entered. Default 0.75 \[I\].
    pub th_frustrated: f64,
    /// Intensity that must be exceeded for `anger_s` before ANGRY is entered. Default 0.95 \[I\].
    pub th_angry: f64,
    /// How long, in seconds, intensity must exceed `th_angry` while somebody else is to blame. Default
    /// 15 \[I\].
    pub anger_s: f64,
    /// An emotion is left when intensity is this far below the threshold that entered it. Default 0.08 \[I\];
    /// the pattern of an enter and a leave threshold [D: N].
    pub hysteresis: f64,
    /// Least time, in seconds, between two changes of emotion. Default 1 \[I\].
    pub dwell_s: f64,
    /// How long, in seconds, hope lasts without success. Default 15 \[I\].
    pub hope_s: f64,
    /// Intensities at which low, medium, high and very high begin. Default 0.2, 0.4, 0.6, 0.8 \[I\]; that
    /// there are five labels [D: S].
    pub label_cuts: [f64; 4],
}

impl Default for DynamicsParameters {
    fn default() -> Self {
        Self {
            state_set: StateSet::Murphy4,
            rho_max: 2.0,
            caution_gain_base: 0.5,
            caution_gain_slope: 1.0,
            tau_up_s: 1.5,
            tau_down_s: 3.0,
            th_confident: 0.25,
            th_concerned: 0.45,
            th_frustrated: 0.75,
            th_angry: 0.95,
            anger_s: 15.0,
            hysteresis: 0.08,
            dwell_s: 1.0,
            hope_s: 15.0,
            label_cuts: IntensityLabel::CUTS,
        }
    }
}

/// Parameters with which the dynamics would have no meaning.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// The text is not TOML, or not a table of these parameters.
    #[error("{0}")]
    Syntax(String),
    /// A length of time or a ratio that must be above zero and finite.
    #[error("{name} must be a number above 0, not {value}")]
    NotPositive {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A length of time or a ratio that must not be below zero.
    #[error("{name} must be a number of at least 0, not {value}")]
    Negative {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Thresholds that do not ascend would let the robot skip an emotion.
    #[error("thresholds must ascend within [0, 1]: {lower} is followed by {upper}")]
    NotAscending {
        /// The value that comes first.
        lower: f64,
        /// The value that comes after it.
        upper: f64,
    },
    /// A ladder needs an emotion to start from.
    #[error("a ladder of emotions needs at least one rung")]
    NoRungs,
    /// An emotion has two places, so that its next one would be ambiguous.
    #[error("{0} occurs more than once in the set of emotions")]
    Repeated(&'static str),
    /// The belief "cannot" discourages from an emotion that is not on the ladder.
    #[error("{0} is not on the ladder, so nobody can become discouraged from there")]
    NotOnLadder(&'static str),
}

impl DynamicsParameters {
    /// Reads and checks parameters from TOML text.
    pub fn from_toml(text: &str) -> Result<Self, ParameterError> {
        let parameters: Self =
            toml::from_str(text).map_err(|error| ParameterError::Syntax(error.to_string()))?;
        parameters.check()?;
        Ok(parameters)
    }

    /// How strongly a robot of this caution reacts: `0.5 + caution` with the defaults.
    pub fn gain(&self, caution: Caution) -> f64 {
        self.caution_gain_base + self.caution_gain_slope * caution.value()
    }

    /// Says what is wrong with the values, if anything is. Thresholds are checked with the ladder they make.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("rho_max", self.rho_max)?;
        positive("caution_gain_base", self.caution_gain_base)?;
        positive("tau_up_s", self.tau_up_s)?;
        positive("tau_down_s", self.tau_down_s)?;
        not_negative("caution_gain_slope", self.caution_gain_slope)?;
        not_negative("anger_s", self.anger_s)?;
        not_negative("hysteresis", self.hysteresis)?;
        not_negative("dwell_s", self.dwell_s)?;
        not_negative("hope_s", self.hope_s)?;
        ascending(&self.label_cuts)?;
        let [confident, concerned] = [self.th_confident, self.th_concerned];
        ascending(&[confident, concerned, self.th_frustrated, self.th_angry])
    }
}

pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), ParameterError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ParameterError::NotPositive { name, value })
    }
}

pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), ParameterError> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ParameterError::Negative { name, value })
    }
}

/// Strictly ascending, above 0 and not above 1.
pub(crate) fn ascending(values: &[f64]) -> Result<(), ParameterError> {
    let mut lower = 0.0;
    for &upper in values {
        let follows = upper > lower && upper <= 1.0;
        if !follows {
            return Err(ParameterError::NotAscending { lower, upper });
        }
        lower = upper;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        DynamicsParameters::from_toml(text).unwrap_err().to_string()
    }

    #[test]
    fn an_empty_file_gives_the_defaults() {
        assert_eq!(
            DynamicsParameters::from_toml(""),
            Ok(DynamicsParameters::default())
        );
    }

    #[test]
    fn senseless_values_are_refused_with_a_reason() {
        assert_eq!(
            refusal("tau_up_s = 0.0"),
            "tau_up_s must be a number above 0, not 0"
        );
        assert_eq!(
            refusal("dwell_s = -1.0"),
            "dwell_s must be a number of at least 0, not -1"
        );
        assert_eq!(
            refusal("rho_max = nan"),
            "rho_max must be a number above 0, not NaN"
        );
        assert!(refusal("th_confident = 0.5").contains("0.5 is followed by 0.45"));
        assert!(refusal("th_angry = 1.5").contains("must ascend"));
        assert!(refusal("caution = 0.5").contains("unknown field"));
    }

    #[test]
    fn gain_grows_with_caution() {
        let parameters = DynamicsParameters::default();
        let gain = |caution| parameters.gain(Caution::saturating(caution));
        assert_eq!([gain(0.0), gain(0.5), gain(1.0)], [0.5, 1.0, 1.5]);
    }
}
