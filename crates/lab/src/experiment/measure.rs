//! Measures of a run: a number of its summary, how often a robot entered a behavior, or whether the robots got stuck.

use config::units::Time;
use protocol::{Event, RobotName};
use serde::Deserialize;
use serde_json::Value;
use simulator::{Simulation, Summary, TickRecord};

use crate::statistics::TimeTo;

/// A definition of one number of each run.
#[derive(Debug, Clone)]
pub struct Measure {
    /// Key of the number in the JSON.
    pub name: String,
    /// Head of the column in the table; without it the number is in the JSON only.
    pub column: Option<String>,
    /// Whether the arms are compared by it.
    pub contrast: bool,
    /// Where the number comes from.
    pub kind: Kind,
}

/// Where a measure comes from.
#[derive(Debug, Clone)]
pub enum Kind {
    /// Path of a number in the summary, parts joined by `.`. A part `*` is the sum over all entries.
    Summary(String),
    /// How often a robot entered a behavior.
    Entered {
        /// The robot.
        robot: RobotName,
        /// The behavior.
        behavior: String,
        /// Part of the run in which it counts.
        when: When,
    },
    /// Whether no robot makes progress until the end of the run: 1 or 0.
    Stalled(Stalled),
}

/// A deadlock: none of these numbers rises for a time that lasts until the end of the run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stalled {
    /// State variables that rise with progress toward a robot's goal.
    progress: Vec<Counter>,
    /// Shortest time without progress that counts.
    #[serde(rename = "for")]
    lasting: Time,
}

/// A state variable of a robot, in a file `ROBOT.VARIABLE`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
struct Counter {
    robot: RobotName,
    variable: String,
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

/// A measure as written in the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMeasure {
    name: String,
    column: Option<String>,
    #[serde(default)]
    contrast: bool,
    summary: Option<String>,
    entered: Option<RawEntered>,
    when: Option<When>,
    stalled: Option<Stalled>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEntered {
    robot: RobotName,
    behavior: String,
}

/// A measure that is not defined properly, or that a run does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// It has none or several of `summary`, `entered` and `stalled`.
    #[error("a measure has either `summary` or `entered` or `stalled`")]
    NotOne,
    /// It counts events without naming the part of the run.
    #[error("a count of events needs `when`: \"during\" or \"after\"")]
    NoTime,
    /// It names a part of the run and counts no events.
    #[error("`when` is for a count of events, `entered`")]
    NoEvents,
    /// A variable of a robot that is not `ROBOT.VARIABLE`.
    #[error("\"{0}\" is not a state variable of a robot, such as \"Butler.served\"")]
    NoVariable(String),
    /// A deadlock without a duration or variables.
    #[error("`stalled` names the variables of progress, and a time that is more than zero")]
    NoProgress,
    /// The summary of the run has no such number.
    #[error("the summary of a run has no number `{0}`")]
    Missing(String),
    /// No robot has such a number.
    #[error("{0} has no number `{1}` among its state variables")]
    NoNumber(RobotName, String),
}

impl TryFrom<String> for Counter {
    type Error = MeasureError;

    fn try_from(text: String) -> Result<Self, MeasureError> {
        let parts = text.split_once('.');
        let counter = parts.and_then(|(robot, variable)| {
            Some(Self {
                robot: robot.parse().ok()?,
                variable: variable.to_owned(),
            })
        });

        counter.ok_or(MeasureError::NoVariable(text))
    }
}

impl RawMeasure {
    /// Checks that it has exactly one source, and a part of the run if it counts events.
    pub(super) fn check(self) -> Result<Measure, MeasureError> {
        let kind = match (self.summary, self.entered, self.stalled) {
            (Some(path), None, None) => Kind::Summary(path),
            (None, Some(entered), None) => Kind::Entered {
                robot: entered.robot,
                behavior: entered.behavior,
                when: self.when.ok_or(MeasureError::NoTime)?,
            },
            (None, None, Some(stalled)) => Kind::Stalled(stalled.check()?),
            _ => return Err(MeasureError::NotOne),
        };
        if self.when.is_some() && !matches!(kind, Kind::Entered { .. }) {
            return Err(MeasureError::NoEvents);
        }

        Ok(Measure {
            name: self.name,
            column: self.column,
            contrast: self.contrast,
            kind,
        })
    }
}

impl Measure {
    /// What the measure means, where its name does not say it.
    #[must_use]
    pub fn explained(&self) -> Option<String> {
        let Kind::Stalled(stalled) = &self.kind else {
            return None;
        };

        let variables: Vec<String> = stalled.progress.iter().map(Counter::to_string).collect();
        Some(format!(
            "{}: none of {} rises for {} s or more until the end of the run. The time to it is that of the last\n\
             rise; its median over the runs is by Kaplan and Meier, runs without it being censored at their end.",
            self.name,
            variables.join(", "),
            stalled.lasting.0
        ))
    }
}

impl Stalled {
    fn check(self) -> Result<Self, MeasureError> {
        if self.progress.is_empty() || self.lasting.0 <= 0.0 {
            return Err(MeasureError::NoProgress);
        }
        Ok(self)
    }
}

impl std::fmt::Display for Counter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.robot, self.variable)
    }
}

/// The state of a measure while a run is played.
#[derive(Debug)]
pub(super) struct Probe<'a> {
    measure: &'a Measure,
    /// Begin and end of the condition, simulated seconds.
    time_s: (f64, f64),
    count: u64,
    /// Values of the variables of progress at the tick before.
    before: Vec<Option<f64>>,
    /// Time of the last progress, simulated seconds.
    progress_s: f64,
    /// Time of the last tick, simulated seconds.
    now_s: f64,
}

impl<'a> Probe<'a> {
    pub(super) fn new(measure: &'a Measure, time_s: (f64, f64)) -> Self {
        Self {
            measure,
            time_s,
            count: 0,
            before: Vec::new(),
            progress_s: 0.0,
            now_s: 0.0,
        }
    }

    /// Counts the events of a tick, and looks for progress.
    pub(super) fn tick(&mut self, simulation: &Simulation, record: &TickRecord) {
        self.now_s = simulation.time_s(record.tick);
        match &self.measure.kind {
            Kind::Summary(_) => {}
            Kind::Entered { when, .. } if !self.is_counting(*when) => {}
            Kind::Entered {
                robot, behavior, ..
            } => {
                for event in &record.events {
                    if let Event::Behavior { robot: of, to, .. } = event
                        && of == robot
                        && to == behavior
                    {
                        self.count += 1;
                    }
                }
            }
            Kind::Stalled(stalled) => {
                let mut values = Vec::new();
                for counter in &stalled.progress {
                    let variables = simulation.state_variables(&counter.robot);
                    let value = variables.and_then(|all| all.get(&counter.variable)?.as_f64());
                    values.push(value);
                }
                self.progress(values);
            }
        }
    }

    fn progress(&mut self, values: Vec<Option<f64>>) {
        for (before, now) in self.before.iter().zip(&values) {
            if let (Some(before), Some(now)) = (before, now)
                && now > before
            {
                self.progress_s = self.now_s;
            }
        }
        self.before = values;
    }

    fn is_counting(&self, when: When) -> bool {
        let (from_s, until_s) = self.time_s;
        match when {
            When::During => (from_s..until_s).contains(&self.now_s),
            When::After => self.now_s >= until_s,
        }
    }

    /// The number at the end of the run, the summary of which is given as JSON.
    pub(super) fn value(&self, summary: &Value) -> Result<f64, MeasureError> {
        match &self.measure.kind {
            Kind::Entered { .. } => Ok(self.count as f64),
            Kind::Summary(path) => {
                let parts: Vec<&str> = path.split('.').collect();
                sum(summary, &parts).ok_or_else(|| MeasureError::Missing(path.clone()))
            }
            Kind::Stalled(stalled) => {
                for (counter, value) in stalled.progress.iter().zip(&self.before) {
                    if value.is_none() {
                        let robot = counter.robot.clone();
                        return Err(MeasureError::NoNumber(robot, counter.variable.clone()));
                    }
                }
                Ok(f64::from(u8::from(self.is_stalled(stalled))))
            }
        }
    }

    /// The time to a deadlock; `None` for other measures.
    pub(super) fn time(&self) -> Option<TimeTo> {
        let Kind::Stalled(stalled) = &self.measure.kind else {
            return None;
        };

        let is_event = self.is_stalled(stalled);
        let time_s = if is_event {
            self.progress_s
        } else {
            self.now_s
        };
        Some(TimeTo { time_s, is_event })
    }

    fn is_stalled(&self, stalled: &Stalled) -> bool {
        self.now_s - self.progress_s >= stalled.lasting.0
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

    /// The value and the time of a deadlock after 60 s without progress, in a run in which A and B make progress at these
    /// times and that ends at `end_s`.
    fn stalled(a_s: &[f64], b_s: &[f64], end_s: f64) -> (f64, TimeTo) {
        let measure = Measure {
            name: "deadlock".to_owned(),
            column: None,
            contrast: false,
            kind: Kind::Stalled(Stalled {
                progress: vec![
                    Counter::try_from("A.x".to_owned()).unwrap(),
                    Counter::try_from("B.y".to_owned()).unwrap(),
                ],
                lasting: Time(60.0),
            }),
        };

        let mut probe = Probe::new(&measure, (0.0, end_s));
        let mut now_s = 0.0;
        while now_s <= end_s {
            let reached = |times: &[f64]| times.iter().filter(|time| **time <= now_s).count();
            let counts = [reached(a_s), reached(b_s)];
            probe.now_s = now_s;
            probe.progress(counts.map(|count| Some(count as f64)).to_vec());
            now_s += 0.5;
        }
        let value = probe.value(&Value::Null).unwrap();
        (value, probe.time().unwrap())
    }

    #[test]
    fn a_deadlock_lasts_until_the_end() {
        let early = stalled(&[10.0, 20.0], &[40.0], 600.0);
        assert_eq!(early.0, 1.0);
        let expected = TimeTo {
            time_s: 40.0,
            is_event: true,
        };
        assert_eq!(early.1, expected);

        // A long pause is none, and neither is a short one at the end.
        let censored = TimeTo {
            time_s: 600.0,
            is_event: false,
        };
        for progress_s in [541.0, 599.0] {
            let (value, time) = stalled(&[10.0], &[progress_s], 600.0);
            assert_eq!(value, 0.0);
            assert_eq!(time, censored);
        }
    }

    #[test]
    fn a_run_without_any_progress_is_a_deadlock_from_its_beginning() {
        let (value, time) = stalled(&[], &[], 100.0);
        assert_eq!(value, 1.0);
        assert_eq!(time.time_s, 0.0);
    }
}
