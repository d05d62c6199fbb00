//! A parameter with the values `on` and `off`.

use serde::{Deserialize, Serialize};

/// Whether a part of a robot takes part in an experiment.
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
