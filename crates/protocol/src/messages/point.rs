//! Places on the field.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::finite;
use crate::codec::FieldError;

/// A place on the field: meters from its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Point {
    /// Meters to the right.
    pub x: f64,
    /// Meters up.
    pub y: f64,
}

impl Point {
    /// The place at `x`, `y` meters.
    #[must_use]
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Straight distance, meters.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        let dx = other.x - self.x;
        let dy = other.y - self.y;

        (dx * dx + dy * dy).sqrt()
    }

    /// Refuses coordinates that are not finite; `field` is the point's path in the message.
    pub(super) fn check(self, field: &str) -> Result<(), FieldError> {
        // The path is written only for a point that is wrong: this runs for every report.
        if self.x.is_finite() && self.y.is_finite() {
            return Ok(());
        }

        finite(self.x, &format!("{field}.x"))?;
        finite(self.y, &format!("{field}.y"))
    }
}
