//! The loss of power over a distance.

use std::f64::consts::PI;

/// Speed of light, meters per second, exact by definition.
const LIGHT_MPS: f64 = 299_792_458.0;

/// How much weaker a signal is after a distance, without anything in its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PathLoss {
    /// The loss grows with the logarithm of the distance (Rappaport, Wireless Communications; ns-3's `LogDistancePropagationLossModel`).
    /// At less than the reference distance it is that at the reference distance.
    LogDistance {
        /// The exponent: 2 in free space, 3 to 4 where signals are reflected.
        exponent: f64,
        /// Reference distance, meters.
        reference_m: f64,
        /// Loss at the reference distance, dB.
        reference_db: f64,
    },
    /// Free space (Friis 1946) between antennas without gain. The loss is never below 0 dB.
    Friis {
        /// Frequency, hertz.
        frequency_hz: f64,
    },
}

impl PathLoss {
    /// The loss after a distance, dB.
    #[must_use]
    pub fn loss_db(&self, distance_m: f64) -> f64 {
        match *self {
            Self::LogDistance {
                exponent,
                reference_m,
                reference_db,
            } => {
                let ratio = (distance_m / reference_m).max(1.0);
                reference_db + 10.0 * exponent * libm::log10(ratio)
            }
            Self::Friis { frequency_hz } => {
                let wavelengths = 4.0 * PI * distance_m * frequency_hz / LIGHT_MPS;
                20.0 * libm::log10(wavelengths.max(1.0))
            }
        }
    }

    /// The distance after which the loss is above `budget_db`, meters; 0 if it is so everywhere.
    #[must_use]
    pub fn reach_m(&self, budget_db: f64) -> f64 {
        match *self {
            Self::LogDistance {
                exponent,
                reference_m,
                reference_db,
            } => {
                let left_db = budget_db - reference_db;
                if left_db < 0.0 {
                    return 0.0;
                }
                reference_m * libm::pow(10.0, left_db / (10.0 * exponent))
            }
            Self::Friis { .. } if budget_db < 0.0 => 0.0,
            Self::Friis { frequency_hz } => {
                libm::pow(10.0, budget_db / 20.0) * LIGHT_MPS / (4.0 * PI * frequency_hz)
            }
        }
    }
}
