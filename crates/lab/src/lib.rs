//! Work with runs: executing a scenario in this process ([`run`]), reading a run's folder ([`folder`]), repeating runs and
//! comparing them ([`experiment`], [`statistics`]), and presenting results ([`table`], [`emotionml`]).

pub mod emotionml;
pub mod experiment;
pub mod folder;
mod performance;
pub mod run;
pub mod statistics;
pub mod table;

pub use performance::{Performance, performances};
