//! A robot that sweeps the dust below it, goes to the most dust that it senses, and leaves a trail: `sdk/python/tests/sweeper.py` in Rust.

use std::process::ExitCode;

use robot::{Action, BadParameters, Cars, LayerAction, LayerRefusal, Robot};

#[derive(Default)]
struct Sweeper {
    swept: f64,
    refused: &'static str,
}

impl Robot for Sweeper {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        for result in cars.layer_results() {
            match result.refused {
                Some(reason) => self.refused = LayerRefusal::name(reason),
                None if result.layer == "dust" => self.swept -= result.change,
                None => {}
            }
        }

        let here = cars.location();
        let mut goal = here;
        let mut most = 0.0;
        for cell in cars
            .layer("dust")
            .into_iter()
            .flat_map(robot::SensedLayer::cells)
        {
            if cell.value > most {
                most = cell.value;
                goal = cell.center;
            }
        }
        let trail = cars.layer("trail").and_then(|trail| trail.value_at(here));
        Action::go(cars, goal, 0.4)
            .variable("refused", self.refused)
            .variable("swept", self.swept)
            .variable("trail", trail.unwrap_or(-1.0))
            .on_layer(LayerAction::add("dust", here, 0.3, -0.1))
            .on_layer(LayerAction::set("trail", here, 0.0, 1.0))
            .on_layer(LayerAction::set("mist", here, 0.0, 1.0))
    }
}

fn main() -> ExitCode {
    robot::main("A", |_| Box::new(Sweeper::default()))
}
