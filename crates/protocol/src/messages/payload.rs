//! What a command carries beside its name: one JSON value.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

#[cfg(test)]
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use crate::codec::FieldError;

/// Largest payload, in bytes of its canonical JSON.
pub const MAX_PAYLOAD_BYTES: usize = 64 * 1024;
/// Most lists and objects of a payload within one another.
pub const MAX_PAYLOAD_DEPTH: usize = 64;

/// The payload of a command: any JSON value but `null`, which means that there is none. Copies share it.
///
/// Its canonical JSON is what it is compared and measured by: without spaces, the fields of objects in the order of their
/// names, each number with the fewest digits that give it back to the last bit, texts as they are. Numbers are integers of 64 bits or
/// else floating point numbers, as everywhere in the contract.
///
/// ```
/// # use protocol::messages::Payload;
/// let bid = Payload::new(serde_json::json!({ "task": 3, "bid": 0.1 })).expect("not null");
/// assert_eq!(bid.as_json(), r#"{"bid":0.1,"task":3}"#);
/// ```
#[derive(Clone)]
pub struct Payload(Arc<PayloadContent>);

struct PayloadContent {
    value: Value,
    json: String,
}

impl Payload {
    /// The payload of this value; `None` for `null`.
    #[must_use]
    pub fn new(value: Value) -> Option<Self> {
        if value.is_null() {
            return None;
        }

        let json = value.to_string();
        Some(Self(Arc::new(PayloadContent { value, json })))
    }

    /// The payload that a value is in JSON.
    ///
    /// # Errors
    /// What JSON has no way to write: a map whose keys are no texts.
    pub fn of(value: &impl Serialize) -> Result<Option<Self>, serde_json::Error> {
        serde_json::to_value(value).map(Self::new)
    }

    /// The value.
    #[must_use]
    pub fn value(&self) -> &Value {
        &self.0.value
    }

    /// Its canonical JSON.
    #[must_use]
    pub fn as_json(&self) -> &str {
        &self.0.json
    }

    /// Reads it as a type of its receiver.
    ///
    /// # Errors
    /// What does not fit.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, serde_json::Error> {
        T::deserialize(&self.0.value)
    }

    /// Refuses what is beyond the limits; `field` is the path of the payload in the message.
    ///
    /// # Errors
    /// What is too much, and the limit.
    pub fn check(&self, field: &str) -> Result<(), FieldError> {
        let length = self.0.json.len();
        if length > MAX_PAYLOAD_BYTES {
            let reason =
                format!("{length} bytes of JSON, more than the {MAX_PAYLOAD_BYTES} allowed");
            return Err(FieldError::new(field, reason));
        }
        if is_deeper(&self.0.value, MAX_PAYLOAD_DEPTH) {
            let reason =
                format!("more than {MAX_PAYLOAD_DEPTH} lists and objects within one another");
            return Err(FieldError::new(field, reason));
        }

        Ok(())
    }
}

/// Whether a value has more than `levels` lists and objects within one another.
fn is_deeper(value: &Value, levels: usize) -> bool {
    let is_too_deep = |inner| levels == 0 || is_deeper(inner, levels - 1);

    match value {
        Value::Array(items) => levels == 0 || items.iter().any(is_too_deep),
        Value::Object(fields) => levels == 0 || fields.values().any(is_too_deep),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
    }
}

impl fmt::Debug for Payload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.json)
    }
}

impl PartialEq for Payload {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0.json == other.0.json
    }
}

impl Eq for Payload {}

impl PartialOrd for Payload {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Payload {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.json.cmp(&other.0.json)
    }
}

impl Hash for Payload {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.json.hash(state);
    }
}

impl Serialize for Payload {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.value.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Payload {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        Self::new(value).ok_or_else(|| serde::de::Error::custom("null is no payload"))
    }
}

#[cfg(test)]
impl JsonSchema for Payload {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Payload".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The payload of a command: any JSON value, of at most 65536 bytes.",
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn payload(value: Value) -> Payload {
        Payload::new(value).expect("not null")
    }

    #[test]
    fn a_payload_keeps_its_numbers_to_the_last_bit() {
        for number in [0.1 + 0.2, f64::MIN_POSITIVE, 5e-324, -0.0, 1e300, f64::MAX] {
            let sent = payload(json!([number]));
            let read: Payload = serde_json::from_str(sent.as_json()).unwrap();
            assert_eq!(read, sent);
            let [kept]: [f64; 1] = read.read().unwrap();
            assert_eq!(kept.to_bits(), number.to_bits());
        }
        let integers = json!([u64::MAX, i64::MIN, 9_007_199_254_740_993_i64]);
        let text = "[18446744073709551615,-9223372036854775808,9007199254740993]";
        assert_eq!(payload(integers).as_json(), text);
    }

    #[test]
    fn the_order_of_fields_and_spaces_do_not_count() {
        let one: Payload = serde_json::from_str("{ \"b\": 1.50,\n\"a\": \"\\u00e9\" }").unwrap();
        let other: Payload = serde_json::from_str("{\"a\":\"é\",\"b\":1.5}").unwrap();
        assert_eq!(one, other);
        assert_eq!(one.as_json(), "{\"a\":\"é\",\"b\":1.5}");
    }

    #[test]
    fn a_payload_has_a_size_and_a_depth() {
        // With its quotation marks.
        let text = |bytes: usize| payload(Value::String("x".repeat(bytes - 2)));
        assert_eq!(text(MAX_PAYLOAD_BYTES).check("payload"), Ok(()));
        let error = text(MAX_PAYLOAD_BYTES + 1).check("payload").unwrap_err();
        assert_eq!(
            error.reason,
            "65537 bytes of JSON, more than the 65536 allowed"
        );

        let nested = |depth| payload((0..depth).fold(json!(1), |inner, _| json!([inner])));
        assert_eq!(nested(MAX_PAYLOAD_DEPTH).check("payload"), Ok(()));
        let error = nested(MAX_PAYLOAD_DEPTH + 1).check("payload").unwrap_err();
        assert_eq!(
            error.reason,
            "more than 64 lists and objects within one another"
        );
    }

    #[test]
    fn null_is_no_payload() {
        assert_eq!(Payload::new(Value::Null), None);
        assert!(Payload::new(json!(false)).is_some());
        assert!(Payload::new(json!({ "inner": null })).is_some());
    }
}
