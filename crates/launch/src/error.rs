//! Why work with processes fails.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use bus::BusError;
use config::FileError;
use record::RecordError;

/// Why a launch, a program as a robot, a play of faults, or certificates cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// A launch file, or what it names, cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder of a run cannot be used.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The network does not allow it, for example because of the certificates.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// It has been asked for what cannot be done.
    #[error("{reason}")]
    Refused {
        /// Why not.
        reason: String,
        /// What can be done instead.
        help: Option<&'static str>,
    },
    /// A tool of the system, such as `ip` or docker, is missing or has failed.
    #[error("{reason}")]
    Tool {
        /// The tool and what it said.
        reason: String,
        /// What to install, or what rights to have.
        help: Option<&'static str>,
    },
    /// A program cannot be started.
    #[error("{program} cannot be started")]
    NotStarted {
        /// The program.
        program: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A file or a folder cannot be made, written or removed.
    #[error("cannot {action} {}", path.display())]
    Path {
        /// What was tried: a verb.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The system does not give what every launch needs: threads, ports, signals, randomness.
    #[error("{what}")]
    System {
        /// What is not given.
        what: &'static str,
        /// The system's reason.
        source: Box<dyn Error + Send + Sync>,
    },
}

impl LaunchError {
    /// What a person can do about it. That of a file is shown with the file.
    #[must_use]
    pub fn help(&self) -> Option<&str> {
        match self {
            Self::Refused { help, .. } | Self::Tool { help, .. } => *help,
            Self::Record(error) => error.help(),
            _ => None,
        }
    }

    /// What cannot be done, and why.
    pub fn refused(reason: impl Into<String>) -> Self {
        Self::Refused {
            reason: reason.into(),
            help: None,
        }
    }

    /// What cannot be done, why, and what can be done instead.
    pub fn refused_with_help(reason: impl Into<String>, help: &'static str) -> Self {
        Self::Refused {
            reason: reason.into(),
            help: Some(help),
        }
    }

    /// Turns the system's reason into that of an action, a verb, on a file or folder.
    pub fn path(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Path {
            action,
            path,
            source,
        }
    }

    /// Turns the system's reason into that of something that every launch needs.
    pub fn system<E>(what: &'static str) -> impl FnOnce(E) -> Self
    where
        E: Into<Box<dyn Error + Send + Sync>>,
    {
        move |source| Self::System {
            what,
            source: source.into(),
        }
    }
}
