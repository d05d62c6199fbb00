//! What the robot does wrong.

use protocol::{Epoch, Generation, Message, Tick, decode};
use serde_json::{Value, json};

/// What it does wrong: a rule, or a rule and a way to break it.
#[derive(Clone)]
pub(crate) struct Wrong(pub(crate) String);

impl Wrong {
    pub(crate) fn is(&self, rule: &str) -> bool {
        self.0 == rule
    }

    /// What it keeps of an epoch and a tick.
    pub(crate) fn kept_of(&self, epoch: Epoch, tick: Tick) -> (Epoch, Tick) {
        match self.0.as_str() {
            "epoch.late:byte" => (epoch, tick % (1 << 8)),
            "epoch.late:two-bytes" => (epoch, tick % (1 << 16)),
            "epoch.init:byte" => (epoch % (1 << 8), tick),
            "epoch.init:two-bytes" => (epoch % (1 << 16), tick),
            _ => (epoch, tick),
        }
    }

    /// What it keeps of a generation.
    pub(crate) fn generation_kept_of(&self, generation: Generation) -> Generation {
        match self.0.as_str() {
            "return.generation:byte" => generation % (1 << 8),
            "return.generation:two-bytes" => generation % (1 << 16),
            _ => generation,
        }
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
        let refuses_unknown = self.is("compat.unknown-fields");
        let refuses_defaults_of = self.0.strip_prefix("compat.unknown-fields:");
        let refuses_defaults =
            refuses_defaults_of.is_some_and(|of| key.split('/').any(|part| part == of));
        let is_refused = refuses_unknown && has_fields(&raw, &known, &|_| true)
            || refuses_defaults && has_fields(&raw, &known, &is_default)
            || self.is("number.integers:refused") && has_integers_for_floats(&raw, &known);
        (!is_refused).then_some(message)
    }
}

/// Whether a message has such fields that its type does not have, or that are left out when it is written.
fn has_fields(raw: &Value, known: &Value, are_such: &dyn Fn(&Value) -> bool) -> bool {
    match (raw, known) {
        (Value::Object(raw), Value::Object(known)) => raw.iter().any(|(name, value)| {
            known.get(name).map_or_else(
                || are_such(value),
                |known| has_fields(value, known, are_such),
            )
        }),
        (Value::Array(raw), Value::Array(known)) => raw
            .iter()
            .zip(known)
            .any(|(raw, known)| has_fields(raw, known, are_such)),
        _ => false,
    }
}

/// Whether a value is one that fields have by default.
fn is_default(value: &Value) -> bool {
    *value == json!([])
        || *value == json!(false)
        || *value == json!(0)
        || *value == json!("achieve")
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
