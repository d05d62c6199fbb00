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

    /// The field of a set-up with the error.
    pub(super) fn field(&self) -> String {
        if let Some(robot) = &self.robot {
            return format!("robots.{robot}");
        }

        let field = match self.error {
            HallError::ObstacleOffField { .. } => "obstacles",
            HallError::NoRoom { .. } | HallError::TooManyBodies { .. } => "guests",
            HallError::OutOfRange { name, .. } if name.contains("guest") => "guest_speed_mps",
            _ => "field_m",
        };

        field.to_owned()
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
