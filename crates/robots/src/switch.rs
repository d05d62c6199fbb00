//! On or off, as a parameter file says it.

use serde::{Deserialize, Serialize};

/// A part of a robot that an experiment can do without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Switch {
    /// It takes part.
    On,
    /// It does not.
    Off,
}

impl Switch {
    /// Whether it takes part.
    #[must_use]
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

/// Refuses a parameter that must be a number above zero.
pub(crate) fn positive(name: &str, value: f64) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} must be above 0, not {value}"))
    }
}

/// Refuses a parameter that must be a number of at least zero.
pub(crate) fn not_negative(name: &str, value: f64) -> Result<(), String> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(format!("{name} must be at least 0, not {value}"))
}
