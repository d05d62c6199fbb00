//! Work with one run: executing a scenario in this process ([`run`]), reading a run's folder ([`folder`]), executing a recorded
//! run again ([`verify`]) and letting it go on otherwise, recorded ([`fork`]) or in memory ([`branch`]), comparing two runs ([`diff`]), judging a recorded run
//! ([`judge`]), playing single robots from their records ([`replayed`]), and reading records to find damage ([`inspect`]).

pub mod branch;
pub mod diff;
pub mod environment;
mod error;
pub mod folder;
pub mod fork;
pub mod inspect;
pub mod judge;
pub mod moment;
mod performance;
mod reexecution;
pub mod replayed;
pub mod run;
pub mod scratch;
pub mod states;
pub mod stepped;
pub mod verify;

pub use error::LabError;
pub use performance::{Performance, performances};
pub use reexecution::{digest_from, first_difference};
