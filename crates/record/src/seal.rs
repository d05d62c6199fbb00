//! Seals of a record: at the end of each tick a file of lines states what its bytes before that line are, so that a reader
//! finds damage.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use protocol::Tick;
use protocol::event::{Event, Line};
use protocol::messages::End;
use xxhash_rust::xxh3::Xxh3;

use crate::error::RecordError;

/// What a seal begins with, in the last field of a line.
const FIELD: &[u8] = b",\"seal\":\"";
/// Hexadecimal digits of a seal.
const DIGITS: usize = 16;
/// Bytes from the beginning of a seal to the end of its line.
const TAIL: usize = FIELD.len() + DIGITS + 2;

/// Most bytes of a line; no event is nearly as long.
const MAX_LINE: u64 = 1024 * 1024;

/// Digest of all lines of a file so far.
#[derive(Clone, Default)]
pub struct Seal {
    hash: Xxh3,
}

impl Seal {
    /// Adds a line, which has no line break at its end.
    pub fn add(&mut self, line: &[u8]) {
        self.hash.update(line);
        self.hash.update(b"\n");
    }

    /// The seal of the lines so far and of the beginning of the next one, a JSON object that is closed here.
    fn of(&self, line: &[u8]) -> String {
        // The digest so far is kept: the line itself is added when it has its seal.
        let mut hash = self.hash.clone();
        hash.update(line);
        hash.update(b"}");
        format!("{:0DIGITS$x}", hash.digest())
    }

    /// Seals a line, which is a JSON object.
    pub fn seal(&self, line: &str) -> String {
        let body = line.strip_suffix('}').unwrap_or(line);
        format!("{body},\"seal\":\"{}\"}}", self.of(body.as_bytes()))
    }

    /// Whether a line has the right seal; `None` if it has none.
    fn is_right(&self, line: &[u8]) -> Option<bool> {
        let (body, tail) = line.split_at_checked(line.len().checked_sub(TAIL)?)?;
        let stated = tail.strip_prefix(FIELD)?.get(..DIGITS)?;
        Some(stated == self.of(body).as_bytes())
    }
}

/// Name of the field with the seal of a JSON text.
const SEAL: &str = "seal";

/// The seal of a JSON text that has no seal yet: that of its values, however they are laid out.
pub(crate) fn of_json(value: &serde_json::Value) -> String {
    let mut hash = Xxh3::new();
    hash.update(value.to_string().as_bytes());
    format!("{:0DIGITS$x}", hash.digest())
}

/// A JSON object as a text with a seal.
///
/// # Errors
/// If it cannot be JSON.
pub fn sealed_text(object: &impl serde::Serialize) -> Result<String, serde_json::Error> {
    let mut value = serde_json::to_value(object)?;
    let seal = of_json(&value);
    if let Some(fields) = value.as_object_mut() {
        fields.insert(SEAL.to_owned(), seal.into());
    }
    serde_json::to_string_pretty(&value)
}

/// Whether a value has the form of a seal.
fn is_like_seal(value: &serde_json::Value) -> bool {
    let text = value.as_str().unwrap_or_default();
    text.len() == of_json(&serde_json::Value::Null).len()
        && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Whether a text of [`sealed_text`] is as it was written; `None` if it has no seal.
#[must_use]
pub fn is_sealed_text_right(text: &str) -> Option<bool> {
    let Ok(mut value) = serde_json::from_str::<serde_json::Value>(text) else {
        return Some(false);
    };
    let laid_out = serde_json::to_string_pretty(&value).ok()?;
    let object = value.as_object_mut()?;
    let Some(stated) = object.remove(SEAL) else {
        // Its name may be what is damaged.
        let has_seal = object.values().any(is_like_seal);
        return has_seal.then_some(false);
    };
    Some(stated == of_json(&value) && text.strip_suffix('\n') == Some(laid_out.as_str()))
}

/// What a file of events is, as far as it is undamaged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checked {
    /// Lines up to the last one with a seal.
    pub lines: usize,
    /// The last complete tick.
    pub tick: Tick,
    /// How the run has ended, if it has ended in order.
    pub end: Option<End>,
    /// The digest with which it has ended.
    pub digest: Option<String>,
    /// Lines after the last seal, of a tick that was never completed: the simulator was killed, or the run is in progress.
    pub incomplete_lines: usize,
}

/// The lines of a file of events, not decoded.
pub(crate) struct RawLines {
    path: PathBuf,
    reader: BufReader<File>,
}

/// A line of a file.
pub(crate) struct RawLine {
    /// Its bytes, without its end.
    pub(crate) bytes: Vec<u8>,
    /// Whether it has an end. Otherwise the simulator was about to write it, or it is too long.
    pub(crate) is_whole: bool,
}

impl RawLine {
    /// Whether it is longer than any event.
    pub(crate) fn is_too_long(&self) -> bool {
        !self.is_whole && self.bytes.len() as u64 == MAX_LINE
    }
}

impl RawLines {
    /// Opens a file.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be read.
    pub(crate) fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(|error| RecordError::unreadable(path, &error))?;
        Ok(Self {
            path: path.to_owned(),
            reader: BufReader::new(file),
        })
    }

    /// The next line; `None` at the end of the file.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be read.
    pub(crate) fn next(&mut self) -> Result<Option<RawLine>, RecordError> {
        let mut bytes = Vec::new();
        let count = (&mut self.reader)
            // A file without line breaks must not be read into memory as one line.
            .take(MAX_LINE)
            .read_until(b'\n', &mut bytes)
            .map_err(|error| RecordError::unreadable(&self.path, &error))?;
        if count == 0 {
            return Ok(None);
        }

        let is_whole = bytes.pop_if(|byte| *byte == b'\n').is_some();
        Ok(Some(RawLine { bytes, is_whole }))
    }
}

/// Reads a file of events and compares it with its seals.
///
/// # Errors
/// [`RecordError`] if the file cannot be read, or names the first lines that are damaged.
pub fn check(path: &Path) -> Result<Checked, RecordError> {
    let mut lines = RawLines::open(path)?;
    let mut checked = Checked {
        lines: 0,
        tick: 0,
        end: None,
        digest: None,
        incomplete_lines: 0,
    };
    let mut seal = Seal::default();
    while let Some(raw) = lines.next()? {
        if checked.end.is_some() {
            return Err(damaged(
                path,
                &checked,
                "something follows the end of the run",
            ));
        }

        checked.incomplete_lines += 1;
        if raw.is_too_long() {
            return Err(damaged(path, &checked, "the last of them is too long"));
        }
        if !raw.is_whole {
            return Ok(checked); // A line that the simulator was about to write.
        }
        let Ok(line) = Line::from_json(&raw.bytes) else {
            return Err(damaged(path, &checked, "the last of them is not an event"));
        };
        if line.event.is_sealed() {
            if seal.is_right(&raw.bytes) != Some(true) {
                return Err(damaged(path, &checked, "they are not what was written"));
            }
            checked.lines += std::mem::take(&mut checked.incomplete_lines);
            checked.tick = line.tick;
            if let Event::End { reason, digest, .. } = line.event {
                checked.end = Some(reason);
                checked.digest = Some(digest);
            }
        }
        seal.add(&raw.bytes);
    }
    Ok(checked)
}

fn damaged(path: &Path, checked: &Checked, reason: &str) -> RecordError {
    let first = checked.lines + 1;
    let last = checked.lines + checked.incomplete_lines.max(1);
    let place = path.display();
    RecordError::unusable(format!(
        "{place}: lines {first} to {last} are damaged: {reason}"
    ))
    .with_help(format!(
        "the record is good up to the end of tick {}; execute the run again from its scenario.toml",
        checked.tick
    ))
}
