//! The conformance kit: it plays simulator to one robot over the real bus and checks the rules of `docs/protocol.md`
//! one by one.
//!
//! The robot is a program, in whatever language. It is started anew for each group of rules, so that what a rule does
//! to it (a malformed message, a refusal, a signal) touches no other rule. What a robot does with its ticks is its own
//! affair: no rule assumes that it moves, asks or commands. What it cannot show is skipped, and the report says so.
//!
//! Much of the contract is about what must *not* make a difference: a repeated clock, a field that nobody knows, the
//! order in which commands arrive. Such a rule is checked by playing the same ticks twice, with the disturbance and
//! without it: the reports must be the same, which the promise of the project (same seed, same run) makes fair.

mod cast;
mod checks;
mod comparison;
mod kit;
mod process;
mod reading;
mod report;
mod rules;
mod script;
mod setting;
mod stage;

pub use kit::{CannotRun, check};
pub use report::{AnswerTimes, Failure, Outcome, Report, Verdict};
pub use rules::{PAGE, RULES, Rule};
pub use setting::{Role, Setting};
