//! What is measured in a run: a number of its summary, or how often a robot entered a behavior.

use protocol::{Event, RobotName};
use serde::Deserialize;
use serde_json::Value;
use simulator::{Simulation, Summary, TickRecord};

/// One number of each run.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Its key in JSON.
    pub name: String,
    /// Head of its column in the table; without it the number is in the JSON only.
    pub column: Option<String>,
    /// A number of the summary by its path, parts joined by `.`. A part `*` is the sum over all entries.
    summary: Option<String>,
    /// How often a robot entered a behavior.
    entered: Option<Entered>,
    /// Which part of the run counts, for `entered`.
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

/// A measure is not one, or a run does not have it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// It names no source of its number, or two.
    #[error("a measure has either `summary` or `entered`")]
    NotOne,
    /// Events happen at a time.
    #[error("a count of events needs `when`: \"during\" or \"after\"")]
    NoTime,
    /// The summary of the run has no such number.
    #[error("the summary of a run has no number `{0}`")]
    Missing(String),
}

impl Measure {
    /// Checks that it can be made.
    pub(super) fn check(&self) -> Result<(), MeasureError> {
        match (&self.summary, &self.entered) {
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.when.is_some() => Ok(()),
            (None, Some(_)) => Err(MeasureError::NoTime),
            _ => Err(MeasureError::NotOne),
        }
    }
}

/// A measure of one run that is being played.
#[derive(Debug)]
pub struct Probe<'a> {
    measure: &'a Measure,
    /// When the condition begins and when it is over, simulated seconds.
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

    /// Takes a tick into account.
    pub(super) fn tick(&mut self, simulation: &Simulation, record: &TickRecord) {
        let Some(entered) = &self.measure.entered else {
            return;
        };
        let (from_s, until_s) = self.time_s;
        let at_s = simulation.time_s(record.tick);
        let counts = match self.measure.when {
            Some(When::During) => (from_s..until_s).contains(&at_s),
            Some(When::After) => at_s >= until_s,
            None => true,
        };
        if !counts {
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

    /// The number, from the summary of the run as JSON.
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
