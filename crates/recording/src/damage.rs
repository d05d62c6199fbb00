//! Why a recording cannot be read.

use std::fmt::Display;
use std::io;
use std::path::Path;

use protocol::Tick;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The operating system does not let it be read.
    #[error("cannot read {file}: {error}")]
    Unreadable {
        /// The file.
        file: String,
        /// The operating system's reason.
        error: io::Error,
    },
    /// It is not what was written.
    #[error("{file}: damaged at byte {offset}: {reason}")]
    Damaged {
        /// The file.
        file: String,
        /// Where the part that is damaged begins, bytes.
        offset: u64,
        /// What is wrong.
        reason: String,
    },
    /// It has no header: the simulator was killed before it wrote one, or it is another kind of file.
    #[error("{file} is not a recording of a run, or its beginning was never written")]
    Headless {
        /// The file.
        file: String,
    },
    /// It does not have a tick that was asked for.
    #[error("{file} has ticks up to {last}, and not tick {tick}")]
    NoSuchTick {
        /// The file.
        file: String,
        /// The tick.
        tick: Tick,
        /// Its last tick.
        last: Tick,
    },
}

/// A file whose errors name it.
#[derive(Debug, Clone)]
pub(crate) struct Name(String);

impl Name {
    pub(crate) fn of(path: &Path) -> Self {
        Self(path.display().to_string())
    }

    pub(crate) fn unreadable(&self, error: io::Error) -> RecordingError {
        RecordingError::Unreadable {
            file: self.0.clone(),
            error,
        }
    }

    pub(crate) fn damaged(&self, offset: u64, reason: &dyn Display) -> RecordingError {
        RecordingError::Damaged {
            file: self.0.clone(),
            offset,
            reason: reason.to_string(),
        }
    }

    pub(crate) fn headless(&self) -> RecordingError {
        RecordingError::Headless {
            file: self.0.clone(),
        }
    }

    pub(crate) fn no_such_tick(&self, tick: Tick, len: u64) -> RecordingError {
        RecordingError::NoSuchTick {
            file: self.0.clone(),
            tick,
            last: len.saturating_sub(1),
        }
    }
}
