//! `[[expect]]`: what a run is expected to do, and the verdict on whether it has done it.

mod rule;
mod watch;

pub use rule::{
    ExpectError, Expectation, MAX_EXPECTATIONS, MAX_NAME_CHARS, Rule, WrongEntry, check_all,
};
pub use watch::{Judgment, Monitor, Monitors};
