//! The simulator's process: the lock-step over the bus ([`server`]) around one [`Simulation`], and the writing of the record
//! ([`recorder`]).
//!
//! [`Simulation`]: environment::Simulation
//!
//! It owns the environment and the clock. It does not know the robots' emotions: there is no dependency on `affect`.

pub mod recorder;
pub mod server;

pub use recorder::Recorder;
