//! Measures of a run: a number of its summary, or how often a robot entered a behavior.

use protocol::{Event, RobotName};
use serde::Deserialize;
use serde_json::Value;
use simulator::{Simulation, Summary, TickRecord};

/// A definition of one number of each run.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Key of the number in the JSON.
    pub name: String,
    /// Head of the column in the table; without it the number is in the JSON only.
    pub column: Option<String>,
    /// Path of a number in the summary, parts joined by `.`. A part `*` is the sum over all entries.
    summary: Option<String>,
    /// Counts how often a robot entered a behavior.
    entered: Option<Entered>,
    /// Part of the run in which `entered` counts.
    when: Option<When>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entered {
    robot: RobotName,
    behavior: String,
}

/// A part of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// While the condition lasts.
    During,
    /// From its end on.
    After,
}

/// A measure that is not defined properly, or that a run does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// It has neither `summary` nor `entered`, or both.
    #[error("a measure has either `summary` or `entered`")]
    NotOne,
    /// It counts events without naming the part of the run.
    #[error("a count of events needs `when`: \"during\" or \"after\"")]
    NoTime,
    /// The summary of the run has no such number.
    #[error("the summary of a run has no number `{0}`")]
    Missing(String),
}

impl Measure {
    /// Checks that it has exactly one source, and a part of the run if it counts events.
    pub(super) fn check(&self) -> Result<(), MeasureError> {
        match (&self.summary, &self.entered) {
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.when.is_some() => Ok(()),
            (None, Some(_)) => Err(MeasureError::NoTime),
            _ => Err(MeasureError::NotOne),
        }
    }
}

/// The state of a measure while a run is played.
#[derive(Debug)]
pub struct Probe<'a> {
    measure: &'a Measure,
    /// Begin and end of the condition, simulated seconds.
    time_s: (f64, f64),
    count: u64,
}

impl<'a> Probe<'a> {
    pub(super) fn new(measure: &'a Measure, time_s: (f64, f64)) -> Self {
        Self {
            measure,
            time_s,
            count: 0,
        }
    }

    /// Counts the events of a tick.
    pub(super) fn tick(&mut self, simulation: &Simulation, record: &TickRecord) {
        let Some(entered) = &self.measure.entered else {
            return;
        };
        if !self.is_counting(simulation.time_s(record.tick)) {
            return;
        }
        for event in &record.events {
            if let Event::Behavior { robot, to, .. } = event
                && *robot == entered.robot
                && *to == entered.behavior
            {
                self.count += 1;
            }
        }
    }

    fn is_counting(&self, at_s: f64) -> bool {
        let (from_s, until_s) = self.time_s;
        match self.measure.when {
            Some(When::During) => (from_s..until_s).contains(&at_s),
            Some(When::After) => at_s >= until_s,
            None => true,
        }
    }

    /// The number at the end of the run, the summary of which is given as JSON.
    pub(super) fn value(&self, summary: &Value) -> Result<f64, MeasureError> {
        let Some(path) = &self.measure.summary else {
            return Ok(self.count as f64);
        };
        let parts: Vec<&str> = path.split('.').collect();
        sum(summary, &parts).ok_or_else(|| MeasureError::Missing(path.clone()))
    }
}

/// The number at a path, or the sum over all entries where a part is `*`.
fn sum(value: &Value, path: &[&str]) -> Option<f64> {
    let Some((first, rest)) = path.split_first() else {
        return value.as_f64();
    };

    let table = value.as_object()?;

    if *first != "*" {
        return sum(table.get(*first)?, rest);
    }

    let mut total = 0.0;
    for entry in table.values() {
        total += sum(entry, rest)?;
    }

    Some(total)
}

/// The summary of a run as JSON.
pub(super) fn as_json(summary: &Summary) -> Result<Value, serde_json::Error> {
    serde_json::to_value(summary)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_path_is_followed_and_a_star_is_a_sum() {
        let summary =
            json!({ "robots": { "A": { "sent": { "x": 2, "y": 3 } }, "B": { "sent": {} } } });
        let at = |path: &str| sum(&summary, &path.split('.').collect::<Vec<_>>());
        assert_eq!(at("robots.A.sent.x"), Some(2.0));
        assert_eq!(at("robots.*.sent.*"), Some(5.0));
        assert_eq!(at("robots.A.sent"), None);
        assert_eq!(at("robots.C.sent.x"), None);
    }
}
