//! A robot that drives in curves, and turns away from what blocks it: `sdk/python/tests/rover.py` in Rust.

use std::process::ExitCode;

use robot::{Action, BadParameters, Cars, Robot};

/// Ticks for which it drives backward after it was blocked.
const BACKWARD_TICKS: u32 = 3;

#[derive(Default)]
struct Rover {
    backward: u32,
}

impl Robot for Rover {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if cars.was_blocked() {
            self.backward = BACKWARD_TICKS;
        }

        let action = if self.backward > 0 {
            self.backward -= 1;
            Action::drive(cars, -0.5, 0.7)
        } else if cars.tick() % 20 < 12 {
            Action::drive(cars, 0.9, 0.4)
        } else {
            Action::drive(cars, 0.6, -1.1)
        };
        let Some(pose) = cars.pose() else {
            return action;
        };
        action
            .variable("heading_rad", pose.heading_rad)
            .variable("linear_mps", pose.velocity.linear_mps)
            .variable("angular_radps", pose.velocity.angular_radps)
    }
}

fn main() -> ExitCode {
    robot::main("A", |_| Box::new(Rover::default()))
}
