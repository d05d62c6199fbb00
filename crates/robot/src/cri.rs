//! The common robot interface: the seed's Figure 7 as a trait.

use protocol::RobotName;
use protocol::messages::{Panel, Point, StateVariables};

use crate::cars::Cars;

/// Parameters that a robot cannot work with.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("parameters of {robot}: {reason}")]
pub struct BadParameters {
    /// Whose.
    pub robot: RobotName,
    /// What is wrong with them.
    pub reason: String,
}

/// Why a robot cannot take part any more.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RobotError {
    /// It refuses its parameters.
    #[error(transparent)]
    Parameters(#[from] BadParameters),
    /// It gave up in the middle of a tick ([`Cars::give_up`]).
    #[error("{robot} gives up: {reason}")]
    GaveUp {
        /// Which robot.
        robot: RobotName,
        /// Why, for people.
        reason: String,
    },
    /// What it says of itself is beyond the limits of a message.
    #[error("{robot} says too much: {field}: {reason}")]
    TooMuch {
        /// Which robot.
        robot: RobotName,
        /// Where in its report.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// A robot, as the simulation and the other robots see it (`CARSRobotInterface`; `getName` is [`Cars::name`], since
/// the roster names a robot).
///
/// In each tick the methods are called in the order of the seed's Figure 5: where it stands now, the commands that
/// arrived, its variables, its emotion, its behavior, where it wants to be next. What it returns from the getters
/// after that is what the others learn during the next tick.
pub trait Robot {
    /// Back to the initial state, before tick 0 and after every `init` (`initRobot`).
    ///
    /// # Errors
    /// [`BadParameters`] if the scenario's parameters make no sense to it.
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters>;

    /// Magnitude of the current velocity, m/s (`getSpeed`).
    fn speed(&self) -> f64;

    /// Direction of motion, radians counter-clockwise from +x (`getDirection`).
    fn direction(&self) -> f64;

    /// Updates the variables that measure its progress (`updateStateVariables`).
    fn update_state_variables(&mut self, cars: &mut Cars<'_>);

    /// The variables that others may learn (`getStateVariables`).
    fn state_variables(&self) -> StateVariables;

    /// Where it stands, meters (`getCurrentLocation`).
    fn current_location(&self) -> Point;

    /// Where it wants to stand at the next tick, meters (`projectLocation`). It stays where it is if the way is not
    /// free; what to do about that is its own affair ([`Cars::was_blocked`] tells).
    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point;

    /// Where it really stands now, meters (`setCurrentLocation`).
    fn set_current_location(&mut self, cars: &mut Cars<'_>, location: Point);

    /// A command arrived (`setCommand`), in the order of senders and of their numbers.
    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str);

    /// The emotion state generator: progress in, emotion out (`updateEmotionState`).
    fn update_emotion_state(&mut self, cars: &mut Cars<'_>);

    /// Its emotion (`getEmotionState`).
    fn emotion_state(&self) -> &str;

    /// The behavior state generator: progress and emotion in, behavior out (`updateBehaviorState`).
    fn update_behavior_state(&mut self, cars: &mut Cars<'_>);

    /// Its behavior (`getBehaviorState`).
    fn behavior_state(&self) -> &str;

    /// What it chooses to display (the seed's `paintComponent`).
    fn panel(&self) -> Panel {
        Panel::default()
    }

    /// Its previous incarnation was lost in this epoch and had reported these variables last. Called after
    /// [`Robot::init_robot`]; a robot that does not care starts afresh.
    fn resume(&mut self, _cars: &mut Cars<'_>, _last: &StateVariables) {}
}
