//! The recording of an epoch of a run, `run.mcap`: what it contains ([`content`]), and how it is written ([`Writer`]) and
//! read ([`Recording`]). Beside it may be answers of `cars why` ([`RunDecisions`]).
//!
//! The file is MCAP. Its times are simulated. Chunks end at the end of a tick, so a file that was cut off by a crash has
//! complete ticks up to its last complete chunk.

pub mod content;
mod damage;
mod decisions;
mod encode;
mod format;
mod index;
mod json;
pub mod mcap;
mod protobuf;
mod read;
mod shown;
mod ticks;
mod timelines;
mod topic;
mod viewers;
mod write;

pub use content::{Frame, Header, Json, PlacedRobot, RawTick, RecordedTick, TickEvents, WallTimes};
pub use damage::RecordingError;
pub use decisions::{ANSWERS, RunDecisions};
pub use read::Recording;
pub use shown::LastReports;
pub use ticks::Ticks;
pub use timelines::Timelines;
pub use write::{WriteError, Writer};

/// Name of the file in the folder of a run.
pub const FILE: &str = "run.mcap";
/// Name of the attached scenario.
pub const SCENARIO: &str = "scenario.toml";
/// Name of the metadata record.
pub const METADATA: &str = "cars";
