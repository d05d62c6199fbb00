//! Work with runs: executing a scenario in this process ([`run`]), reading a run's folder ([`folder`]), executing a recorded
//! run again ([`verify`]) and comparing two runs ([`diff`]), repeating runs and comparing teams ([`experiment`]),
//! judging recorded runs ([`judge`]), presenting results ([`table`], [`mod@diagram`], [`report`]), letting them go on otherwise ([`fork`]), hunting for faults under which
//! expectations fail ([`hunt`]), playing single robots from their records ([`replayed`]),
//! reading records to find damage ([`inspect`]), and writing commands that can be typed ([`shell`]).

pub mod diagram;
pub mod diff;
pub mod experiment;
pub mod folder;
pub mod fork;
pub mod hunt;
pub mod inspect;
pub mod judge;
pub mod moment;
mod parts;
mod performance;
mod reexecution;
pub mod replayed;
pub mod report;
pub mod run;
pub mod scratch;
pub mod shell;
mod states;
pub mod table;
pub mod verify;

pub use parts::is_part_of_record;
pub use performance::{Performance, performances};
pub use reexecution::{digest_from, first_difference};
