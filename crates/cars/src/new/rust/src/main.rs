//! @NAME@ strolls back and forth. When it has been blocked for too long, it becomes frustrated and turns around.

use robot::{Action, BadParameters, Cars, Panel, Point, ReceivedCommand, Robot, Widget};

/// `[robot.params]` of the scenario, in SI units. An unknown name is an error.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    walk_m: f64,
    speed_mps: f64,
    patience_s: f64,
}

/// Its state from tick to tick: `init` sets every field.
#[derive(Default)]
struct Stroller {
    parameters: Parameters,
    /// The ends of its stroll; it is on its way to the second.
    ends: [Point; 2],
    /// Its measure of progress: how long it has been blocked, seconds.
    held_up_s: f64,
    turns: u32,
    is_frustrated: bool,
    is_resting: bool,
}

impl Robot for Stroller {
    // Before tick 0, and whenever the run starts again: back to the initial state.
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let parameters: Parameters = cars.parameters()?;
        let start = cars.welcome().location;
        let end = Point::new(start.x + parameters.walk_m, start.y);
        *self = Self {
            parameters,
            ends: [start, end],
            ..Self::default()
        };
        Ok(())
    }

    // One tick: from what it perceives to what it does.
    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        for command in cars.commands() {
            self.obey(command, cars);
        }

        if cars.tick() > 0 {
            self.update_progress(cars);
            let was_frustrated = self.is_frustrated;
            self.update_emotion();
            if self.is_frustrated && !was_frustrated {
                self.turn();
            }
            if cars.location() == self.ends[1] {
                self.turn();
            }
        }

        let speed_mps = if self.is_resting {
            0.0
        } else {
            self.parameters.speed_mps
        };
        Action::go(cars, self.ends[1], speed_mps)
            .emotion(if self.is_frustrated {
                "FRUSTRATED"
            } else {
                "HAPPY"
            })
            .behavior(if self.is_resting { "REST" } else { "STROLL" })
            .variable("held_up_s", self.held_up_s)
            .variable("turns", self.turns)
    }

    // Its panel in the console: two buttons that send it commands.
    fn panel(&self) -> Panel {
        let button = |label: &str, command: &str| Widget::Button {
            label: label.into(),
            command: command.into(),
        };
        Panel {
            widgets: vec![button("Rest", "rest"), button("Stroll", "stroll")],
        }
    }
}

impl Stroller {
    fn obey(&mut self, command: &ReceivedCommand, cars: &mut Cars<'_>) {
        let ReceivedCommand { from, text, .. } = command;
        match text.as_str() {
            "rest" => self.is_resting = true,
            "stroll" => self.is_resting = false,
            _ => return cars.log(format!("does not know how to {text}")),
        }
        cars.log(format!("obeys {from}: {text}"));
    }

    // To look around: `cars.bodies()`, and `senses_bodies`; to query another robot: `cars.get_robot_state("Butler")`.
    fn update_progress(&mut self, cars: &mut Cars<'_>) {
        if cars.was_blocked() {
            self.held_up_s += cars.tick_s();
        } else {
            self.held_up_s = (self.held_up_s - cars.tick_s() / 2.0).max(0.0);
        }
    }

    // The emotion state generator: progress in, emotion out.
    fn update_emotion(&mut self) {
        self.is_frustrated = if self.is_frustrated {
            self.held_up_s > 0.0
        } else {
            self.held_up_s >= self.parameters.patience_s
        };
    }

    fn turn(&mut self) {
        self.ends.swap(0, 1);
        self.turns += 1;
    }
}

fn main() -> std::process::ExitCode {
    robot::main("@NAME@", |_| Box::new(Stroller::default()))
}
