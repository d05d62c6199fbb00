//! Where people want to go.

use crate::premises::WallLine;
use crate::vector::Vector;

/// A person has reached a line at this distance, m. \[I\]
const REACHED_M: f64 = 0.05;

/// A place on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Waypoint {
    /// A place, reached within a distance.
    Place {
        /// The place, m.
        at: Vector,
        /// The distance, m.
        within_m: f64,
    },
    /// A door or the end of a corridor: people walk to the closest place of it where they fit through, and have reached it when
    /// they cross it.
    Line(WallLine),
    /// Forever in a direction, of length 1.
    Direction(Vector),
}

/// What people do at the end of their way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtEnd {
    /// They leave the crowd.
    Leave,
    /// They stand.
    #[default]
    Stand,
}

/// The way of a person, or of many: waypoints in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Itinerary {
    /// The waypoints.
    pub waypoints: Vec<Waypoint>,
    /// What follows the last one.
    pub at_end: AtEnd,
}

impl Itinerary {
    /// Forever in a direction.
    #[must_use]
    pub fn along(direction: Vector) -> Self {
        Self {
            waypoints: vec![Waypoint::Direction(direction.unit())],
            at_end: AtEnd::Stand,
        }
    }

    /// Through lines, and away at the last one.
    #[must_use]
    pub fn leaving_by(lines: &[WallLine]) -> Self {
        Self {
            waypoints: lines.iter().map(|line| Waypoint::Line(*line)).collect(),
            at_end: AtEnd::Leave,
        }
    }
}

impl Waypoint {
    /// The direction to it from a place, of length 1, or zero.
    pub(crate) fn direction(&self, from: Vector, radius_m: f64) -> Vector {
        match self {
            Self::Place { at, .. } => (*at - from).unit(),
            Self::Line(line) => (fitting(line, radius_m).closest_to(from) - from).unit(),
            Self::Direction(direction) => *direction,
        }
    }

    /// Whether a person who goes from one place to another has reached it.
    pub(crate) fn is_reached(&self, from: Vector, to: Vector) -> bool {
        match self {
            Self::Place { at, within_m } => (*at - to).length_squared() <= within_m * within_m,
            Self::Line(line) => {
                (line.closest_to(to) - to).length_squared() <= REACHED_M * REACHED_M
                    || line.is_met(from, to)
            }
            Self::Direction(_) => false,
        }
    }

    /// Whether its coordinates are numbers.
    pub(crate) fn is_finite(&self) -> bool {
        match self {
            Self::Place { at, within_m } => at.is_finite() && within_m.is_finite(),
            Self::Line(line) => line.from.is_finite() && line.to.is_finite(),
            Self::Direction(direction) => direction.is_finite(),
        }
    }
}

/// The part of a line where a body fits; its middle if there is none.
fn fitting(line: &WallLine, radius_m: f64) -> WallLine {
    let along = line.to - line.from;
    let cut = along.unit() * radius_m.min(along.length() / 2.0);
    WallLine::new(line.from + cut, line.to - cut)
}
