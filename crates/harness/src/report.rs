//! What came of a check, for people (TAP 14) and for programs (JSON).

use std::collections::BTreeSet;
use std::fmt;

use bus::BusError;
use protocol::{RobotName, Tick};
use serde::Serialize;

use crate::rules::ProtocolRule;

/// A part of the kit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum KitPart {
    /// The checks that take the robot through one thing at a time.
    #[serde(rename = "alone")]
    Alone,
    /// The same, in the second epoch of the robot's process.
    #[serde(rename = "in a later epoch")]
    LaterEpoch,
    /// The same, after the robot's process has joined again.
    #[serde(rename = "after joining again")]
    Rejoined,
    /// A run of at least three robots, in which all of it happens.
    #[serde(rename = "in a run")]
    InRun,
}

impl fmt::Display for KitPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alone => "alone",
            Self::LaterEpoch => "in a later epoch",
            Self::Rejoined => "after joining again",
            Self::InRun => "in a run",
        })
    }
}

/// The part in a run, as it was played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PlayedRun {
    /// Robots of its roster.
    pub robots: usize,
    /// Ticks after the first.
    pub ticks: Tick,
    /// How often it was played with everything that happens in it.
    pub plays: usize,
}

/// Why a rule failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RuleFailure {
    /// Where it was seen.
    pub part: KitPart,
    /// What a correct robot does.
    pub expected: String,
    /// What this one did.
    pub came: String,
    /// Whether a machine that is busy can have the same effect.
    #[serde(skip)]
    pub may_be_load: bool,
}

impl RuleFailure {
    /// A rule that is broken: what it demands, and what came instead. It is of the part in which the robot is alone.
    pub fn new(expected: impl Into<String>, came: impl Into<String>) -> Self {
        Self {
            part: KitPart::Alone,
            expected: expected.into(),
            came: came.into(),
            may_be_load: false,
        }
    }

    /// Something that did not come, or a link that was lost: a busy machine can have the same effect.
    pub fn maybe_of_load(expected: impl Into<String>, came: impl Into<String>) -> Self {
        Self {
            may_be_load: true,
            ..Self::new(expected, came)
        }
    }
}

impl From<BusError> for RuleFailure {
    fn from(error: BusError) -> Self {
        Self::new("the kit's own bus works", error.to_string())
    }
}

/// What is known of one rule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", rename_all = "snake_case")]
pub enum RuleVerdict {
    /// No check found it broken.
    Passed,
    /// It is broken.
    Failed(RuleFailure),
    /// This robot gives no occasion to see it.
    Skipped {
        /// Why.
        reason: String,
    },
}

/// A rule and what is known of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RuleOutcome {
    /// The rule.
    pub rule: ProtocolRule,
    /// What is known of it.
    pub verdict: RuleVerdict,
}

/// How long the robot took from a clock to its report, milliseconds of wall clock. No rule demands
/// any of it.
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
    pub fn of(mut times_ms: Vec<f64>) -> Option<Self> {
        times_ms.sort_by(f64::total_cmp);

        Some(Self {
            ticks: times_ms.len(),
            min_ms: quantile(&times_ms, 0.0)?,
            median_ms: quantile(&times_ms, 0.5)?,
            p99_ms: quantile(&times_ms, 0.99)?,
            max_ms: quantile(&times_ms, 1.0)?,
        })
    }
}

/// The value below which a share of sorted values lies.
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    sorted.get((last as f64 * share).round() as usize).copied()
}

/// What came of a check.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckReport {
    /// The robot that was checked.
    pub name: RobotName,
    /// What it is written with, as it states.
    pub sdk: String,
    /// The rules that were asked for, in the order of the page.
    pub outcomes: Vec<RuleOutcome>,
    /// How long it took to answer.
    pub answers: Option<AnswerTimes>,
    /// The part in a run; absent where no rule that was asked for needs it.
    pub in_run: Option<PlayedRun>,
    /// Rules of checks that failed while the machine was busy, and whose second attempt counts.
    pub once_more: BTreeSet<&'static str>,
}

impl CheckReport {
    /// Whether no rule failed.
    #[must_use]
    pub fn is_passed(&self) -> bool {
        self.failed().next().is_none()
    }

    /// The rules that failed, and why.
    pub fn failed(&self) -> impl Iterator<Item = (ProtocolRule, &RuleFailure)> {
        self.outcomes
            .iter()
            .filter_map(|outcome| match &outcome.verdict {
                RuleVerdict::Failed(failure) => Some((outcome.rule, failure)),
                _ => None,
            })
    }

    fn count(&self, is_meant: impl Fn(&RuleVerdict) -> bool) -> usize {
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
        let mut rules = Vec::new();
        for RuleOutcome { rule, verdict } in &self.outcomes {
            let mut line = serde_json::json!(verdict);
            line["rule"] = rule.name.into();
            line["see"] = rule.reference().into();
            rules.push(line);
        }

        serde_json::json!({
            "robot": self.name,
            "sdk": self.sdk,
            "passed": self.count(|verdict| *verdict == RuleVerdict::Passed),
            "failed": self.failed().count(),
            "skipped": self.count(|verdict| matches!(verdict, RuleVerdict::Skipped { .. })),
            "rules": rules,
            "time.answer": self.answers,
            "in_run": self.in_run,
            "once_more": self.once_more,
        })
    }
}

/// A text as a scalar of YAML: JSON's strings are some.
fn scalar(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "TAP version 14")?;
        writeln!(f, "1..{}", self.outcomes.len())?;
        for (number, RuleOutcome { rule, verdict }) in (1..).zip(&self.outcomes) {
            match verdict {
                RuleVerdict::Passed => writeln!(f, "ok {number} - {}", rule.name)?,
                // A line break would end the directive, and a second '#' would be taken for another one by some.
                RuleVerdict::Skipped { reason } => {
                    let reason = reason.replace(['\n', '#'], " ");
                    writeln!(f, "ok {number} - {} # SKIP {reason}", rule.name)?;
                }
                RuleVerdict::Failed(RuleFailure {
                    part,
                    expected,
                    came,
                    ..
                }) => {
                    writeln!(f, "not ok {number} - {}", rule.name)?;
                    writeln!(f, "  ---")?;
                    writeln!(f, "  part: {part}")?;
                    writeln!(f, "  expected: {}", scalar(expected))?;
                    writeln!(f, "  came: {}", scalar(came))?;
                    writeln!(f, "  see: {}", scalar(&rule.reference()))?;
                    writeln!(f, "  ...")?;
                }
            }
        }
        if let Some(times) = self.answers {
            writeln!(
                f,
                "# time.answer over {} ticks: min {:.2} ms, median {:.2} ms, p99 {:.2} ms, max {:.2} ms",
                times.ticks, times.min_ms, times.median_ms, times.p99_ms, times.max_ms
            )?;
        }

        if let Some(run) = self.in_run {
            writeln!(
                f,
                "# in a run: {} robots, {} ticks, played {} times, and once undisturbed",
                run.robots, run.ticks, run.plays
            )?;
        }

        for rule in &self.once_more {
            writeln!(
                f,
                "# {rule}: checked once more, because the machine was busy"
            )?;
        }

        let passed = self.count(|verdict| *verdict == RuleVerdict::Passed);
        let failed = self.failed().count();
        let skipped = self.outcomes.len() - passed - failed;
        writeln!(
            f,
            "# {}: {passed} passed, {failed} failed, {skipped} skipped",
            self.name
        )
    }
}
