//! Checks that all bodies of a scenario can be placed. The environment numbers its robots; the errors here name them.

use protocol::RobotName;
use world::{HallError, World};

use super::checked::Scenario;

/// A body of a scenario cannot be placed.
#[derive(Debug, Clone)]
pub(super) struct PlacingError {
    error: HallError,
    /// The robot that cannot be placed.
    robot: Option<RobotName>,
    /// The robot that it overlaps.
    other: Option<RobotName>,
}

/// The part of a scenario that keeps its bodies from being placed.
#[derive(Debug, Clone, Copy)]
pub(super) enum PlacingCause<'a> {
    Tick,
    Field,
    Guests,
    Obstacle(usize),
    Robot(&'a RobotName),
}

/// Places all bodies once.
pub(super) fn check(scenario: &Scenario) -> Result<(), PlacingError> {
    let stream = protocol::random::stream(scenario.seed, "guests");
    match World::new(&scenario.hall(), stream) {
        Ok(_) => Ok(()),
        Err(error) => Err(PlacingError::of(scenario, error)),
    }
}

impl PlacingError {
    fn of(scenario: &Scenario, error: HallError) -> Self {
        let name = |index: usize| scenario.robots.keys().nth(index).cloned();

        let mut robot = None;
        let mut other = None;
        match error {
            HallError::RobotOffField { index, .. } | HallError::RobotOnObstacle { index, .. } => {
                robot = name(index);
            }
            HallError::RobotOnRobot {
                index,
                other: other_index,
                ..
            } => {
                robot = name(index);
                other = name(other_index);
            }
            _ => {}
        }

        Self {
            error,
            robot,
            other,
        }
    }

    /// The part of the scenario that has to change.
    pub(super) fn cause(&self) -> PlacingCause<'_> {
        if let Some(robot) = &self.robot {
            return PlacingCause::Robot(robot);
        }

        match self.error {
            HallError::ObstacleOffField { index, .. } => PlacingCause::Obstacle(index),
            HallError::NoRoom { .. } | HallError::TooManyBodies { .. } => PlacingCause::Guests,
            HallError::OutOfRange { name: "tick_s", .. } => PlacingCause::Tick,
            _ => PlacingCause::Field,
        }
    }

    /// The field of a set-up with the error.
    pub(super) fn field(&self) -> String {
        match self.cause() {
            PlacingCause::Robot(robot) => format!("robots.{robot}"),
            PlacingCause::Obstacle(_) => "obstacles".to_owned(),
            PlacingCause::Guests => "guests".to_owned(),
            PlacingCause::Tick | PlacingCause::Field => "field_m".to_owned(),
        }
    }
}

impl std::fmt::Display for PlacingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Some(robot) = &self.robot else {
            return self.error.fmt(f);
        };

        match (&self.error, &self.other) {
            (HallError::RobotOnRobot { at, .. }, Some(other)) => {
                write!(f, "robot {robot} at {at} m overlaps robot {other}")
            }
            (HallError::RobotOnObstacle { at, obstacle, .. }, _) => {
                write!(f, "robot {robot} at {at} m overlaps obstacle {obstacle}")
            }
            (HallError::RobotOffField { at, .. }, _) => {
                write!(
                    f,
                    "robot {robot} at {at} m does not lie wholly inside the field"
                )
            }
            _ => self.error.fmt(f),
        }
    }
}
