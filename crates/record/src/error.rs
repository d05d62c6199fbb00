//! Why the folder of a run, or the record in it, cannot be used.

use std::fmt::Display;
use std::io;
use std::path::Path;

use config::FileError;
use protocol::plain::escape_text;

/// Why the folder of a run, or the record in it, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder cannot be made, taken or written.
    #[error("{reason}")]
    Folder {
        /// Why not.
        reason: String,
        /// What can be done about it.
        help: Option<String>,
    },
    /// The record is damaged, incomplete, or not there.
    #[error("{reason}")]
    Unusable {
        /// Why it cannot be used.
        reason: String,
        /// What can be done about it.
        help: Option<String>,
    },
    /// The scenario of the run cannot be written.
    #[error(transparent)]
    Scenario(#[from] FileError),
}

impl RecordError {
    /// The error of a folder that cannot be made, taken or written.
    pub fn folder(reason: impl Display) -> Self {
        Self::Folder {
            reason: escape_text(&reason.to_string()),
            help: None,
        }
    }

    /// The error of a record that is damaged, incomplete, or not there.
    pub fn unusable(reason: impl Display) -> Self {
        Self::Unusable {
            reason: escape_text(&reason.to_string()),
            help: None,
        }
    }

    /// The error of a part of a record that cannot be read.
    #[must_use]
    pub fn unreadable(path: &Path, error: &io::Error) -> Self {
        Self::unusable(format!("cannot read {}: {error}", path.display()))
    }

    /// The error with what can be done about it.
    #[must_use]
    pub fn with_help(mut self, text: impl Into<String>) -> Self {
        match &mut self {
            Self::Folder { help, .. } | Self::Unusable { help, .. } => {
                *help = Some(escape_text(&text.into()));
            }
            Self::Scenario(_) => {}
        }
        self
    }

    /// What can be done about it.
    #[must_use]
    pub fn help(&self) -> Option<&str> {
        match self {
            Self::Folder { help, .. } | Self::Unusable { help, .. } => help.as_deref(),
            Self::Scenario(_) => None,
        }
    }
}
