//! The environment of a run: one tick of a [`Scenario`] ([`Simulation::step`]) with its bodies, sites, layers and the simulated
//! network ([`medium`]), and what a recording has of it ([`recorded`]). It knows no bus, no process and no wall clock: the same
//! scenario, seed and reports give the same ticks.
//!
//! [`Scenario`]: scenario::Scenario
//!
//! It does not know the robots' emotions: there is no dependency on `affect`.

pub mod digest;
mod driving;
mod guests;
pub mod layers;
pub mod medium;
pub mod recorded;
mod sensing;
pub mod simulation;
pub mod sites;
mod static_world;
mod summarized;

pub use driving::drive_limits;
pub use protocol::{Event, Line};
pub use simulation::{Reports, Simulation, TickRecord};
pub use static_world::static_world;
