//! The first difference between two ticks: robot, field, and both values.

use std::collections::BTreeSet;
use std::fmt;

use protocol::{Event, RobotName, Tick};
use recording::Header;
use serde::Serialize;
use serde_json::Value;

use crate::read::Entry;
use crate::summary::Summary;

/// Fields of a report that count epochs and processes, which the record does not compare.
const REPORT_NOT_COMPARED: [&str; 2] = ["epoch", "generation"];
/// Fields of a header that name the run and the program.
const HEADER_NOT_COMPARED: [&str; 5] = ["run", "version", "commit", "protocol", "static_world"];

/// Fields of a summary that name the run and the program, and those that are wall clock.
const SUMMARY_NOT_COMPARED: [&str; 3] = ["run", "version", "wall"];

/// Where two runs differ first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The tick.
    pub tick: Tick,
    /// The robot concerned; `None` for the environment.
    pub robot: Option<RobotName>,
    /// The field, as in `state_variables.served` or `command_sent.command`.
    pub field: String,
    /// The values; `None` where a run has none.
    pub values: [Option<String>; 2],
}

impl Difference {
    /// What one of the runs, 0 or 1, has there.
    #[must_use]
    pub fn value(&self, run: usize) -> &str {
        let value = self.values.get(run).and_then(Option::as_deref);
        value.unwrap_or("nothing")
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tick = self.tick;
        match &self.robot {
            Some(robot) => write!(f, "tick {tick}, {robot}, {}", self.field),
            None => write!(f, "tick {tick}, {}", self.field),
        }
    }
}

/// The first difference between two entries for the same tick; `None` if they are equal.
///
/// What the environment did comes before what robots did about it. Reports say more than the events that follow from them, and the
/// field more than a digest.
#[must_use]
pub fn between(a: &Entry, b: &Entry) -> Option<Difference> {
    let in_events = first_event(a, b);
    if let Some((difference, true)) = in_events {
        return Some(difference);
    }

    // Only where the environment is the same: what robots reported is then the first thing that
    // differs, and the events follow from it.
    first_report(a, b)
        .or_else(|| first_in_frame(a, b))
        .or(in_events.map(|(difference, _)| difference))
}

/// The first difference between the events that the recording of an entry has and those of another entry.
#[must_use]
pub fn in_recording(recorded: &Entry, executed: &Entry) -> Option<Difference> {
    let events = recorded.recorded_events.as_ref()?;
    if *events == executed.events {
        return None;
    }

    let recorded = Entry {
        tick: recorded.tick,
        events: events.clone(),
        ..Entry::default()
    };
    let mut difference = between(&recorded, executed)?;
    difference.field = format!("{} in the recording", difference.field);
    Some(difference)
}

/// The first field in which two headers of recordings differ that follow from a scenario; `None` if there is none.
#[must_use]
pub fn between_headers(a: &Header, b: &Header) -> Option<Difference> {
    let [one, other] = [a, b].map(|header| without(header, &HEADER_NOT_COMPARED));
    let (field, values) = first_field(&one, &other)?;
    Some(Difference {
        tick: 0,
        robot: None,
        field: format!("header.{field}"),
        values,
    })
}

/// The first field in which two summaries differ that follows from a record; `None` if there is none. The first one is given as it
/// is in its file.
#[must_use]
pub fn between_summaries(a: &Value, b: &Summary) -> Option<Difference> {
    let [one, other] = [a, &to_json(b)].map(|summary| without(summary, &SUMMARY_NOT_COMPARED));
    let (field, values) = first_field(&one, &other)?;
    Some(Difference {
        tick: b.ticks,
        robot: None,
        field: format!("summary.{field}"),
        values,
    })
}

/// The first difference between the events, and whether it is one of the environment.
fn first_event(a: &Entry, b: &Entry) -> Option<(Difference, bool)> {
    let count = a.events.len().max(b.events.len());
    for index in 0..count {
        let pair = [a.events.get(index), b.events.get(index)];
        if pair[0] == pair[1] {
            continue;
        }

        let is_environment = pair.iter().flatten().any(|event| is_environment(event));
        return Some((of_events(a.tick, pair), is_environment));
    }
    None
}

fn of_events(tick: Tick, pair: [Option<&Event>; 2]) -> Difference {
    let jsons = pair.map(|event| event.map(to_json));
    let robot = jsons.iter().flatten().find_map(robot_of);
    let mut field = "event".to_owned();
    let mut values = jsons
        .each_ref()
        .map(|json| json.as_ref().map(Value::to_string));

    if let ([Some(one), Some(other)], [Some(json), Some(other_json)]) = (pair, &jsons)
        && one.kind() == other.kind()
        && robot_of(json) == robot_of(other_json)
        && let Some((path, of_path)) = first_field(json, other_json)
    {
        field = format!("{}.{path}", one.kind());
        values = of_path;
    }

    Difference {
        tick,
        robot,
        field,
        values,
    }
}

/// The first difference between the reports that both have.
fn first_report(a: &Entry, b: &Entry) -> Option<Difference> {
    let one = a.reports.as_ref()?;
    let other = b.reports.as_ref()?;

    // Also a robot that has a report in one of them only.
    let names: BTreeSet<&RobotName> = one.keys().chain(other.keys()).collect();
    for name in names {
        let jsons = [one.get(name), other.get(name)]
            .map(|report| report.map(|report| without(report, &REPORT_NOT_COMPARED)));
        let found = match &jsons {
            [Some(one), Some(other)] => first_field(one, other),
            [one, other] => Some((
                "report".to_owned(),
                [one, other].map(|report| report.as_ref().map(Value::to_string)),
            )),
        };
        if let Some((field, values)) = found {
            return Some(Difference {
                tick: a.tick,
                robot: Some(name.clone()),
                field,
                values,
            });
        }
    }

    None
}

/// The first difference between the fields that both have.
fn first_in_frame(a: &Entry, b: &Entry) -> Option<Difference> {
    let one = a.frame.as_ref()?;
    let other = b.frame.as_ref()?;
    if one == other {
        return None;
    }

    for (placed, other) in one.robots.iter().zip(&other.robots) {
        if let Some((field, values)) = first_field(&to_json(placed), &to_json(other)) {
            return Some(Difference {
                tick: a.tick,
                robot: Some(placed.name.clone()),
                field,
                values,
            });
        }
    }
    let (field, values) = first_field(&to_json(one), &to_json(other))?;
    Some(Difference {
        tick: a.tick,
        robot: None,
        field: format!("frame.{field}"),
        values,
    })
}

/// The path of the first field in which two values differ, and the two values of it.
fn first_field(a: &Value, b: &Value) -> Option<(String, [Option<String>; 2])> {
    if a == b {
        return None;
    }

    let mut names: Vec<String> = Vec::new();
    match (a, b) {
        (Value::Object(one), Value::Object(other)) => {
            names.extend(one.keys().cloned());
            names.extend(other.keys().filter(|key| !one.contains_key(*key)).cloned());
        }
        (Value::Array(one), Value::Array(other)) => {
            let count = one.len().max(other.len());
            names.extend((0..count).map(|index| index.to_string()));
        }
        _ => return Some((String::new(), [Some(a.to_string()), Some(b.to_string())])),
    }

    for name in names {
        match (member(a, &name), member(b, &name)) {
            (Some(one), Some(other)) => {
                if let Some((path, values)) = first_field(one, other) {
                    let dot = if path.is_empty() { "" } else { "." };
                    return Some((format!("{name}{dot}{path}"), values));
                }
            }
            (one, other) => {
                return Some((name, [one, other].map(|value| value.map(Value::to_string))));
            }
        }
    }
    None
}

fn member<'a>(of: &'a Value, name: &str) -> Option<&'a Value> {
    match of {
        Value::Array(values) => values.get(name.parse::<usize>().ok()?),
        _ => of.get(name),
    }
}

/// Whether an event is decided by the environment and the medium before robots act in the tick.
fn is_environment(event: &Event) -> bool {
    !matches!(
        event,
        Event::Emotion { .. }
            | Event::Behavior { .. }
            | Event::CommandSent { .. }
            | Event::Say { .. }
            | Event::Guest { .. }
            | Event::SiteChanged { .. }
            | Event::SiteRefused { .. }
            | Event::LayerChanged { .. }
            | Event::LayerRefused { .. }
            | Event::Missed { .. }
            | Event::DoneLate { .. }
            | Event::Judged { .. }
            | Event::Tick { .. }
    )
}

/// The robot that an event is about.
fn robot_of(event: &Value) -> Option<RobotName> {
    let robot = event.get("robot").or_else(|| event.get("from"))?;
    RobotName::new(robot.as_str()?).ok()
}

/// A value without some of its fields.
fn without(value: &impl Serialize, names: &[&str]) -> Value {
    let mut json = to_json(value);
    if let Some(fields) = json.as_object_mut() {
        for name in names {
            fields.remove(*name);
        }
    }
    json
}

fn to_json(value: &impl Serialize) -> Value {
    serde_json::to_value(value)
        .unwrap_or_else(|error| unreachable!("a record is always JSON: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moods(pairs: &[(&str, &str)]) -> Vec<Event> {
        let mut events = Vec::new();
        for (robot, to) in pairs {
            events.push(Event::Emotion {
                robot: RobotName::new(robot).expect("a legal name"),
                from: None,
                to: (*to).to_owned(),
            });
        }
        events
    }

    fn entry(events: Vec<Event>) -> Entry {
        Entry {
            tick: 7,
            events,
            ..Entry::default()
        }
    }

    #[test]
    fn the_first_field_that_differs_is_named() {
        let a = entry(moods(&[("Butler", "HAPPY"), ("Leguin", "HAPPY")]));
        let b = entry(moods(&[("Butler", "HAPPY"), ("Leguin", "CONCERNED")]));

        let difference = between(&a, &b).expect("they differ");
        assert_eq!(difference.to_string(), "tick 7, Leguin, emotion.to");
        let values = ["\"HAPPY\"", "\"CONCERNED\""].map(|value| Some(value.to_owned()));
        assert_eq!(difference.values, values);
        assert_eq!(between(&a, &a), None);
    }

    #[test]
    fn an_event_that_only_one_has_is_named() {
        let a = entry(moods(&[("Butler", "HAPPY")]));
        let b = entry(Vec::new());

        let difference = between(&a, &b).expect("they differ");
        assert_eq!(difference.to_string(), "tick 7, Butler, event");
        assert!(difference.values[0].is_some());
        assert_eq!(difference.values[1], None);
    }
}
