//! Lines of the log.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::short;
use super::numbers::{Epoch, Tick};
use crate::codec::{FieldError, Message, as_json};

/// One line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogRecord {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// A robot's name, or `simulator`.
    pub source: String,
    /// What kind of line it is.
    pub kind: LogKind,
    /// The line.
    pub text: String,
}

impl Message for LogRecord {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        short(&self.source, "source")?;
        short(&self.text, "text")
    }
}

/// Kinds of log lines, to filter by.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum LogKind {
    /// Init, start, pause, stop, end.
    Run,
    /// A robot joined, was lost, came back.
    Membership,
    /// An emotion changed.
    Emotion,
    /// A behavior changed.
    Behavior,
    /// A command was sent, delivered, dropped or is missing.
    Command,
    /// The medium cut a link, or healed it.
    Network,
    /// A robot said something.
    Say,
    /// It was decided whether an expectation is met.
    Verdict,
    /// The clock waits; wall-clock matter, not part of the run's record.
    Late,
}
