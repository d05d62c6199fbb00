//! Robots that drive like wheels.

use serde::{Deserialize, Serialize};

use super::limits::finite;
use super::point::Point;
use crate::codec::FieldError;

/// A velocity in the robot's own frame, as `cmd_vel` has it in ROS.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Velocity {
    /// Speed along its heading, m/s; negative backward.
    pub linear_mps: f64,
    /// Turn rate, rad/s, counter-clockwise.
    pub angular_radps: f64,
}

impl Velocity {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        finite(self.linear_mps, "velocity.linear_mps")?;
        finite(self.angular_radps, "velocity.angular_radps")
    }
}

/// Where a robot that drives like wheels stands, where it looks, and how it moves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Pose {
    /// Its center, meters.
    pub location: Point,
    /// Its heading, radians counter-clockwise from +x, in [-pi, pi], in whole millionths.
    pub heading_rad: f64,
    /// The velocity that it has reached.
    pub velocity: Velocity,
}

/// The limits of a robot that drives like wheels. It may propose any velocity: the simulator applies them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct DriveLimits {
    /// Highest speed, forward and backward, m/s: the lower one of its own limit and that of the field.
    pub max_speed_mps: f64,
    /// Fastest turn, to both sides, rad/s. Absent: it has no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_turn_radps: Option<f64>,
    /// Largest change of the speed, m/s². Absent: it has no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_acceleration_mps2: Option<f64>,
    /// Largest change of the turn rate, rad/s². Absent: it has no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_turn_acceleration_radps2: Option<f64>,
}
