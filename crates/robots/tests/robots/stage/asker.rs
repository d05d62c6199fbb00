//! A robot that only queries another one.

use std::sync::{Arc, Mutex};

use robot::{Action, BadParameters, Cars, PublicState, Robot};

use super::{Role, Stage, feet};

struct Asker {
    of: String,
    heard: Arc<Mutex<Option<PublicState>>>,
}

/// What `of` answers, beside Butler on the usual stage.
pub(crate) fn answers(seed: u64, of: &str) -> PublicState {
    let heard = Arc::new(Mutex::new(None));
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
    heard.lock().unwrap().take().unwrap()
}

impl Robot for Asker {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        *self.heard.lock().unwrap() = cars
            .get_robot_state(&self.of)
            .ok()
            .map(|state| (*state).clone());
        Action::stay(cars).emotion("CURIOUS").behavior("ASK")
    }
}
