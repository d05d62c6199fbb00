//! The lock-step as two state machines: [`Barrier`] on the simulator's side, [`Participant`] on a robot's.
//!
//! They do no I/O. Their caller feeds what happens (a decoded message, a liveliness token that was declared or
//! undeclared, a timer that fired) and carries out what they return: messages to put, timers to set, ticks to run. Both are
//! ordinary values that can be cloned, compared and hashed. The simulator's server and the robots' host drive them over the
//! bus, [`Exchange`] is the same in one process, the deterministic simulation drives them over a simulated network, and the
//! model checker explores them. There is no other implementation of the rules.
//!
//! The content of messages is a type parameter: the rules depend on epochs, ticks, generations and counts only.

mod actions;
mod barrier;
mod contract;
mod exchange;
mod member;
#[cfg(test)]
mod model;
mod outputs;
mod participant;
mod repetition;
mod states;
#[cfg(test)]
mod tests;

pub use actions::{Begin, Leave, ParticipantOutput, RobotTimer, TickAnswer, Timeouts, Turn};
pub use barrier::Barrier;
pub use exchange::{Bulletin, Exchange, IncarnationNotice, Membership, Sent, TickOutcome};
pub use member::{Admission, Attendance, LatePolicy};
pub use outputs::{BarrierOutput, Ignored, MissingCommand, Refused, Stamp, Timer, Timing};
pub use participant::Participant;
pub use states::{NoState, RecentStates, StateQuery};
