//! Limits of the fields of messages, the checks of them, and the defaults that are left out.

use serde::{Deserialize, Deserializer};

use super::numbers::Tick;
use crate::codec::FieldError;
use crate::plain::cut;

/// Longest text in a message, in bytes: a command, a state's name, a log line.
pub const MAX_TEXT_BYTES: usize = 4096;
/// Longest line of the log, in bytes: an event tells of at most two texts, in its own words.
pub const MAX_LINE_BYTES: usize = 4 * MAX_TEXT_BYTES;
/// Most entries of any list or map in a message.
pub const MAX_ENTRIES: usize = 1024;

/// Refuses NaN and the infinities.
pub(super) fn finite(value: f64, field: &str) -> Result<(), FieldError> {
    if value.is_finite() {
        return Ok(());
    }

    Err(FieldError::new(field, "not a finite number"))
}

/// Ticks stay below 2^53, so that every language can hold them and add to them exactly.
pub(super) fn counted(tick: Tick, field: &str) -> Result<(), FieldError> {
    if tick < 1 << 53 {
        return Ok(());
    }

    Err(FieldError::new(field, "not below 2^53"))
}

/// Refuses a text above [`MAX_TEXT_BYTES`].
pub(super) fn short(text: &str, field: &str) -> Result<(), FieldError> {
    at_most(MAX_TEXT_BYTES, text, field)
}

/// Refuses a text of more bytes.
pub(super) fn at_most(max_bytes: usize, text: &str, field: &str) -> Result<(), FieldError> {
    if text.len() <= max_bytes {
        return Ok(());
    }

    let reason = format!(
        "{} bytes of text, more than the {max_bytes} allowed",
        text.len()
    );
    Err(FieldError::new(field, reason))
}

/// Refuses a list or map above [`MAX_ENTRIES`].
pub(super) fn few(len: usize, field: &str) -> Result<(), FieldError> {
    if len <= MAX_ENTRIES {
        return Ok(());
    }

    let reason = format!("{len} entries, more than the {MAX_ENTRIES} allowed");
    Err(FieldError::new(field, reason))
}

/// Reads lines of a robot's log, within the limits: how much a robot has to say never decides whether it has answered.
pub(super) fn log_lines<'de, D: Deserializer<'de>>(reader: D) -> Result<Vec<String>, D::Error> {
    let mut lines = Vec::<String>::deserialize(reader)?;
    lines.truncate(MAX_ENTRIES);
    for line in &mut lines {
        cut(line, MAX_TEXT_BYTES);
    }
    Ok(lines)
}

/// Whether a flag has its default and is left out of a message.
pub(crate) fn is_false(flag: &bool) -> bool {
    !*flag
}

/// Whether a number has its default and is left out of a message.
pub(super) fn is_zero(number: &u32) -> bool {
    *number == 0
}
