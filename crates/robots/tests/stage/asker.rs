//! A robot that does nothing but ask.

use std::cell::RefCell;
use std::rc::Rc;

use robot::{BadParameters, Cars, Point, PublicState, Robot, RobotName, StateVariables};

use super::{Role, Stage, feet};

struct Asker {
    of: String,
    heard: Rc<RefCell<Option<PublicState>>>,
}

/// What `of` answers, beside Butler on the usual stage.
pub(crate) fn answers(seed: u64, of: &str) -> PublicState {
    let heard = Rc::new(RefCell::new(None));
    let asker = Asker {
        of: of.to_owned(),
        heard: heard.clone(),
    };
    let mut stage = Stage::new(
        seed,
        vec![
            Role {
                robot: Box::new(asker),
                ..Role::new("Butler", "Butler", feet(25.0, 25.0), "")
            },
            Role::new("Leguin", "Leguin", feet(4.0, 4.0), ""),
        ],
    );
    stage.begin();
    stage.step();
    heard.borrow_mut().take().unwrap()
}

impl Robot for Asker {
    fn init_robot(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }
    fn speed(&self) -> f64 {
        0.0
    }
    fn direction(&self) -> f64 {
        0.0
    }
    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        *self.heard.borrow_mut() = cars
            .get_robot_state(&self.of)
            .ok()
            .map(|state| (*state).clone());
    }
    fn state_variables(&self) -> StateVariables {
        StateVariables::new()
    }
    fn current_location(&self) -> Point {
        feet(25.0, 25.0)
    }
    fn project_location(&mut self, _: &mut Cars<'_>) -> Point {
        feet(25.0, 25.0)
    }
    fn set_current_location(&mut self, _: &mut Cars<'_>, _: Point) {}
    fn set_command(&mut self, _: &mut Cars<'_>, _: &RobotName, _: &str) {}
    fn update_emotion_state(&mut self, _: &mut Cars<'_>) {}
    fn emotion_state(&self) -> &str {
        "CURIOUS"
    }
    fn update_behavior_state(&mut self, _: &mut Cars<'_>) {}
    fn behavior_state(&self) -> &str {
        "ASK"
    }
}
