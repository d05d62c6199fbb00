//! The simulator as a process: it translates between the bus, the lock-step ([`lockstep::Barrier`]) and the
//! [`Simulation`](crate::Simulation).
//!
//! One queue. Everything that can happen is an [`Event`], and one thread at a time works on them: the one on which an event
//! arrives, or the server's own. Control is answered in the same way, also while the clock is held, because no work ever
//! waits for a robot.
//!
//! A [`Replay`] is in the simulator's place, too, with a recording instead of a simulation.

mod answer;
mod control;
mod departed;
mod ended;
mod faults;
mod inbox;
mod join;
mod observers;
mod offers;
mod orders;
mod pace;
mod past;
mod player;
mod process;
mod replay;
mod returns;
mod timers;
mod viewers;
mod watchdog;

pub use past::ReplayLog;
pub use process::{Event, Interrupt, Options, REPEAT_AFTER, Server, ServerError, Stay};
pub use replay::{Replay, ReplayError, ReplayOptions};
