//! The simulator's process: the lock-step over the bus ([`server`]) around one [`Simulation`].
//!
//! [`Simulation`]: environment::Simulation
//!
//! It owns the environment and the clock. It does not know the robots' emotions: there is no dependency on `affect`.

pub mod server;
