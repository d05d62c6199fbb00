//! One encode, one decode. JSON, because any language can speak it and people can read it.

use serde::{Serialize, de::DeserializeOwned};

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

/// A message of the contract: typed JSON plus the limits that JSON cannot say.
pub trait Message: Serialize + DeserializeOwned {
    /// Checks what the type cannot: finite numbers, bounded sizes.
    ///
    /// # Errors
    /// The path of the offending field and what is wrong with it.
    fn check(&self) -> Result<(), (String, String)> {
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
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let message: M = serde_path_to_error::deserialize(&mut json)
        .map_err(|error| malformed(error.path().to_string(), error.inner().to_string()))?;
    json.end()
        .map_err(|error| malformed(".".to_owned(), error.to_string()))?;
    message
        .check()
        .map_err(|(field, reason)| malformed(field, reason))?;
    Ok(message)
}
