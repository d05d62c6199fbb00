//! What came of a check, for people (TAP 14) and for programs (JSON).

use std::fmt;

use protocol::RobotName;
use serde::Serialize;

use crate::rules::Rule;

/// Why a rule failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Failure {
    /// What a correct robot does.
    pub expected: String,
    /// What this one did.
    pub came: String,
}

impl Failure {
    pub(crate) fn new(expected: impl Into<String>, came: impl Into<String>) -> Self {
        Self {
            expected: expected.into(),
            came: came.into(),
        }
    }
}

/// What is known of one rule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing speaks against it.
    Passed,
    /// It is broken.
    Failed(Failure),
    /// This robot gives no occasion to see it.
    Skipped {
        /// Why.
        reason: String,
    },
}

/// A rule and what is known of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// The rule.
    pub rule: Rule,
    /// What is known of it.
    pub verdict: Verdict,
}

/// How long the robot took from a clock to its report, milliseconds of wall clock. No verdict: what is fast enough is
/// for its user to say.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AnswerTimes {
    /// Number of ticks measured.
    pub ticks: usize,
    /// Shortest.
    pub min_ms: f64,
    /// Half of them took no longer.
    pub median_ms: f64,
    /// 99 of 100 took no longer.
    pub p99_ms: f64,
    /// Longest.
    pub max_ms: f64,
}

impl AnswerTimes {
    /// The distribution of these times, if there are any.
    pub(crate) fn of(mut times_ms: Vec<f64>) -> Option<Self> {
        times_ms.sort_by(f64::total_cmp);
        let at = |share: f64| {
            times_ms
                .get(((times_ms.len() - 1) as f64 * share).round() as usize)
                .copied()
        };
        let ticks = times_ms.len();
        if ticks == 0 {
            return None;
        }
        Some(Self {
            ticks,
            min_ms: at(0.0)?,
            median_ms: at(0.5)?,
            p99_ms: at(0.99)?,
            max_ms: at(1.0)?,
        })
    }
}

/// What came of a check.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// The robot that was checked.
    pub name: RobotName,
    /// What it says it is written with.
    pub sdk: String,
    /// The rules that were asked for, in the order of the page.
    pub outcomes: Vec<Outcome>,
    /// How long it took to answer.
    pub answers: Option<AnswerTimes>,
}

impl Report {
    /// Whether no rule failed.
    #[must_use]
    pub fn is_passed(&self) -> bool {
        self.failed().next().is_none()
    }

    /// The rules that failed, and why.
    pub fn failed(&self) -> impl Iterator<Item = (Rule, &Failure)> {
        self.outcomes
            .iter()
            .filter_map(|outcome| match &outcome.verdict {
                Verdict::Failed(failure) => Some((outcome.rule, failure)),
                _ => None,
            })
    }

    fn count(&self, is_meant: impl Fn(&Verdict) -> bool) -> usize {
        self.outcomes
            .iter()
            .filter(|outcome| is_meant(&outcome.verdict))
            .count()
    }

    /// The report in the Test Anything Protocol, version 14, with a summary as its last lines.
    #[must_use]
    pub fn to_tap(&self) -> String {
        self.to_string()
    }

    /// The report as one JSON object.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        let rules = self.outcomes.iter().map(|Outcome { rule, verdict }| {
            let mut line = serde_json::json!(verdict);
            line["rule"] = rule.name.into();
            line["see"] = rule.reference().into();
            line
        });
        serde_json::json!({
            "robot": self.name,
            "sdk": self.sdk,
            "passed": self.count(|verdict| *verdict == Verdict::Passed),
            "failed": self.failed().count(),
            "skipped": self.count(|verdict| matches!(verdict, Verdict::Skipped { .. })),
            "rules": rules.collect::<Vec<_>>(),
            "time.answer": self.answers,
        })
    }
}

/// A text as a scalar of YAML: JSON's strings are some.
fn scalar(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "TAP version 14")?;
        writeln!(f, "1..{}", self.outcomes.len())?;
        for (number, Outcome { rule, verdict }) in (1..).zip(&self.outcomes) {
            match verdict {
                Verdict::Passed => writeln!(f, "ok {number} - {}", rule.name)?,
                // A line break would end the directive, and a second '#' would be taken for another one by some.
                Verdict::Skipped { reason } => {
                    let reason = reason.replace(['\n', '#'], " ");
                    writeln!(f, "ok {number} - {} # SKIP {reason}", rule.name)?;
                }
                Verdict::Failed(Failure { expected, came }) => {
                    writeln!(f, "not ok {number} - {}", rule.name)?;
                    writeln!(f, "  ---")?;
                    writeln!(f, "  expected: {}", scalar(expected))?;
                    writeln!(f, "  came: {}", scalar(came))?;
                    writeln!(f, "  see: {}", scalar(&rule.reference()))?;
                    writeln!(f, "  ...")?;
                }
            }
        }
        if let Some(times) = self.answers {
            let AnswerTimes {
                ticks,
                min_ms,
                median_ms,
                p99_ms,
                max_ms,
            } = times;
            writeln!(
                f,
                "# time.answer over {ticks} ticks: min {min_ms:.2} ms, median {median_ms:.2} ms, p99 {p99_ms:.2} ms, max {max_ms:.2} ms"
            )?;
        }
        let (passed, failed) = (
            self.count(|verdict| *verdict == Verdict::Passed),
            self.failed().count(),
        );
        let skipped = self.outcomes.len() - passed - failed;
        writeln!(
            f,
            "# {}: {passed} passed, {failed} failed, {skipped} skipped",
            self.name
        )
    }
}
