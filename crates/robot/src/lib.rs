//! SDK for robots: the common robot interface and the loop that runs robots in lock-step.
//!
//! A robot is one type that implements [`Robot`], and one line that hands it to [`main`]:
//!
//! ```no_run
//! use robot::{Action, BadParameters, Cars, Point, Robot};
//!
//! /// Walks to the right and counts its steps.
//! #[derive(Default)]
//! struct Walker { steps: u32 }
//!
//! impl Robot for Walker {
//!     fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
//!         *self = Self::default();
//!         Ok(())
//!     }
//!
//!     fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
//!         self.steps += 1;
//!         let [width_m, _] = cars.welcome().field_m;
//!         let wall = Point::new(width_m, cars.location().y);
//!         Action::go(cars, wall, 0.5)
//!             .emotion("CALM")
//!             .behavior("WALK")
//!             .variable("steps", self.steps)
//!     }
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     robot::main("Walker", |_| Box::new(Walker::default()))
//! }
//! ```
//!
//! A robot with emotions has the interface of the paper's Figure 7, [`CarsRobotInterface`], with a generator each for emotion
//! and behavior; its `tick` is [`control_cycle`].
//!
//! A robot perceives the world only through [`Cars`]: this crate does not depend on the environment.

mod cars;
mod cri;
mod entry;
mod error;
mod figure7;
mod host;
mod local;
mod network;
mod runner;

pub use cars::{CallError, Cars, ReceivedCommand};
pub use cri::{Action, Robot};
pub use entry::{RobotArgs, main};
pub use error::{BadParameters, ParametersCheck, RobotError, read_parameters};
pub use figure7::{CarsRobotInterface, control_cycle};
pub use host::{Host, HostError, HostOptions, Stopper};
pub use local::{LocalHost, OpenTick};
pub use network::{PeerNetwork, Undelivered};
pub use protocol::messages::{
    Clock, Command, CommandText, Correction, DriveLimits, End, Face, KnownSite, LayerAction,
    LayerRefusal, LayerResult, Panel, Parameters, Payload, Point, Pose, PublicState, Rays, Report,
    SensedBody, SensedCell, SensedKind, SensedLayer, SensedRobot, SensedRow, SensedSite,
    SiteAction, SiteRefusal, SiteResult, StateVariables, TickUpdate, Tone, Variable, Velocity,
    Welcome, Widget,
};
pub use protocol::random::Stream;
pub use protocol::{RobotName, RobotPattern, RunName, Tick, published_angle};
pub use runner::{Runner, TickResult};
