//! Lines of the log.

use serde::{Deserialize, Serialize};

use super::limits::{MAX_LINE_BYTES, at_most, short};
use super::numbers::{Epoch, Tick};
use crate::codec::{FieldError, Message, as_json};
use crate::plain::cut;

/// The end of a line that is cut.
const ELLIPSIS: &str = "...";

/// One line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LogRecord {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Length of a tick, seconds, which decides about the decimals of the time; 0 if it is not known.
    #[serde(default)]
    pub tick_s: f64,
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
        at_most(MAX_LINE_BYTES, &self.text, "text")
    }
}

impl LogRecord {
    /// The record with a text that fits into a message: a longer one is cut, and says so.
    #[must_use]
    pub fn fitted(mut self) -> Self {
        if self.text.len() > MAX_LINE_BYTES {
            cut(&mut self.text, MAX_LINE_BYTES - ELLIPSIS.len());
            self.text.push_str(ELLIPSIS);
        }
        self
    }
}

/// Kinds of log lines, to filter by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// A robot said something, or the simulator warns of what a robot does.
    Say,
    /// A robot changed a site, or was refused to.
    Site,
    /// A robot changed a layer, or was refused to.
    Layer,
    /// It was decided whether an expectation is met.
    Verdict,
    /// The clock waits; wall-clock matter, not part of the run's record.
    Late,
}
