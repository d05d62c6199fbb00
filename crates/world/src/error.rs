//! Errors in the description of a hall.
//!
//! They carry indices and positions, so that a caller that knows the bodies' names can report them.

use crate::limits::{BODY_MIN_M, SIDE_MAX_M};
use crate::point::Point;
use std::fmt;

/// Three numbers that do not describe a triangular distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangularError {
    /// The minimum that was given.
    pub min: f64,
    /// The mode that was given.
    pub mode: f64,
    /// The maximum that was given.
    pub max: f64,
}

impl fmt::Display for TriangularError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { min, mode, max } = self;

        write!(
            f,
            "must be finite with 0 <= min <= mode <= max; got min {min}, mode {mode}, max {max}"
        )
    }
}

impl std::error::Error for TriangularError {}

/// Why a [`World`](crate::World) cannot be built from a [`Hall`](crate::Hall).
///
/// Indices count from 0 in the hall's lists, and numbers in messages from 1. Positions are centers in meters, as given in the hall.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum HallError {
    /// A length, time or speed is NaN or outside its valid range.
    OutOfRange {
        /// The field of the hall that holds the quantity, with its unit.
        name: &'static str,
        /// The value that was given.
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
    /// More bodies than a world supports.
    TooManyBodies {
        /// Number of obstacles, robots and guests together.
        count: usize,
        /// The limit, [`BODIES_MAX`](crate::BODIES_MAX).
        max: usize,
    },
    /// More of something than a world supports.
    TooMany {
        /// What, in words.
        name: &'static str,
        /// How many there are.
        count: usize,
        /// The limit, [`WALLS_MAX`](crate::WALLS_MAX).
        max: usize,
    },
    /// An end of a wall is not on the field.
    WallOffField {
        /// Index of the wall.
        index: usize,
        /// The end.
        at: Point,
    },
    /// A wall is shorter than [`BODY_MIN_M`](crate::BODY_MIN_M).
    WallTooShort {
        /// Index of the wall.
        index: usize,
        /// One of its ends.
        at: Point,
    },
    /// An obstacle is smaller than [`BODY_MIN_M`](crate::BODY_MIN_M) or larger than [`SIDE_MAX_M`](crate::SIDE_MAX_M).
    ObstacleSize {
        /// Index of the obstacle.
        index: usize,
        /// Its extent, m.
        value_m: f64,
    },
    /// A robot is smaller than [`BODY_MIN_M`](crate::BODY_MIN_M) or larger than [`SIDE_MAX_M`](crate::SIDE_MAX_M).
    RobotSize {
        /// Index of the robot.
        index: usize,
        /// Its extent, m.
        value_m: f64,
    },
    /// A limit of a robot with wheels is not more than zero, or its heading is not finite.
    RobotWheels {
        /// Index of the robot.
        index: usize,
    },
    /// A fixed obstacle is not entirely inside the field.
    ObstacleOffField {
        /// Index of the obstacle.
        index: usize,
        /// Its center.
        at: Point,
    },
    /// A robot is not entirely inside the field.
    RobotOffField {
        /// Index of the robot.
        index: usize,
        /// Its center.
        at: Point,
    },
    /// A robot overlaps a fixed obstacle.
    RobotOnObstacle {
        /// Index of the robot.
        index: usize,
        /// Its center.
        at: Point,
        /// Index of the obstacle; the first one if there are several.
        obstacle: usize,
    },
    /// A robot stands on a wall.
    RobotOnWall {
        /// Index of the robot.
        index: usize,
        /// Its center.
        at: Point,
        /// Index of the wall; the first one if there are several.
        wall: usize,
    },
    /// A robot overlaps another one that precedes it in the list.
    RobotOnRobot {
        /// Index of the robot.
        index: usize,
        /// Its center.
        at: Point,
        /// Index of the robot it overlaps; the first one if there are several.
        other: usize,
    },
    /// Guests cannot walk by a model.
    NoCrowd {
        /// Why, in words.
        reason: &'static str,
    },
    /// The guests do not fit beside the obstacles and the robots.
    NoRoom {
        /// Number of guests requested.
        count: usize,
        /// Number of guests that fit when arranged in rows.
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
                    "{name} is {value:?}; must be a number from {min:?} to {max:?}"
                )
            }
            Self::FieldTooSmall {
                size_m: (width_m, height_m),
                body_m,
            } => {
                write!(
                    f,
                    "a field of {width_m} m by {height_m} m is too small for a body of {body_m} m"
                )
            }
            Self::TooManyBodies { count, max } => {
                write!(
                    f,
                    "{count} bodies are too many; at most {max} are supported"
                )
            }
            Self::TooMany { name, count, max } => {
                write!(
                    f,
                    "{count} {name} are too many; at most {max} are supported"
                )
            }
            Self::WallOffField { index, at } => {
                write!(
                    f,
                    "wall {} has an end at {at} m, which is not on the field",
                    index + 1
                )
            }
            Self::WallTooShort { index, at } => {
                let number = index + 1;
                write!(f, "wall {number} at {at} m is shorter than {BODY_MIN_M} m")
            }
            Self::ObstacleSize { index, value_m } => size(f, "obstacle", index, value_m),
            Self::RobotSize { index, value_m } => size(f, "robot", index, value_m),
            Self::RobotWheels { index } => {
                write!(
                    f,
                    "the limits of the wheels of robot {} must be more than zero, and its heading finite",
                    index + 1
                )
            }
            Self::RobotOnWall { index, at, wall } => {
                let (robot, wall) = (index + 1, wall + 1);
                write!(f, "robot {robot} at {at} m stands on wall {wall}")
            }
            Self::ObstacleOffField { index, at } => off_field(f, "obstacle", index, at),
            Self::RobotOffField { index, at } => off_field(f, "robot", index, at),
            Self::RobotOnObstacle {
                index,
                at,
                obstacle,
            } => {
                let (robot, obstacle) = (index + 1, obstacle + 1);
                write!(f, "robot {robot} at {at} m overlaps obstacle {obstacle}")
            }
            Self::RobotOnRobot { index, at, other } => {
                let (robot, other) = (index + 1, other + 1);
                write!(f, "robot {robot} at {at} m overlaps robot {other}")
            }
            Self::NoCrowd { reason } => write!(f, "guests cannot walk by this model: {reason}"),
            Self::NoRoom { count, room } => {
                write!(
                    f,
                    "{count} guests do not fit: obstacles and robots leave room for {room}"
                )
            }
        }
    }
}

fn size(f: &mut fmt::Formatter<'_>, kind: &str, index: usize, value_m: f64) -> fmt::Result {
    write!(
        f,
        "{kind} {} is {value_m:?} m wide or high; must be a number from {BODY_MIN_M:?} to {SIDE_MAX_M:?}",
        index + 1
    )
}

fn off_field(f: &mut fmt::Formatter<'_>, kind: &str, index: usize, at: Point) -> fmt::Result {
    write!(
        f,
        "{kind} {} at {at} m is not entirely inside the field",
        index + 1
    )
}

impl std::error::Error for HallError {}
