//! @NAME@ strolls to and fro. Being held up frustrates it, and frustrated it turns around.
//!
//! In every tick the methods of `Robot` are called in this order: `set_current_location`,
//! `set_command` for each command, `update_state_variables`, `update_emotion_state`,
//! `update_behavior_state`, `project_location`; then the others learn what the getters return.

use robot::{BadParameters, Cars, Panel, Point, Robot, RobotName, StateVariables, Widget};

/// `[robot.params]` of the scenario, in SI units. An unknown name is an error.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    walk_m: f64,
    speed_mps: f64,
    patience_s: f64,
}

/// All that it remembers: `init_robot` sets every field.
#[derive(Default)]
struct Stroller {
    parameters: Parameters,
    at: Point,
    /// The ends of its stroll, meters from the left edge; it is on its way to the second.
    ends_x: [f64; 2],
    /// Its measure of progress: for how long it has been held up, seconds.
    held_up_s: f64,
    turns: u32,
    was_frustrated: bool,
    is_frustrated: bool,
    is_resting: bool,
}

impl Stroller {
    fn turn(&mut self) {
        self.ends_x.swap(0, 1);
        self.turns += 1;
    }
}

impl Robot for Stroller {
    // Before tick 0, and whenever the run begins anew: start from nothing.
    fn init_robot(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let (parameters, at): (Parameters, _) = (cars.parameters()?, cars.welcome().location);
        *self = Self {
            ends_x: [at.x, at.x + parameters.walk_m],
            parameters,
            at,
            ..Self::default()
        };
        Ok(())
    }

    // Where it really stands: if somebody was in the way, that is where it was.
    fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) {
        self.at = location;
    }

    fn set_command(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) {
        match command {
            "rest" => self.is_resting = true,
            "stroll" => self.is_resting = false,
            _ => return cars.log(format!("does not know how to {command}")),
        }
        cars.log(format!("obeys {from}: {command}"));
    }

    // What it measures itself by. To look around: `cars.percept()`; to ask others:
    // `cars.get_robot_state("Butler")`.
    fn update_state_variables(&mut self, cars: &mut Cars<'_>) {
        if cars.was_blocked() {
            self.held_up_s += cars.tick_s();
        } else {
            self.held_up_s = (self.held_up_s - cars.tick_s() / 2.0).max(0.0);
        }
    }

    // The emotion state generator: progress in, emotion out.
    fn update_emotion_state(&mut self, _: &mut Cars<'_>) {
        self.was_frustrated = self.is_frustrated;
        self.is_frustrated = if self.was_frustrated {
            self.held_up_s > 0.0
        } else {
            self.held_up_s >= self.parameters.patience_s
        };
    }

    // The behavior state generator: emotion in, behavior out.
    fn update_behavior_state(&mut self, _: &mut Cars<'_>) {
        if self.is_frustrated && !self.was_frustrated {
            self.turn();
        }
        if self.at.x == self.ends_x[1] {
            self.turn();
        }
    }

    // Where it wants to stand at the next tick.
    fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
        let (step, left) = (self.speed() * cars.tick_s(), self.ends_x[1] - self.at.x);
        let x = if left.abs() <= step {
            self.ends_x[1]
        } else {
            self.at.x + step.copysign(left)
        };
        Point::new(if self.is_resting { self.at.x } else { x }, self.at.y)
    }

    fn current_location(&self) -> Point {
        self.at
    }

    fn speed(&self) -> f64 {
        if self.is_resting {
            0.0
        } else {
            self.parameters.speed_mps
        }
    }

    fn direction(&self) -> f64 {
        if self.ends_x[1] < self.at.x {
            std::f64::consts::PI
        } else {
            0.0
        }
    }

    fn state_variables(&self) -> StateVariables {
        [
            ("held_up_s".into(), self.held_up_s.into()),
            ("turns".into(), self.turns.into()),
        ]
        .into()
    }

    fn emotion_state(&self) -> &str {
        if self.is_frustrated {
            "FRUSTRATED"
        } else {
            "HAPPY"
        }
    }

    fn behavior_state(&self) -> &str {
        if self.is_resting { "REST" } else { "STROLL" }
    }

    // What people see of it, and two buttons that send it commands.
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

fn main() -> std::process::ExitCode {
    robot::main("@NAME@", |_| Box::new(Stroller::default()))
}
