//! The whole system: real processes, real zenoh, the shipped files.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod affect;
mod affect_table;
mod again;
mod book;
mod boundaries;
mod branch;
mod built_in;
mod by_hand;
mod cars_in_python;
mod clusters;
mod components;
mod conform;
mod console;
mod control;
mod crowd;
mod dependencies;
mod determinism;
mod diagram;
mod emotionml;
mod emotions;
mod end_when;
mod ended;
mod exec;
mod expect;
mod experiment;
mod export;
mod faults;
mod files;
mod folders;
mod fork;
mod forked_worlds;
mod handshake;
mod hunt;
mod killed;
mod names;
mod nemesis;
mod net;
mod output;
mod paper;
mod paths;
mod protocol;
mod radios;
mod record;
mod recording;
mod recruitment;
mod replay;
mod replayed;
mod report;
mod returns;
mod scale;
mod secure;
mod shell;
mod sites;
mod statistics;
mod stay;
mod stdio;
mod temporary;
mod threads;
mod timeline;
mod wall_clock;
mod welcomes;
mod why;
mod wire;
mod worlds;
mod zenoh_pico;
