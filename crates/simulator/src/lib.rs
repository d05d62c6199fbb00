//! The simulator: the scenario of a run ([`scenario`]), one tick ([`Simulation::step`]), the lock-step over the bus
//! ([`server`]), and the record: written ([`recorder`]), read ([`record`]), and compared ([`difference`]).
//!
//! It owns the environment and the clock. It does not know the robots' emotions: there is no dependency on `affect`.

pub mod difference;
pub mod digest;
mod files;
pub mod medium;
pub mod program;
pub mod record;
pub mod recorder;
pub mod roster;
pub mod scenario;
pub mod seal;
pub mod server;
pub mod simulation;
pub mod summary;

/// Source texts and their errors, which [`Scenario::parse`] takes and returns.
pub use config::diagnostic;
pub use files::EpochFiles;
pub use protocol::{Event, Line};
pub use recorder::{Recorder, RunFolder};
pub use scenario::{OnLate, Scenario};
pub use simulation::{Reports, Simulation, TickRecord};
pub use summary::Summary;
