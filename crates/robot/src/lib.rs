//! SDK for robots: the common robot interface and the loop that runs robots in lock-step.
//!
//! A robot is one type that implements [`Robot`], whose methods are those of the seed's `CARSRobotInterface`
//! (Figure 7), and one line that hands it to [`main`]:
//!
//! ```no_run
//! use robot::{Cars, Point, Robot, StateVariables};
//!
//! /// Walks to the right and counts its steps.
//! #[derive(Default)]
//! struct Walker { at: Point, steps: u32 }
//!
//! impl Robot for Walker {
//!     fn init_robot(&mut self, _: &mut Cars<'_>) -> Result<(), robot::BadParameters> {
//!         *self = Self::default();
//!         Ok(())
//!     }
//!     fn speed(&self) -> f64 { 0.5 }
//!     fn direction(&self) -> f64 { 0.0 }
//!     fn update_state_variables(&mut self, _: &mut Cars<'_>) { self.steps += 1; }
//!     fn state_variables(&self) -> StateVariables { [("steps".into(), self.steps.into())].into() }
//!     fn current_location(&self) -> Point { self.at }
//!     fn project_location(&mut self, cars: &mut Cars<'_>) -> Point {
//!         Point::new(self.at.x + 0.5 * cars.tick_s(), self.at.y)
//!     }
//!     fn set_current_location(&mut self, _: &mut Cars<'_>, location: Point) { self.at = location; }
//!     fn set_command(&mut self, _: &mut Cars<'_>, _: &robot::RobotName, _: &str) {}
//!     fn update_emotion_state(&mut self, _: &mut Cars<'_>) {}
//!     fn emotion_state(&self) -> &str { "CALM" }
//!     fn update_behavior_state(&mut self, _: &mut Cars<'_>) {}
//!     fn behavior_state(&self) -> &str { "WALK" }
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     robot::main("Walker", |_| Box::new(Walker::default()))
//! }
//! ```
//!
//! Robots see nothing of the world but what this crate gives them: it has no dependency on the environment.

mod board;
mod cars;
mod cri;
mod entry;
mod held;
mod host;
mod link;
mod local;
mod seat;

pub use cars::{CallError, Cars};
pub use cri::{BadParameters, Robot, RobotError};
pub use entry::{RobotArgs, main};
pub use host::{Host, HostError, HostOptions, Stopper};
pub use local::{LocalHost, Sense};
pub use protocol::messages::{
    Clock, Command, CommandId, Correction, End, Face, News, Panel, Parameters, Percept, Point,
    PublicState, Report, SensedBody, SensedKind, SensedRobot, StateVariables, Tone, Variable,
    Welcome, Widget,
};
pub use protocol::random::Stream;
pub use protocol::{RobotName, RunName, Tick};
pub use seat::{Network, Seat, Undelivered};

/// Rounds an angle to 1e-6 rad, so that languages whose arc tangents differ in the last bit publish the same number.
#[must_use]
pub fn published_angle(angle_rad: f64) -> f64 {
    let rounded = (angle_rad * 1e6 + 0.5).floor() / 1e6;
    // Minus zero is another text than zero.
    if rounded == 0.0 { 0.0 } else { rounded }
}
