//! The whole system: real processes, real zenoh, the shipped files.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod affect;
mod again;
mod book;
mod boundaries;
mod browser;
mod built_in;
mod by_hand;
mod conform;
mod control;
mod dependencies;
mod determinism;
mod diagram;
mod emotionml;
mod ended;
mod exec;
mod expect;
mod experiment;
mod experiments;
mod exports;
mod faults;
mod files;
mod folders;
mod forks;
mod hunt;
mod killed;
mod links;
mod names;
mod nemesis;
mod output;
mod page;
mod paths;
mod programs;
mod python;
mod record;
mod recordings;
mod replay;
mod replayed;
mod report;
mod returns;
mod secure;
mod shell;
mod states;
mod statistics;
mod stay;
mod temporary;
mod threads;
mod wall_clock;
mod wire;
