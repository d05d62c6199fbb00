//! What the robot does wrong.

use protocol::{Message, decode};
use serde_json::Value;

/// What it does wrong: a rule, or a rule and a way to break it.
#[derive(Clone)]
pub(crate) struct Wrong(pub(crate) String);

impl Wrong {
    pub(crate) fn is(&self, rule: &str) -> bool {
        self.0 == rule
    }

    /// Reads a message.
    pub(crate) fn read<M: Message>(&self, key: &str, bytes: &[u8]) -> Option<M> {
        let message = match decode::<M>(key, "another participant", bytes) {
            Ok(message) => message,
            Err(_) if self.is("robust.malformed") => std::process::exit(1),
            Err(error) => {
                if !self.is("robust.malformed:silent") {
                    eprintln!("{error}");
                }
                return None;
            }
        };

        let raw: Value = serde_json::from_slice(bytes).ok()?;
        let known = serde_json::from_slice(&message.to_json()).ok()?;
        let is_refused = self.is("compat.unknown-fields") && has_unknown_fields(&raw, &known)
            || self.is("number.integers:refused") && has_integers_for_floats(&raw, &known);
        (!is_refused).then_some(message)
    }
}

/// Whether a message has fields that its type does not have.
fn has_unknown_fields(raw: &Value, known: &Value) -> bool {
    match (raw, known) {
        (Value::Object(raw), Value::Object(known)) => raw.iter().any(|(name, value)| {
            known
                .get(name)
                .is_none_or(|known| has_unknown_fields(value, known))
        }),
        (Value::Array(raw), Value::Array(known)) => raw
            .iter()
            .zip(known)
            .any(|(raw, known)| has_unknown_fields(raw, known)),
        _ => false,
    }
}

/// Whether a number of a message that may have a fraction is written as an integer.
fn has_integers_for_floats(raw: &Value, known: &Value) -> bool {
    match (raw, known) {
        (Value::Object(raw), Value::Object(known)) => raw.iter().any(|(name, value)| {
            known
                .get(name)
                .is_some_and(|known| has_integers_for_floats(value, known))
        }),
        (Value::Array(raw), Value::Array(known)) => raw
            .iter()
            .zip(known)
            .any(|(raw, known)| has_integers_for_floats(raw, known)),
        (Value::Number(raw), Value::Number(known)) => known.is_f64() && !raw.is_f64(),
        _ => false,
    }
}
