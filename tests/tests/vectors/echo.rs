//! The robot of the test vectors. Section "Test vectors" of `docs/protocol.md` says in words what it does, so that an
//! author in any language can write it and compare every byte.

use protocol::RobotName;
use protocol::messages::{Point, StateVariables};
use protocol::random::unit;
use robot::{BadParameters, CallError, Cars, Robot};

/// Every so many ticks it looks around and asks the others.
const ASKS_EVERY: u64 = 4;
/// Half of the longest way that it goes in a tick, meters.
const REACH_M: f64 = 0.2;

/// Answers every command with an echo, and wanders along x by chance.
#[derive(Default)]
pub(super) struct Echo {
    at: Point,
    heard: u32,
    last: String,
    draw: f64,
    variables: StateVariables,
    step_m: f64,
    tick_s: f64,
}

impl Robot for Echo {
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self {
            tick_s: cars.tick_s(),
            ..Self::default()
        };
        Ok(())
    }

    fn set_current_location(&mut self, cars: &mut Cars<'_>, location: Point) {
        self.at = location;
        if cars.was_blocked() {
            cars.log("blocked");
        }
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        self.heard += 1;
        command.clone_into(&mut self.last);
        // The operator is not of the roster: nobody is there to answer.
        let answered = cars.set_robot_command(from.as_str(), format!("echo {command}"));
        if let Err(CallError::UnknownRobot(name)) = answered {
            cars.log(format!("no echo for {name}"));
        }
    }

    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        if !cars.tick().is_multiple_of(ASKS_EVERY) {
            return;
        }
        if let Ok(percept) = cars.percept() {
            self.variables
                .insert("near".into(), (percept.bodies.len() as f64).into());
        }
        let mut others = cars.welcome().roster.clone();
        others.retain(|other| other != cars.name());
        for other in &others {
            let seen = match cars.get_robot_state(other.as_str()) {
                Ok(state) => state.behavior_state.clone(),
                Err(_) => "unreachable".to_owned(),
            };
            self.variables.insert(format!("saw_{other}"), seen.into());
        }
    }

    fn update_emotion_state(&mut self, _: &mut Cars<'_>) {}

    fn update_behavior_state(&mut self, _: &mut Cars<'_>) {}

    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        self.draw = unit(cars.random());
        self.step_m = (self.draw - 0.5) * REACH_M * 2.0;
        Point::new(self.at.x + self.step_m, self.at.y)
    }

    fn current_location(&self) -> Point {
        self.at
    }

    fn speed(&self) -> f64 {
        self.step_m.abs() / self.tick_s
    }

    fn direction(&self) -> f64 {
        if self.step_m < 0.0 {
            std::f64::consts::PI
        } else {
            0.0
        }
    }

    fn state_variables(&self) -> StateVariables {
        let mut variables = self.variables.clone();
        variables.insert("heard".into(), self.heard.into());
        variables.insert("last".into(), self.last.as_str().into());
        variables.insert("draw".into(), self.draw.into());
        variables
    }

    fn emotion_state(&self) -> &'static str {
        "CALM"
    }

    fn behavior_state(&self) -> &'static str {
        if self.heard == 0 { "LISTEN" } else { "ECHO" }
    }

    fn resume(&mut self, _: &mut Cars<'_>, last: &StateVariables) {
        self.heard = last
            .get("heard")
            .and_then(protocol::messages::Variable::as_f64)
            .unwrap_or_default() as u32;
    }
}
