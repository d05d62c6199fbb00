//! The conformance kit: it plays simulator to one robot over the real bus and checks the rules of `docs/protocol.md`
//! one by one, and in a run.
//!
//! The robot is a program, in any language. It is started anew for each group of rules, so that what a rule does to it (a
//! malformed message, a refusal, a signal) touches no other rule. The crate `harness` plays the simulator, and keeps what the checks
//! observe. No rule assumes that a robot moves, queries or commands. What it cannot show is skipped, and the report gives the reason.
//!
//! No verdict follows from the wall clock where a loaded machine can have the same effect: checks judge by the order of
//! messages, or while they withhold what the robot waits for; a late answer counts only if it is late in each of several
//! repetitions and the kit's own queryable replies in time (`harness/src/patience.rs`, `checks/computing.rs`).
//!
//! What holds for a process that begins must hold later, too: the same checks are made in its second epoch, and after it has joined again.
//! A last part (`checks/run.rs`) plays a run of at least three robots, in which all of it happens. Failures of these parts count where no
//! rule is broken before, and say in which part they were seen.
//!
//! Much of the contract is about what must *not* make a difference: a repeated clock, an unknown field, news that come
//! late. Such a rule is checked by playing the same ticks twice, with the disturbance and without it: reports and commands
//! must be the same, which the promise of the project (same seed, same run) makes fair.

mod checks;

pub use checks::check;
pub use harness::flushing::unflushed;
pub use harness::kit::CannotRun;
pub use harness::process::kill_all;
pub use harness::report::{
    AnswerTimes, CheckReport, KitPart, PlayedRun, RuleFailure, RuleOutcome, RuleVerdict,
};
pub use harness::rules::{
    PAGE, ProtocolRule, RULES, STDIO_END, STDIO_FIELDS, STDIO_LOG, STDIO_RULES, rules,
};
pub use harness::setting::{CheckSetting, PlayedLayer, RosterRobot};
pub use harness::stdio::{STDIO_VARIABLE, StdioLine};
