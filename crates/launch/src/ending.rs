//! How processes end, in words and in numbers.

use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::ExitStatus;

use nix::sys::signal::Signal;

/// Exit status of shells where a command cannot be run.
const CANNOT_RUN: u8 = 126;
/// Exit statuses above this one name signals.
const SIGNALS: u8 = 128;

/// How a process ended.
#[derive(Debug)]
pub(crate) enum Ended {
    /// It ran and is over.
    Exited(ExitStatus),
    /// It never ran; the reason.
    NotStarted(String),
}

impl Ended {
    /// Whether it ended other than with exit status 0.
    pub(super) fn has_failed(&self) -> bool {
        !matches!(self, Self::Exited(status) if status.success())
    }

    /// The exit status that says so: its own, or 128 and its signal.
    pub(super) fn code(&self) -> u8 {
        match self {
            Self::NotStarted(_) => CANNOT_RUN,
            Self::Exited(status) => {
                let signal = status.signal().and_then(|signal| u8::try_from(signal).ok());
                let own = status.code().and_then(|code| u8::try_from(code).ok());
                signal
                    .map(|signal| SIGNALS.saturating_add(signal))
                    .or(own)
                    .unwrap_or(1)
            }
        }
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotStarted(reason) => write!(f, "did not start ({reason})"),
            Self::Exited(status) => match status.signal().map(Signal::try_from) {
                Some(Ok(signal)) => write!(f, "was ended by {signal}"),
                Some(Err(_)) => write!(f, "was ended by a signal"),
                None => write!(
                    f,
                    "ended with exit status {}",
                    status.code().unwrap_or_default()
                ),
            },
        }
    }
}

/// A failure that ended a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    /// Who failed, and how.
    pub text: String,
    /// Exit status of the launch.
    pub code: u8,
    /// The last lines of its error output.
    pub tail: Vec<String>,
    /// Its log.
    pub log: PathBuf,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "error: {}", self.text)?;
        match self.tail.len() {
            0 => writeln!(f, "it wrote no errors")?,
            _ => writeln!(f, "the last lines that it wrote as errors:")?,
        }
        self.tail
            .iter()
            .try_for_each(|line| writeln!(f, "  {line}"))?;
        write!(f, "its log: {}", self.log.display())
    }
}

/// Exit status of a process that was asked to end by a signal.
#[must_use]
pub fn code_of(signal: Signal) -> u8 {
    SIGNALS.saturating_add(u8::try_from(signal as i32).unwrap_or_default())
}
