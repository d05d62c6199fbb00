//! Two plays of the same ticks: where they differ first.

use protocol::Tick;
use serde_json::Value;

use crate::kit::Kit;
use crate::report::RuleFailure;
use crate::transcript::{PlayedTick, Transcript};

/// What is shown of a value that differs, characters.
const SHOWN: usize = 200;

/// Where two plays differ: what the first has, and what the second has, in words.
#[derive(Debug)]
pub struct PlayDifference {
    /// The first tick that differs; none where one play ended before the other.
    pub tick: Option<Tick>,
    /// What the first has.
    pub first: String,
    /// What the second has.
    pub second: String,
}

impl PlayDifference {
    /// The failure of what was expected to make no difference.
    pub fn into_failure(self, expected: &str) -> RuleFailure {
        RuleFailure::new(format!("{expected}: {}", self.first), self.second)
    }
}

/// What a robot did in a tick: its report, and its commands with their targets.
fn outcome(entry: &PlayedTick) -> Value {
    let mut value = serde_json::json!(entry.report);
    value["epoch"] = Value::Null;
    value["generation"] = Value::Null;

    let mut commands = Vec::new();
    for sent in &entry.commands {
        let command = sent.command.as_ref().ok();
        commands.push(serde_json::json!({
            "to": sent.to,
            "command": command.map(|command| &command.command),
            "payload": command.and_then(|command| command.payload.as_ref()),
        }));
    }
    value["commands put"] = commands.into();

    value
}

/// The first difference between the reports and commands of two plays. Their epochs and generations may differ.
pub fn difference(one: &Transcript, two: &Transcript) -> Option<PlayDifference> {
    for (one, two) in one.iter().zip(two) {
        let first = outcome(one);
        let second = outcome(two);
        if first == second {
            continue;
        }

        let field = first_that_differs(&first, &second);
        return Some(PlayDifference {
            tick: Some(one.tick),
            first: shown(&first, &field, one.tick),
            second: shown(&second, &field, one.tick),
        });
    }

    (one.len() != two.len()).then(|| PlayDifference {
        tick: None,
        first: format!("{} ticks", one.len()),
        second: format!("{} ticks", two.len()),
    })
}

/// The first field in which two objects differ.
fn first_that_differs(one: &Value, two: &Value) -> String {
    one.as_object()
        .into_iter()
        .chain(two.as_object())
        .flat_map(|fields| fields.keys())
        .find(|field| one.get(field) != two.get(field))
        .cloned()
        .unwrap_or_default()
}

/// A field of a tick in words.
fn shown(value: &Value, field: &str, tick: Tick) -> String {
    let found = value.get(field).unwrap_or(&Value::Null);
    let text: String = found.to_string().chars().take(SHOWN).collect();
    format!("in tick {tick}, {field}: {text}")
}

/// Whether two plays gave the same reports and commands.
pub fn is_same(one: &Transcript, two: &Transcript) -> bool {
    difference(one, two).is_none()
}

/// Demands that what happened made no difference. A robot that does not even repeat itself fails by its own rule, and by
/// no other.
pub fn demand_same(
    kit: &Kit,
    what: &str,
    usual: &Transcript,
    other: &Transcript,
) -> Result<(), RuleFailure> {
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }

    match difference(usual, other) {
        None => Ok(()),
        Some(found) => Err(found.into_failure(&format!("{what} makes no difference"))),
    }
}
