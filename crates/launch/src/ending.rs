//! The end of processes as text and as exit status.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

use nix::sys::signal::Signal;

/// Exit status of shells where a command cannot be run.
const CANNOT_RUN: u8 = 126;
/// Exit status of a process killed by signal `n` is this number plus `n`, as in shells.
const SIGNALS: u8 = 128;

/// How a process ended.
#[derive(Debug)]
pub(crate) enum ProcessEnd {
    /// It has exited.
    Exited(ExitStatus),
    /// It could not be started, for this reason.
    NotStarted(String),
}

impl ProcessEnd {
    /// Whether it did not exit with status 0.
    pub(super) fn has_failed(&self) -> bool {
        !matches!(self, Self::Exited(status) if status.success())
    }

    /// The exit status that reports it: its own, or 128 plus its signal.
    pub(super) fn code(&self) -> u8 {
        let status = match self {
            Self::NotStarted(_) => return CANNOT_RUN,
            Self::Exited(status) => status,
        };

        if let Some(signal) = status.signal() {
            return SIGNALS.saturating_add(u8::try_from(signal).unwrap_or_default());
        }
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        code.unwrap_or(1)
    }
}

impl std::fmt::Display for ProcessEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let status = match self {
            Self::NotStarted(reason) => return write!(f, "did not start ({reason})"),
            Self::Exited(status) => status,
        };

        let code = status.code().unwrap_or_default();
        match status.signal().map(Signal::try_from) {
            Some(Ok(signal)) => write!(f, "was ended by {signal}"),
            Some(Err(_)) => write!(f, "was ended by a signal"),
            None => write!(f, "ended with exit status {code}"),
        }
    }
}

/// Exit status of a process that a signal has ended.
#[must_use]
pub fn code_of(signal: Signal) -> u8 {
    SIGNALS.saturating_add(u8::try_from(signal as i32).unwrap_or_default())
}
