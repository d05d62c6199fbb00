//! One encode, one decode. JSON, because any language can speak it and people can read it.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

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
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
pub trait Message: Serialize + DeserializeOwned {
    /// Checks what the type cannot: finite numbers, bounded sizes.
    ///
    /// # Errors
    /// The path of the offending field and what is wrong with it.
    fn check(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

/// Writes a message.
#[must_use]
pub fn encode<M: Message>(message: &M) -> Vec<u8> {
    // Messages are structs of numbers, strings and maps with string keys: there is no value of theirs that JSON
    // cannot write.
    serde_json::to_vec(message)
        .unwrap_or_else(|error| unreachable!("a message is always JSON: {error}"))
}

fn shortened(mut text: String) -> String {
    const MAX_BYTES: usize = 500;
    if text.len() > MAX_BYTES {
        text.truncate(
            (0..=MAX_BYTES)
                .rev()
                .find(|at| text.is_char_boundary(*at))
                .unwrap_or(0),
        );
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

    let message: M = match serde_json::from_slice(bytes) {
        Ok(message) => message,
        Err(_) => return Err(explain::<M>(bytes, malformed)),
    };
    message
        .check()
        .map_err(|FieldError { field, reason }| malformed(field, reason))?;
    Ok(message)
}

/// Reads a message that is known to be malformed once more, to find the path of the field that is wrong.
fn explain<M: Message>(bytes: &[u8], malformed: impl Fn(String, String) -> Malformed) -> Malformed {
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let read: Result<M, _> = serde_path_to_error::deserialize(&mut json);
    let after = read.map(|_| json.end());

    match after {
        Err(error) => malformed(error.path().to_string(), error.inner().to_string()),
        Ok(Err(error)) => malformed(".".to_owned(), error.to_string()),
        Ok(Ok(())) => malformed(".".to_owned(), "not valid JSON".to_owned()),
    }
}
