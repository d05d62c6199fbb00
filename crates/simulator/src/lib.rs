//! The simulator: one tick of a [`Scenario`] ([`Simulation::step`]), the lock-step over the bus ([`server`]), and the writing of
//! the record ([`recorder`]).
//!
//! [`Scenario`]: scenario::Scenario
//!
//! It owns the environment and the clock. It does not know the robots' emotions: there is no dependency on `affect`.

pub mod digest;
mod driving;
mod guests;
pub mod layers;
pub mod medium;
pub mod recorder;
mod sensing;
pub mod server;
pub mod simulation;
pub mod sites;
mod static_world;
mod summarized;

pub use driving::drive_limits;
pub use protocol::{Event, Line};
pub use recorder::Recorder;
pub use simulation::{Reports, Simulation, TickRecord};
