//! The paper's interface of a robot (Figure 7), and its control cycle (Figure 5).

use protocol::RobotName;
use protocol::messages::{Point, StateVariables};

use crate::cars::Cars;
use crate::cri::Action;
use crate::error::BadParameters;

/// The paper's `CARSRobotInterface`: the fourteen methods of its Figure 7 under Rust's names, with [`Cars`] in the place of the
/// time. Emotion and behavior have a generator each, the paper's "requirement for the external interface".
///
/// [`control_cycle`] is the [`Robot::tick`](crate::Robot::tick) of such a robot.
pub trait CarsRobotInterface {
    /// `initRobot`: returns to the initial state. See [`Robot::init`](crate::Robot::init).
    ///
    /// # Errors
    /// [`BadParameters`] if the robot cannot work with the parameters of the scenario.
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters>;

    /// `getName`: its name, by which the scenario and the other robots call it: [`Cars::name`].
    fn name(&self) -> &str;

    /// `setCurrentLocation`: where the robot stands now, meters.
    fn set_current_location(&mut self, cars: &mut Cars<'_>, location: Point);

    /// `setCommand`: a command that arrived, called once for each.
    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str);

    /// `updateStateVariables`: updates the variables that measure progress.
    fn update_state_variables(&mut self, cars: &mut Cars<'_>);

    /// `updateEmotionState`: the emotion state generator, from progress to emotion.
    fn update_emotion_state(&mut self, cars: &mut Cars<'_>);

    /// `updateBehaviorState`: the behavior state generator, from progress and emotion to behavior.
    fn update_behavior_state(&mut self, cars: &mut Cars<'_>);

    /// `projectLocation`: where the robot wants to stand at the next tick, meters.
    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point;

    /// `getCurrentLocation`: where the robot stands, meters.
    fn current_location(&self) -> Point;

    /// `getSpeed`: magnitude of the velocity, m/s.
    fn speed(&self) -> f64;

    /// `getDirection`: direction of motion, radians counter-clockwise from the x axis.
    fn direction(&self) -> f64;

    /// `getStateVariables`: the variables that it publishes.
    fn state_variables(&self) -> StateVariables;

    /// `getEmotionState`: name of the emotion; another robot gets it by [`Cars::get_robot_emotion_state`].
    fn emotion_state(&self) -> &str;

    /// `getBehaviorState`: name of the behavior.
    fn behavior_state(&self) -> &str;
}

/// One tick of a robot with the paper's interface, in the order of the paper's Figure 5. At tick 0, where there is nothing to
/// update yet, only the methods that do not update are called.
pub fn control_cycle(robot: &mut impl CarsRobotInterface, cars: &mut Cars<'_>) -> Action {
    let location = cars.location();
    robot.set_current_location(cars, location);
    for command in cars.commands() {
        robot.set_command(cars, &command.from, &command.text);
    }

    if cars.tick() > 0 {
        robot.update_state_variables(cars);
        robot.update_emotion_state(cars);
        robot.update_behavior_state(cars);
    }

    let proposal = robot.project_location(cars);
    if robot.name() != cars.name().as_str() {
        cars.give_up(format!("it calls itself {:?}", robot.name()));
    }
    Action {
        proposal,
        speed_mps: robot.speed(),
        direction_rad: robot.direction(),
        emotion_state: robot.emotion_state().to_owned(),
        behavior_state: robot.behavior_state().to_owned(),
        state_variables: robot.state_variables(),
        ..Action::default()
    }
}
