//! The robot of the test vectors. Section "Test vectors" of `docs/protocol.md` says in words what it does, so that an
//! author in any language can write it and compare every byte.

use protocol::messages::{MAX_TEXT_BYTES, Point, StateVariables, Variable};
use protocol::plain::cut;
use protocol::random::unit;
use robot::{Action, BadParameters, CallError, Cars, ReceivedCommand, Robot};

/// Every so many ticks it looks around and asks the others.
const ASKS_EVERY: u64 = 4;
/// Half of the longest way that it goes in a tick, meters.
const REACH_M: f64 = 0.2;

/// Answers every command with an echo, and wanders along x by chance.
#[derive(Default)]
pub(super) struct Echo {
    heard: u32,
    last: String,
    /// What it perceived and learned from queries.
    seen: StateVariables,
}

impl Robot for Echo {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if cars.was_blocked() {
            cars.log("blocked");
        }
        for command in cars.commands() {
            self.answer(command, cars);
        }
        if cars.tick() > 0 && cars.tick().is_multiple_of(ASKS_EVERY) {
            self.look(cars);
        }

        let here = cars.location();
        let draw = unit(cars.random());
        let step_m = (draw - 0.5) * REACH_M * 2.0;
        let action = Action {
            proposal: Point::new(here.x + step_m, here.y),
            speed_mps: step_m.abs() / cars.tick_s(),
            direction_rad: if step_m < 0.0 {
                std::f64::consts::PI
            } else {
                0.0
            },
            state_variables: self.seen.clone(),
            ..Action::default()
        };
        action
            .emotion("CALM")
            .behavior(if self.heard == 0 { "LISTEN" } else { "ECHO" })
            .variable("heard", self.heard)
            .variable("last", self.last.as_str())
            .variable("draw", draw)
    }

    fn senses_bodies(&self) -> bool {
        true
    }

    fn resume(&mut self, _: &mut Cars<'_>, last: &StateVariables) {
        self.heard = last
            .get("heard")
            .and_then(Variable::as_f64)
            .unwrap_or_default() as u32;
    }
}

impl Echo {
    fn answer(&mut self, command: &ReceivedCommand, cars: &mut Cars<'_>) {
        self.heard += 1;
        self.last.clone_from(&command.text);

        // The operator is not in the roster and cannot receive an echo.
        let mut echo = format!("echo {}", command.text);
        cut(&mut echo, MAX_TEXT_BYTES);
        let answered = cars.set_robot_command(command.from.as_str(), echo);
        if let Err(CallError::UnknownRobot(name)) = answered {
            cars.log(format!("no echo for {name}"));
        }
    }

    fn look(&mut self, cars: &mut Cars<'_>) {
        let near = cars.bodies().len() as f64;
        self.seen.insert("near", near.into());

        for other in &cars.welcome().roster {
            if other == cars.name() {
                continue;
            }
            let behavior = match cars.get_robot_state(other.as_str()) {
                Ok(state) => state.behavior_state.clone(),
                Err(_) => "unreachable".to_owned(),
            };
            self.seen.insert(format!("saw_{other}"), behavior.into());
        }
    }
}
