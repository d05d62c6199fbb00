//! What observers are told of the world that does not change in an epoch.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::sensing::Rays;
use crate::name::RobotName;

/// The shape of a body that is not a square of the run's size. Bodies do not turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum BodyShape {
    /// Width along x and height along y, meters.
    Rectangle([f64; 2]),
    /// Radius, meters.
    Disc(f64),
}

impl BodyShape {
    /// Width and height of the smallest rectangle around it, meters.
    #[must_use]
    pub fn size_m(self) -> [f64; 2] {
        match self {
            Self::Rectangle(size_m) => size_m,
            Self::Disc(radius_m) => [radius_m * 2.0; 2],
        }
    }
}

/// Walls, shapes of bodies, and how robots sense: what does not change in an epoch. Lengths are in steps of 0.1 mm.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StaticWorld {
    /// Walls, each the corners of a line, meters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<Vec<[f64; 2]>>,
    /// Shapes of the fixed obstacles, in their order, `null` for squares of the run's size; empty if all are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle_shapes: Vec<Option<BodyShape>>,
    /// Robots with a shape of their own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub robot_shapes: BTreeMap<RobotName, BodyShape>,
    /// Where robots look, if they do not look all around, or measure ranges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensing: Option<SensingLimits>,
    /// Frames have every so manyth guest only, because all would be longer than a message; left out where frames have all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guest_sample: Option<u32>,
}

impl StaticWorld {
    /// Whether there are no walls, all bodies are squares of the run's size, and robots look all around.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Where robots look.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensingLimits {
    /// Distance within which they sense other bodies, meters.
    pub range_m: f64,
    /// Angle that a robot overlooks, half of it to each side of its direction, radians; none is all around.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_of_view_rad: Option<f64>,
    /// The fan of rays of robots that ask for ranges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<Rays>,
}
