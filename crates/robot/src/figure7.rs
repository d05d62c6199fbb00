//! The interface of the paper's Figure 7, as an adapter over [`Robot`].

use protocol::RobotName;
use protocol::messages::{Panel, Point, StateVariables};

use crate::cars::Cars;
use crate::cri::{Action, Robot};
use crate::error::BadParameters;

/// The paper's `CARSRobotInterface` (Figure 7) under Rust's names. `getName` is [`Cars::name`], because the scenario
/// names the robots. [`Paper`] makes a [`Robot`] of it.
pub trait CarsRobotInterface: Send {
    /// `initRobot`: returns to the initial state. See [`Robot::init`].
    ///
    /// # Errors
    /// [`BadParameters`] if the robot cannot work with the parameters of the scenario.
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters>;

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

    /// `getEmotionState`: name of the emotion.
    fn emotion_state(&self) -> &str;

    /// `getBehaviorState`: name of the behavior.
    fn behavior_state(&self) -> &str;

    /// `paintComponent`: what the console shows of the robot. By default nothing.
    fn panel(&self) -> Panel {
        Panel::default()
    }

    /// Not in the paper: see [`Robot::resume`].
    fn resume(&mut self, _cars: &mut Cars<'_>, _last: &StateVariables) {}
}

/// A [`Robot`] made of the paper's interface. It calls the methods in the order of the paper's Figure 5; at tick 0,
/// where there is nothing to update yet, only those that do not update.
#[derive(Debug, Clone, Copy, Default)]
pub struct Paper<R>(pub R);

impl<R: CarsRobotInterface> Robot for Paper<R> {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.0.init_robot(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let location = cars.location();
        self.0.set_current_location(cars, location);
        for command in cars.commands() {
            self.0.set_command(cars, &command.from, &command.text);
        }

        if cars.tick() > 0 {
            self.0.update_state_variables(cars);
            self.0.update_emotion_state(cars);
            self.0.update_behavior_state(cars);
        }

        Action {
            proposal: self.0.project_location(cars),
            speed_mps: self.0.speed(),
            direction_rad: self.0.direction(),
            emotion_state: self.0.emotion_state().to_owned(),
            behavior_state: self.0.behavior_state().to_owned(),
            state_variables: self.0.state_variables(),
        }
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.0.resume(cars, last);
    }

    fn panel(&self) -> Panel {
        self.0.panel()
    }
}
