//! The simulator: what a run is ([`scenario`]), one tick of it ([`Simulation::step`]), who takes part and how the
//! clock is held for them ([`server`]), and what is kept of it ([`recorder`]).
//!
//! It owns the environment and the clock. It neither knows nor cares what a robot feels: there is no dependency on
//! `affect`.

pub mod digest;
mod files;
pub mod medium;
pub mod recorder;
pub mod roster;
pub mod scenario;
pub mod server;
pub mod simulation;
pub mod summary;

/// Files that people write, and errors in them: [`Scenario::parse`] takes the one and returns the other.
pub use config::diagnostic;
pub use protocol::{Event, Line};
pub use recorder::{Recorder, RunFolder};
pub use scenario::{OnLate, Scenario};
pub use simulation::{Reports, Simulation, TickRecord};
pub use summary::Summary;
