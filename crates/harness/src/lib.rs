//! The simulator, played to one robot program over the real bus, and all that the robot does, kept: what the checks of the
//! conformance kit stand on.
//!
//! A [`Kit`](kit::Kit) is the router session and the robot's command. A [`Harness`] is one process of the robot on a run of its own; the
//! simulator's side of the lock-step is [`lockstep::Barrier`], the same as in the simulator itself. A script (`script.rs`) says what
//! happens to the robot, a [`Transcript`](transcript::Transcript) what the robot did. Findings become verdicts by the rules of
//! `docs/protocol.md`, each with a name, and a report on all.

pub mod body;
pub mod comparison;
pub mod fake_peers;
pub mod findings;
pub mod flushing;
mod harness;
pub mod kit;
pub mod load;
pub mod patience;
pub mod process;
pub mod reading;
pub mod report;
pub mod rules;
pub mod script;
pub mod seen;
pub mod setting;
pub mod stdio;
pub mod transcript;
mod wire;

pub use crate::harness::{Harness, HarnessOptions};
pub use crate::wire::Joining;
