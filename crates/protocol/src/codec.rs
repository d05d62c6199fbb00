//! One encode, one decode. JSON, because any language can speak it and people can read it.

use serde::{Deserialize, Serialize};

use crate::path;
use crate::plain::cut;

/// Largest message that is accepted, in bytes.
pub const MAX_MESSAGE_BYTES: usize = 1 << 20;

/// A message that could not be understood: which key, whose, which field, why. It changes nothing at the receiver.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("malformed message on {key} from {sender}: field {field}: {reason}")]
pub struct Malformed {
    /// Key on which it came.
    pub key: String,
    /// Who sent it, as far as the key tells.
    pub sender: String,
    /// Path of the field that is wrong, `.` for the whole message.
    pub field: String,
    /// What is wrong with it.
    pub reason: String,
}

/// A field that is wrong, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FieldError {
    /// Path of the field: `command`, `robots.Butler`, `setup.obstacles`.
    pub field: String,
    /// What is wrong with it, and what would be right.
    pub reason: String,
}

impl FieldError {
    /// The error `reason` about the field at path `field`.
    #[must_use]
    pub fn new(field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            reason: reason.into(),
        }
    }
}

/// A message of the contract: typed JSON plus the limits that JSON cannot say.
///
/// Reading and writing a type takes much code. `as_json!` makes methods of each message that are compiled once, in this crate,
/// instead of in every crate that calls [`encode`] or [`decode`].
pub trait Message: Sized {
    /// Writes the message.
    fn to_json(&self) -> Vec<u8>;

    /// Reads a message, unchecked. Unknown fields are ignored.
    ///
    /// # Errors
    /// What is wrong with the JSON.
    fn from_json(json: &[u8]) -> Result<Self, serde_json::Error>;

    /// Checks what the type cannot: finite numbers, bounded sizes.
    ///
    /// # Errors
    /// The path of the offending field and what is wrong with it.
    fn check(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

/// The methods of [`Message`] that read and write JSON.
macro_rules! as_json {
    () => {
        fn to_json(&self) -> Vec<u8> {
            $crate::codec::write(self)
        }

        fn from_json(json: &[u8]) -> Result<Self, serde_json::Error> {
            serde_json::from_slice(json)
        }
    };
}

pub(crate) use as_json;

/// Writes a message.
#[must_use]
pub fn encode<M: Message>(message: &M) -> Vec<u8> {
    message.to_json()
}

pub(crate) fn write(message: &impl Serialize) -> Vec<u8> {
    // Messages are structs of numbers, strings and maps with string keys: there is no value of theirs that JSON
    // cannot write.
    serde_json::to_vec(message)
        .unwrap_or_else(|error| unreachable!("a message is always JSON: {error}"))
}

fn shortened(mut text: String) -> String {
    const MAX_BYTES: usize = 500;
    if cut(&mut text, MAX_BYTES) {
        text += "...";
    }
    text
}

/// Reads a message that came on `key`. Unknown fields are ignored.
///
/// # Errors
/// [`Malformed`] names key, sender, field and reason.
pub fn decode<M: Message>(key: &str, sender: &str, bytes: &[u8]) -> Result<M, Malformed> {
    // What is wrong may repeat what was sent, and that may be long.
    let malformed = |field: String, reason: String| Malformed {
        key: key.to_owned(),
        sender: sender.to_owned(),
        field: shortened(field),
        reason: shortened(reason),
    };
    if bytes.len() > MAX_MESSAGE_BYTES {
        let reason = format!(
            "{} bytes, more than the {MAX_MESSAGE_BYTES} allowed",
            bytes.len()
        );
        return Err(malformed(".".to_owned(), reason));
    }

    let message = M::from_json(bytes)
        .map_err(|error| malformed(path::of(&error, bytes), error.to_string()))?;

    // The types also read a list, as their fields in order.
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    if first == Some(&b'[') {
        let reason = "a list; a message is a JSON object".to_owned();
        return Err(malformed(".".to_owned(), reason));
    }

    message
        .check()
        .map_err(|FieldError { field, reason }| malformed(field, reason))?;
    Ok(message)
}
