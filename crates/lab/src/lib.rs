//! Work with runs: executing a scenario in this process ([`run`]), reading a run's folder ([`folder`]), executing a recorded
//! run again ([`verify`]) and comparing two runs ([`diff`]), repeating runs and comparing teams ([`experiment`],
//! [`statistics`]), and presenting results ([`table`], [`emotionml`]).

pub mod diff;
pub mod emotionml;
pub mod experiment;
pub mod folder;
mod performance;
pub mod run;
pub mod statistics;
pub mod table;
pub mod verify;

pub use performance::{Performance, performances};
