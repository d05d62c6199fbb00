//! Places robots at random, and checks that all bodies of a scenario can be placed. The environment numbers its robots; the errors
//! here name them.

use protocol::RobotName;
use world::{HallError, RobotPlacer, World};

use super::checked::{Scenario, to_wire, to_world};

/// A body of a scenario cannot be placed.
#[derive(Debug, Clone)]
pub(super) struct PlacingError {
    reason: PlacingReason,
    /// The robot that cannot be placed.
    robot: Option<RobotName>,
    /// The robot that it overlaps.
    other: Option<RobotName>,
}

/// Why a body cannot be placed.
#[derive(Debug, Clone, Copy)]
enum PlacingReason {
    Hall(HallError),
    /// All random places of a robot overlap another body.
    NoFreePlace,
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
        Err(error) => Err(PlacingError::of(error, &scenario.roster())),
    }
}

/// Places the robots whose places are random, each by a stream of its own, after those whose places are given. Of two that hinder
/// each other the one with the longer name gives way, and then the later one in the alphabet: so one more robot in bulk moves none.
pub(super) fn place_at_random(scenario: &mut Scenario) -> Result<(), PlacingError> {
    let mut hall = scenario.hall();
    hall.robots.clear();
    let mut fixed = Vec::new();
    let mut random = Vec::new();
    for (name, robot) in &scenario.robots {
        if robot.is_at_random {
            random.push(name.clone());
        } else {
            fixed.push(name.clone());
            hall.robots.push(to_world(robot.at));
        }
    }
    if random.is_empty() {
        return Ok(());
    }
    random.sort_by_key(|name| (name.as_str().len(), name.clone()));

    let placer = RobotPlacer::new(&hall);
    let mut placer = placer.map_err(|error| PlacingError::of(error, &fixed))?;
    for name in random {
        let mut stream = protocol::random::stream(scenario.seed, &format!("at/{name}"));
        let Some(at) = placer.place(&mut stream) else {
            return Err(PlacingError {
                reason: PlacingReason::NoFreePlace,
                robot: Some(name),
                other: None,
            });
        };
        if let Some(robot) = scenario.robots.get_mut(&name) {
            robot.at = to_wire(at);
        }
    }
    Ok(())
}

impl PlacingError {
    /// An error of a hall with these robots.
    fn of(error: HallError, robots: &[RobotName]) -> Self {
        let name = |index: usize| robots.get(index).cloned();

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
            reason: PlacingReason::Hall(error),
            robot,
            other,
        }
    }

    /// The part of the scenario that has to change.
    pub(super) fn cause(&self) -> PlacingCause<'_> {
        if let Some(robot) = &self.robot {
            return PlacingCause::Robot(robot);
        }

        let PlacingReason::Hall(error) = self.reason else {
            return PlacingCause::Field;
        };
        match error {
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
        match (&self.reason, &self.robot, &self.other) {
            (PlacingReason::Hall(HallError::RobotOnRobot { at, .. }), Some(robot), Some(other)) => {
                write!(f, "robot {robot} at {at} m overlaps robot {other}")
            }
            (
                PlacingReason::Hall(HallError::RobotOnObstacle { at, obstacle, .. }),
                Some(robot),
                _,
            ) => {
                write!(f, "robot {robot} at {at} m overlaps obstacle {obstacle}")
            }
            (PlacingReason::Hall(HallError::RobotOffField { at, .. }), Some(robot), _) => {
                write!(
                    f,
                    "robot {robot} at {at} m does not lie wholly inside the field"
                )
            }
            (PlacingReason::NoFreePlace, Some(robot), _) => {
                write!(
                    f,
                    "there is no free place for robot {robot} in {} draws: the field is too full",
                    RobotPlacer::TRIES
                )
            }
            (PlacingReason::Hall(error), ..) => error.fmt(f),
            (PlacingReason::NoFreePlace, None, _) => f.write_str("the field is too full"),
        }
    }
}
