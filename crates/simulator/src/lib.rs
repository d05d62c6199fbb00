//! The simulator: one tick of a [`Scenario`] ([`Simulation::step`]), the lock-step over the bus ([`server`]), and the record:
//! written ([`recorder`]), read ([`record`]), and compared ([`difference`]).
//!
//! [`Scenario`]: scenario::Scenario
//!
//! It owns the environment and the clock. It does not know the robots' emotions: there is no dependency on `affect`.

pub mod difference;
pub mod digest;
mod files;
pub mod folder;
pub mod medium;
pub mod program;
pub mod record;
pub mod recorder;
pub mod seal;
pub mod server;
pub mod simulation;
pub mod summary;

pub use files::EpochFiles;
pub use folder::{IfTaken, NewRun, Reserved, RunFolder, RunLock};
pub use protocol::{Event, Line};
pub use recorder::Recorder;
pub use simulation::{Reports, Simulation, TickRecord};
pub use summary::Summary;
