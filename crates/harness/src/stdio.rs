//! Programs over standard input and output: what `cars exec` reports to the kit, which sees such a program through it only.
//!
//! The kit asks by an environment variable, so a command that starts `cars exec` by way of a script is asked, too. The answers
//! are lines of JSON on the standard output of `cars exec`, which has no other use.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use crate::report::RuleFailure;
use crate::rules::{ProtocolRule, STDIO_RULES};

/// The environment variable by which the kit asks `cars exec` for its reports.
pub const STDIO_VARIABLE: &str = "CARS_REPORT_FAULTS";

/// A line that `cars exec` reports to the kit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StdioLine {
    /// The first line: the names of the rules that it observes.
    Observed(Vec<String>),
    /// Its program breaks a rule.
    Fault {
        /// Name of the rule.
        rule: String,
        /// What the program did.
        came: String,
    },
}

impl StdioLine {
    /// All rules of such programs are observed.
    #[must_use]
    pub fn observed() -> Self {
        Self::Observed(STDIO_RULES.map(|rule| rule.name.to_owned()).into())
    }

    /// The program breaks a rule.
    #[must_use]
    pub fn fault(rule: &str, came: &str) -> Self {
        Self::Fault {
            rule: rule.to_owned(),
            came: came.to_owned(),
        }
    }

    /// The line, with its end.
    #[must_use]
    pub fn line(&self) -> String {
        let line = serde_json::to_string(self);
        // It has texts only, so serialization cannot fail.
        line.unwrap_or_else(|error| unreachable!("texts are always JSON: {error}")) + "\n"
    }
}

/// What was reported of all processes of the robot.
#[derive(Default)]
pub struct StdioReports(Mutex<Reported>);

#[derive(Default)]
struct Reported {
    is_program: bool,
    faults: BTreeMap<String, String>,
}

impl StdioReports {
    /// Takes what a process of the robot has printed. Of a robot that `cars exec` does not run, nothing is taken.
    pub fn take(&self, output: &str) {
        let mut reported = self.lock();
        for line in lines(output) {
            match line {
                StdioLine::Observed(_) => reported.is_program = true,
                StdioLine::Fault { rule, came } => {
                    // The first process shows the usual ticks, which are the easiest to understand.
                    reported.faults.entry(rule).or_insert(came);
                }
            }
        }
    }

    /// Whether the robot is a program that `cars exec` runs; known from its first process on.
    pub fn is_program(&self) -> bool {
        self.lock().is_program
    }

    /// How the rule was broken, if it was.
    pub fn failure(&self, rule: ProtocolRule) -> Option<RuleFailure> {
        self.lock()
            .faults
            .get(rule.name)
            .map(|came| failure(rule.name, came))
    }

    fn lock(&self) -> MutexGuard<'_, Reported> {
        // Each change is a single step, so a panic leaves what was taken.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The fault of one process by this rule, in what it has printed.
pub fn fault_in(output: &str, rule: &str) -> Option<RuleFailure> {
    lines(output).into_iter().find_map(|line| match line {
        StdioLine::Fault { rule: broken, came } if broken == rule => Some(failure(rule, &came)),
        _ => None,
    })
}

fn failure(rule: &str, came: &str) -> RuleFailure {
    let expected = match rule {
        crate::rules::STDIO_FIELDS => "lines with the fields of the page and no other ones",
        crate::rules::STDIO_LOG => "a log within its limits, in each tick",
        _ => "the program exits with status 0 within 2 s after the line `end`",
    };
    RuleFailure::new(expected, came)
}

/// What a robot has printed for people: without the reports to the kit.
pub fn without_reports(output: &str) -> String {
    let for_people: Vec<&str> = output
        .lines()
        .filter(|line| serde_json::from_str::<StdioLine>(line).is_err())
        .collect();
    for_people.join("\n")
}

/// The reports among the lines of an output. They begin with the rules that are observed: what another program prints is none.
fn lines(output: &str) -> Vec<StdioLine> {
    let reports: Vec<StdioLine> = output
        .lines()
        .map_while(|line| serde_json::from_str(line).ok())
        .collect();

    match reports.first() {
        Some(StdioLine::Observed(_)) => reports,
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::{STDIO_END, STDIO_FIELDS};

    #[test]
    fn only_cars_exec_reports() {
        let fault = StdioLine::fault(STDIO_FIELDS, "a field\nof two lines").line();
        let late = format!("hello\n{}{fault}", StdioLine::observed().line());
        for output in ["", "hello\n", "{}\n", &fault, &late, &fault.repeat(2)] {
            let reports = StdioReports::default();
            reports.take(output);
            assert!(!reports.is_program(), "{output}");
            assert_eq!(fault_in(output, STDIO_FIELDS), None, "{output}");
        }

        let reports = StdioReports::default();
        let begun = StdioLine::observed().line() + &fault;
        reports.take(&begun);
        reports.take(&(StdioLine::observed().line() + &StdioLine::fault(STDIO_FIELDS, "b").line()));
        assert!(reports.is_program());
        assert_eq!(without_reports(&format!("{begun}hello\n")), "hello");

        let [fields, log, _] = STDIO_RULES;
        let failure = reports.failure(fields).unwrap();
        assert_eq!(failure.came, "a field\nof two lines");
        assert_eq!(reports.failure(log), None);
        assert_eq!(fault_in(&begun, STDIO_FIELDS), Some(failure));
        assert_eq!(fault_in(&begun, STDIO_END), None);
    }
}
