//! The sensory-motor level, in which valence and intensity modify motor output.

use crate::akr::{Affect, Valence};
use crate::parameters::{ParameterError, not_negative};
use serde::{Deserialize, Serialize};

/// Constants of a [`SensoryMotor`] level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensoryMotorParameters {
    /// Factor on motor output (dimensionless) under full negative affect. Default 1.5 \[I\].
    ///
    /// It is documented that a concerned refiller increases its speed [D: S, Table 2].
    pub negative_gain: f64,
    /// Factor on motor output (dimensionless) under full positive affect. Default 1 \[I\].
    pub positive_gain: f64,
    /// Intensity above which the factor differs from 1. Default 0.45 \[I\], the threshold of CONCERNED.
    pub onset: f64,
    /// Intensity from which the full factor applies. Default 0.45 \[I\], the same as the onset, which makes the change a
    /// step.
    pub full: f64,
}

impl Default for SensoryMotorParameters {
    fn default() -> Self {
        Self {
            negative_gain: 1.5,
            positive_gain: 1.0,
            onset: 0.45,
            full: 0.45,
        }
    }
}

/// A level that turns an [`Affect`] into a factor on motor output.
///
/// ```
/// use affect::akr::{Affect, Valence};
/// use affect::Intensity;
/// use affect::levels::{SensoryMotor, SensoryMotorParameters};
/// let level = SensoryMotor::new(SensoryMotorParameters::default())?;
/// let pressed = Affect { valence: Valence::Negative, intensity: Intensity::saturating(0.6) };
/// assert_eq!(0.9144 * level.gain(pressed), 0.9144 * 1.5); // a speed in m/s
/// # Ok::<(), affect::ParameterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensoryMotor {
    parameters: SensoryMotorParameters,
}

impl SensoryMotor {
    /// Creates a level with these parameters.
    ///
    /// # Errors
    ///
    /// Returns an error if a factor or the onset is negative, or unless `onset <= full <= 1`.
    pub fn new(parameters: SensoryMotorParameters) -> Result<Self, ParameterError> {
        not_negative("negative_gain", parameters.negative_gain)?;
        not_negative("positive_gain", parameters.positive_gain)?;
        not_negative("onset", parameters.onset)?;

        let lower = parameters.onset;
        let upper = parameters.full;
        let ascends = lower <= upper && upper <= 1.0;
        if !ascends {
            return Err(ParameterError::NotAscending { lower, upper });
        }

        Ok(Self { parameters })
    }

    /// The factor on motor output (dimensionless).
    ///
    /// It is 1 up to the onset, the gain of the valence from `full` on, and linear in between.
    pub fn gain(&self, affect: Affect) -> f64 {
        let gain = match affect.valence {
            Valence::Positive => self.parameters.positive_gain,
            Valence::Negative => self.parameters.negative_gain,
        };

        1.0 + (gain - 1.0) * self.share(affect.intensity.value())
    }

    fn share(&self, intensity: f64) -> f64 {
        let onset = self.parameters.onset;
        let full = self.parameters.full;

        if intensity >= full {
            1.0
        } else if intensity <= onset {
            0.0
        } else {
            (intensity - onset) / (full - onset)
        }
    }
}
