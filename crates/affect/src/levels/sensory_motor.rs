//! The automatic level: valence and intensity modify motor output.

use crate::akr::{Affect, Valence};
use crate::parameters::{ParameterError, not_negative};
use serde::{Deserialize, Serialize};

/// Constants of a [`SensoryMotor`] level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensoryMotorParameters {
    /// Factor on motor output (dimensionless) under full negative affect. Default 1.5 \[I\]; that a concerned
    /// refiller increases its speed [D: S, Table 2].
    pub negative_gain: f64,
    /// The same under full positive affect. Default 1 \[I\].
    pub positive_gain: f64,
    /// Intensity at which the factor departs from 1. Default 0.45 \[I\], where CONCERNED begins.
    pub onset: f64,
    /// Intensity at which it is reached. Default 0.45 \[I\]: the same as the onset, so that it comes at once.
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

/// The level that sees an [`Affect`] and nothing else, and gives a factor for motor output.
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
    /// Checks the constants.
    pub fn new(parameters: SensoryMotorParameters) -> Result<Self, ParameterError> {
        not_negative("negative_gain", parameters.negative_gain)?;
        not_negative("positive_gain", parameters.positive_gain)?;
        not_negative("onset", parameters.onset)?;
        let SensoryMotorParameters { onset, full, .. } = parameters;
        let ascends = onset <= full && full <= 1.0;
        if ascends {
            Ok(Self { parameters })
        } else {
            Err(ParameterError::NotAscending {
                lower: onset,
                upper: full,
            })
        }
    }

    /// The factor: 1 below the onset, the gain of the valence from `full`, and linear in between.
    pub fn gain(&self, affect: Affect) -> f64 {
        let SensoryMotorParameters {
            negative_gain,
            positive_gain,
            onset,
            full,
        } = self.parameters;
        let gain = match affect.valence {
            Valence::Positive => positive_gain,
            Valence::Negative => negative_gain,
        };
        let intensity = affect.intensity.value();
        let share = if intensity >= full {
            1.0
        } else if intensity <= onset {
            0.0
        } else {
            (intensity - onset) / (full - onset)
        };
        1.0 + (gain - 1.0) * share
    }
}
