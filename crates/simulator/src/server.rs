//! The simulator as a process: a loop that translates between the bus, the lock-step ([`lockstep::Barrier`]) and the
//! [`Simulation`](crate::Simulation).
//!
//! One loop, one queue. Everything that can happen is an [`Event`]; the loop sleeps until one arrives or something is
//! due. Control is answered by the same loop, also while the clock is held, because the loop never waits for a robot.

mod control;
mod faults;
mod join;
mod observers;
mod orders;
mod pace;
mod process;
mod timers;

pub use process::{Event, Interrupt, Options, REPEAT_AFTER, Server, ServerError};
