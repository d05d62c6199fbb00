//! The rules of `docs/protocol.md`, each with a name, and the verdicts about a robot by them: findings of single checks, what
//! `cars exec` reports of the program that it runs, why such a program does not answer, and the report on all.

pub mod findings;
pub mod flushing;
pub mod report;
pub mod rules;
pub mod stdio;
