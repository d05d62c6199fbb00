//! A copy of Leguin with a defect that hunts must find.

use robot::{Action, BadParameters, Cars, Panel, Robot, StateVariables};
use robots::Leguin;

/// Leguin, who stands still for ever after she has received a command twice in a tick for the second time.
#[derive(Default)]
struct Planted {
    leguin: Leguin,
    /// Number of ticks in which a command came twice.
    doubled: u32,
    last: Action,
}

/// Robots as those that ship with the project, but for Leguin, who has the defect.
#[must_use]
pub fn make(class: &str) -> Option<Box<dyn Robot>> {
    match class {
        "Leguin" => Some(Box::new(Planted::default())),
        other => robots::make(other),
    }
}

impl Robot for Planted {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.leguin.init(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let mut pairs = cars.commands().windows(2);
        if pairs.any(|pair| pair[0] == pair[1]) {
            self.doubled += 1;
        }
        if self.doubled >= 2 {
            return Action {
                proposal: cars.location(),
                speed_mps: 0.0,
                ..self.last.clone()
            };
        }

        self.last = self.leguin.tick(cars);
        self.last.clone()
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.leguin.resume(cars, last);
    }

    fn senses_bodies(&self) -> bool {
        self.leguin.senses_bodies()
    }

    fn panel(&self) -> Panel {
        self.leguin.panel()
    }
}
