//! The contract between the simulator, the robots and the observers of a run.
//!
//! Three things live here and nowhere else: what is said ([`messages`]), where it is said ([`keys`]) and how it
//! is written ([`codec`]). It knows no sockets: the `bus` crate carries it.
//!
//! SI units and REP 103 throughout: meters, seconds, radians counter-clockwise from +x.

pub mod access;
mod angle;
pub mod codec;
#[cfg(test)]
mod contract;
pub mod event;
pub mod keys;
pub mod messages;
pub mod name;
mod path;
pub mod pattern;
pub mod plain;
pub mod random;
pub mod recorded;
pub mod schemas;
pub mod time;
pub mod wording;

// The tests of the contract name it as other crates do.
#[cfg(test)]
extern crate self as protocol;

pub use angle::published_angle;
pub use codec::{FieldError, Malformed, Message, decode, encode};
pub use event::{Event, Line};
pub use messages::{Epoch, Generation, Seq, Tick};
pub use name::{BadName, MAX_NAME_LEN, RobotName, RunName};
pub use pattern::RobotPattern;

/// Version of the contract. It is named where two sides first meet (join) and only a change that an old robot
/// could not survive raises it: unknown fields are ignored, so a new optional field does not.
pub const PROTOCOL_VERSION: u32 = 2;

/// Endpoint where a simulator listens and others connect unless told otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
