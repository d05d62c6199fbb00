//! Distances that a robot senses by a fan of rays.

use serde::{Deserialize, Serialize};

/// Most rays of a fan.
pub const MAX_RAYS: u32 = 720;

/// A fan of rays around a robot. The first points in the direction of motion that the robot reported last, the others follow
/// counter-clockwise at equal angles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Rays {
    /// How many.
    pub count: u32,
    /// How far they reach, meters.
    pub range_m: f64,
}

impl Rays {
    /// The bearing of a ray, relative to the direction of motion, radians counter-clockwise, from 0 on.
    #[must_use]
    pub fn bearing_rad(&self, index: usize) -> f64 {
        std::f64::consts::TAU * index as f64 / f64::from(self.count)
    }
}
