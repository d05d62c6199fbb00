//! What can be wrong with a hall, with the index and the place, so that the caller can put the name to it.

use crate::point::Point;
use std::fmt;

/// Three numbers that are no triangular distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangularError {
    /// As given.
    pub min: f64,
    /// As given.
    pub mode: f64,
    /// As given.
    pub max: f64,
}

impl fmt::Display for TriangularError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { min, mode, max } = self;
        write!(
            f,
            "need 0 <= min <= mode <= max, all finite; got min {min}, mode {mode}, max {max}"
        )
    }
}

impl std::error::Error for TriangularError {}

/// Why a [`Hall`](crate::Hall) cannot become a [`World`](crate::World).
///
/// Indices count from 0 in the order of the hall's own lists; places are centers in metres, as given.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum HallError {
    /// A size, a time or a speed is not a number in the range that makes sense.
    OutOfRange {
        /// The quantity, as it is called in the hall, with its unit.
        name: &'static str,
        /// As given.
        value: f64,
        /// The smallest value accepted.
        min: f64,
        /// The largest value accepted.
        max: f64,
    },
    /// The field is smaller than one body.
    FieldTooSmall {
        /// Width and height of the field, m.
        size_m: (f64, f64),
        /// Side of a body, m.
        body_m: f64,
    },
    /// More bodies than the index can number.
    TooManyBodies {
        /// Obstacles, robots and guests together.
        count: usize,
        /// [`BODIES_MAX`](crate::BODIES_MAX).
        max: usize,
    },
    /// A fixed obstacle does not lie wholly inside the field.
    ObstacleOffField {
        /// Which obstacle.
        index: usize,
        /// Its center.
        at: Point,
    },
    /// A robot does not lie wholly inside the field.
    RobotOffField {
        /// Which robot.
        index: usize,
        /// Its center.
        at: Point,
    },
    /// A robot overlaps a fixed obstacle.
    RobotOnObstacle {
        /// Which robot.
        index: usize,
        /// Its center.
        at: Point,
        /// Which obstacle (the first, if several).
        obstacle: usize,
    },
    /// A robot overlaps a robot before it in the list.
    RobotOnRobot {
        /// Which robot.
        index: usize,
        /// Its center.
        at: Point,
        /// The robot it overlaps (the first, if several).
        other: usize,
    },
    /// The guests do not fit between the obstacles and the robots.
    NoRoom {
        /// How many guests were asked for.
        count: usize,
        /// How many fit, set in rows.
        room: usize,
    },
}

impl fmt::Display for HallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OutOfRange {
                name,
                value,
                min,
                max,
            } => {
                write!(
                    f,
                    "{name} is {value:?}; it must be a number from {min:?} to {max:?}"
                )
            }
            Self::FieldTooSmall {
                size_m: (width_m, height_m),
                body_m,
            } => {
                write!(
                    f,
                    "a field of {width_m} m by {height_m} m has no room for a body of {body_m} m"
                )
            }
            Self::TooManyBodies { count, max } => {
                write!(f, "{count} bodies; at most {max} are supported")
            }
            Self::ObstacleOffField { index, at } => off_field(f, "obstacle", index, at),
            Self::RobotOffField { index, at } => off_field(f, "robot", index, at),
            Self::RobotOnObstacle {
                index,
                at,
                obstacle,
            } => {
                write!(f, "robot {index} at {at} m overlaps obstacle {obstacle}")
            }
            Self::RobotOnRobot { index, at, other } => {
                write!(f, "robot {index} at {at} m overlaps robot {other}")
            }
            Self::NoRoom { count, room } => {
                write!(
                    f,
                    "{count} guests do not fit: in rows, beside obstacles and robots, there is room for {room}"
                )
            }
        }
    }
}

fn off_field(f: &mut fmt::Formatter<'_>, kind: &str, index: usize, at: Point) -> fmt::Result {
    write!(
        f,
        "{kind} {index} at {at} m does not lie wholly inside the field"
    )
}

impl std::error::Error for HallError {}
