//! The constants of the emotion dynamics.
//!
//! The equations and thresholds of the original robots were published in an article whose body was not available to
//! this project. Each number below is therefore a choice \[I\] unless marked otherwise. With the original tables at
//! hand, only a parameter file has to be edited.

use crate::scalar::{Caution, IntensityLabel};
use serde::{Deserialize, Serialize};

/// The set of emotions on the standard ladder. Both sets are documented [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StateSet {
    /// HAPPY, CONFIDENT, CONCERNED, FRUSTRATED: the waiter and the refiller.
    #[default]
    Murphy4,
    /// HAPPY, CONCERNED, FRUSTRATED, ANGRY: the example in the paper's section on dynamics.
    Akr4,
}

/// The constants of the emotion dynamics.
///
/// Deserializes from a table in which any field may be absent. Unknown fields are errors, because a misspelled
/// parameter would silently run a different experiment.
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
    /// The set of emotions. Default `murphy4`; both sets [D: S].
    pub state_set: StateSet,
    /// Need ratio (dimensionless) at which the urgency saturates with a gain of 1. Default 2 \[I\].
    pub rho_max: f64,
    /// Gain (dimensionless) of a robot without caution. Default 0.5 \[I\].
    pub caution_gain_base: f64,
    /// Increase of the gain (dimensionless) at full caution. Default 1 \[I\].
    ///
    /// It must not be negative, because the emotions of a more cautious robot rise faster [D: S].
    pub caution_gain_slope: f64,
    /// Time constant of rising urgency, in seconds, which is divided by the gain. Default 1.5 \[I\].
    pub tau_up_s: f64,
    /// Time constant of falling urgency, in seconds. Default 3 \[I\].
    pub tau_down_s: f64,
    /// Urgency at which CONFIDENT is entered. Default 0.25 \[I\].
    pub th_confident: f64,
    /// Urgency at which CONCERNED is entered. Default 0.45 \[I\].
    pub th_concerned: f64,
    /// Urgency at which FRUSTRATED is entered. Default 0.75 \[I\].
    pub th_frustrated: f64,
    /// Urgency that must be exceeded for `anger_s` to enter ANGRY. Default 0.95 \[I\].
    pub th_angry: f64,
    /// How long, in seconds, the urgency must exceed `th_angry` while another agent is to blame. Default 15 \[I\].
    pub anger_s: f64,
    /// How far the urgency must fall below the threshold of an emotion to leave it. Default 0.08 \[I\].
    ///
    /// The use of separate thresholds to enter and to leave an emotion is documented [D: N].
    pub hysteresis: f64,
    /// Minimum time between two changes of emotion, in seconds. Default 1 \[I\].
    pub dwell_s: f64,
    /// Importance of a small positive input, such as progress on the way home. Default 0.4 \[I\]: it leads from
    /// FRUSTRATED to CONCERNED. That the effect depends on the importance [D: S].
    pub low_importance: f64,
    /// Importance of a great positive input, such as a new errand. Default 0.75 \[I\]: it leads to CONFIDENT.
    pub high_importance: f64,
    /// Importance of a negative input, such as giving up. Default 0.15 \[I\].
    pub setback: f64,
    /// How long HOPEFUL lasts without success, in seconds. Default 15 \[I\].
    pub hope_s: f64,
    /// Lower bounds of the labels low, medium, high and very high. Default 0.2, 0.4, 0.6, 0.8 \[I\].
    ///
    /// That there are five labels is documented [D: S].
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
            low_importance: 0.4,
            high_importance: 0.75,
            setback: 0.15,
            hope_s: 15.0,
            label_cuts: IntensityLabel::CUTS,
        }
    }
}

/// Invalid parameters of the dynamics, a ladder, a level or an estimator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// The text is not valid TOML, or not a table of these parameters.
    #[error("{0}")]
    Syntax(String),
    /// A parameter that must be positive and finite.
    #[error("{name} must be above 0, not {value}")]
    NotPositive {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter that must be finite and not negative.
    #[error("{name} must be at least 0, not {value}")]
    Negative {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter outside of its range.
    #[error("{name} must be from {least} to {greatest}, not {value}")]
    OutsideRange {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least allowed value.
        least: f64,
        /// The greatest allowed value.
        greatest: f64,
    },
    /// Thresholds that do not ascend. The robot could skip an emotion.
    #[error(
        "thresholds must be in ascending order within [0, 1], but {lower} is followed by {upper}"
    )]
    NotAscending {
        /// The value that comes first.
        lower: f64,
        /// The value that comes after it.
        upper: f64,
    },
    /// A threshold that is not above the one before it, or not within (0, 1].
    #[error("{name} must be above {lower_name}, {lower}, and at most 1, but is {value}")]
    Threshold {
        /// The threshold.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The threshold before it.
        lower_name: &'static str,
        /// Its value.
        lower: f64,
    },
    /// A ladder without rungs, on which no robot could start.
    #[error("a ladder of emotions needs at least one rung")]
    NoRungs,
    /// An emotion that occurs more than once, so that the next emotion would be ambiguous.
    #[error("{0} occurs more than once in the set of emotions")]
    Repeated(&'static str),
    /// Discouragement starts from an emotion that is not on the ladder.
    #[error("{0} is not on the ladder, so discouragement cannot start from it")]
    NotOnLadder(&'static str),
}

impl DynamicsParameters {
    /// Parses and validates parameters from TOML text.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is not a valid table of parameters.
    pub fn from_toml(text: &str) -> Result<Self, ParameterError> {
        let parameters: Self =
            toml::from_str(text).map_err(|error| ParameterError::Syntax(error.to_string()))?;
        parameters.check()?;

        Ok(parameters)
    }

    /// How strongly a robot of this caution reacts (dimensionless): `0.5 + caution` with the defaults.
    pub fn gain(&self, caution: Caution) -> f64 {
        self.caution_gain_base + self.caution_gain_slope * caution.value()
    }

    /// Validates the values.
    ///
    /// # Errors
    ///
    /// Returns the first [`ParameterError`] found.
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
        not_negative("setback", self.setback)?;

        ascending(&self.label_cuts)?;
        ascend(&[
            ("low_importance", self.low_importance),
            ("high_importance", self.high_importance),
        ])?;
        self.check_thresholds()
    }

    /// Checks the thresholds of the state set; the other ones are not in use.
    fn check_thresholds(&self) -> Result<(), ParameterError> {
        let confident = ("th_confident", self.th_confident);
        let concerned = ("th_concerned", self.th_concerned);
        let frustrated = ("th_frustrated", self.th_frustrated);
        let angry = ("th_angry", self.th_angry);
        let in_use = match self.state_set {
            StateSet::Murphy4 => [confident, concerned, frustrated],
            StateSet::Akr4 => [concerned, frustrated, angry],
        };

        ascend(&in_use)
    }
}

/// Checks that named values are strictly ascending, above 0 and at most 1.
fn ascend(values: &[(&'static str, f64)]) -> Result<(), ParameterError> {
    let mut lower_name = "the start";
    let mut lower = 0.0;
    for &(name, value) in values {
        let ascends = value > lower && value <= 1.0;
        if !ascends {
            return Err(ParameterError::Threshold {
                name,
                value,
                lower_name,
                lower,
            });
        }
        lower_name = name;
        lower = value;
    }
    Ok(())
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

pub(crate) fn within(
    name: &'static str,
    value: f64,
    least: f64,
    greatest: f64,
) -> Result<(), ParameterError> {
    if (least..=greatest).contains(&value) {
        Ok(())
    } else {
        Err(ParameterError::OutsideRange {
            name,
            value,
            least,
            greatest,
        })
    }
}

/// Checks that the values are strictly ascending, above 0 and at most 1.
pub(crate) fn ascending(values: &[f64]) -> Result<(), ParameterError> {
    let mut lower = 0.0;

    for &upper in values {
        let ascends = upper > lower && upper <= 1.0;
        if !ascends {
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
    fn invalid_values_are_rejected_with_a_reason() {
        assert_eq!(refusal("tau_up_s = 0.0"), "tau_up_s must be above 0, not 0");
        assert_eq!(
            refusal("dwell_s = -1.0"),
            "dwell_s must be at least 0, not -1"
        );
        assert_eq!(refusal("rho_max = nan"), "rho_max must be above 0, not NaN");

        assert_eq!(
            refusal("th_confident = 0.5"),
            "th_concerned must be above th_confident, 0.5, and at most 1, but is 0.45"
        );
        assert_eq!(
            refusal("state_set = 'akr4'\nth_angry = 1.5"),
            "th_angry must be above th_frustrated, 0.75, and at most 1, but is 1.5"
        );
        assert!(refusal("caution = 0.5").contains("unknown field"));
    }

    #[test]
    fn only_thresholds_in_use_are_checked() {
        assert!(DynamicsParameters::from_toml("th_frustrated = 1.0").is_ok());
        assert!(DynamicsParameters::from_toml("th_angry = 0.1").is_ok());
        assert!(DynamicsParameters::from_toml("state_set = 'akr4'\nth_confident = 0.9").is_ok());
        assert!(DynamicsParameters::from_toml("state_set = 'akr4'\nth_frustrated = 1.0").is_err());
    }

    #[test]
    fn gain_grows_with_caution() {
        let parameters = DynamicsParameters::default();

        for (caution, gain) in [(0.0, 0.5), (0.5, 1.0), (1.0, 1.5)] {
            assert_eq!(parameters.gain(Caution::saturating(caution)), gain);
        }
    }
}
