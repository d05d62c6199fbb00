//! The whole system: real processes, real zenoh, the shipped files.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod bench;
mod boundaries;
mod chaos;
mod control;
mod determinism;
mod experiment;
mod faults;
mod killed;
mod output;
mod paths;
mod record;
mod shell;
mod temporary;
mod wire;
