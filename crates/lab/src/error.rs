//! Why something cannot be done with runs.

use std::error::Error;
use std::fmt::Display;
use std::io;
use std::path::Path;

use config::FileError;
use record::RecordError;
use recording::RecordingError;
use robot::RobotError;

/// Why something cannot be done with runs, one or many.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// A file that a person has written cannot be used, or a file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder of a run cannot be used, or the record of a run or an experiment is damaged, incomplete, or not there.
    #[error(transparent)]
    Record(RecordError),
    /// A robot ends the run, or refuses its parameters.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// What was asked for cannot be done, or not with this scenario or this record.
    #[error("{reason}")]
    Refused {
        /// Why not.
        reason: String,
        /// What can be done instead.
        help: Option<String>,
    },
    /// Something failed while it was done, such as a launch or a call of the operating system.
    #[error(transparent)]
    Failed(Box<dyn Error + Send + Sync>),
    /// The caller has ended it.
    #[error("interrupted")]
    Interrupted,
}

impl LabError {
    /// The error of a record that is damaged, incomplete, or not there.
    pub fn record(reason: impl Into<String>) -> Self {
        Self::Record(RecordError::unusable(reason.into()))
    }

    /// The error of a part of a record that cannot be read.
    pub(crate) fn unreadable(path: &Path) -> impl Fn(io::Error) -> Self {
        move |error| Self::Record(RecordError::unreadable(path, &error))
    }

    /// The error of a request that cannot be met.
    pub fn refused(reason: impl Display) -> Self {
        Self::Refused {
            reason: reason.to_string(),
            help: None,
        }
    }

    /// The error of something that failed while it was done.
    pub fn failed(reason: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Failed(reason.into())
    }

    /// The error with what can be done about it, unless nothing can.
    #[must_use]
    pub fn with_help(self, text: impl Into<String>) -> Self {
        match self {
            Self::File(error) => Self::File(error.with_help(text)),
            Self::Record(error) => Self::Record(error.with_help(text)),
            Self::Refused { reason, .. } => Self::Refused {
                reason,
                help: Some(text.into()),
            },
            Self::Robot(_) | Self::Failed(_) | Self::Interrupted => self,
        }
    }

    /// The file that the error is about: it is shown with its place and its help.
    #[must_use]
    pub fn file(&self) -> Option<&FileError> {
        match self {
            Self::File(error) => Some(error),
            _ => None,
        }
    }

    /// What can be done about it. That of a file is shown with the file.
    #[must_use]
    pub fn help(&self) -> Option<&str> {
        match self {
            Self::Refused { help, .. } => help.as_deref(),
            Self::Record(error) => error.help(),
            _ => None,
        }
    }
}

impl From<RecordError> for LabError {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Scenario(error) => Self::File(error),
            error => Self::Record(error),
        }
    }
}

impl From<RecordingError> for LabError {
    fn from(error: RecordingError) -> Self {
        Self::record(error.to_string())
    }
}
