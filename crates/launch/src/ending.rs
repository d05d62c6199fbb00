//! The end of processes as text and as exit status.

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;

use nix::sys::signal::Signal;
use serde::Serialize;

use simulator::program::ADDRESS_TAKEN;

use super::file::SIMULATOR;
use super::plan::FAILED;

/// Exit status of shells where a command cannot be run.
const CANNOT_RUN: u8 = 126;
/// Exit status of a process killed by signal `n` is this number plus `n`, as in shells.
const SIGNALS: u8 = 128;

/// How a process ended.
#[derive(Debug)]
pub(crate) enum Ended {
    /// It has exited.
    Exited(ExitStatus),
    /// It could not be started, for this reason.
    NotStarted(String),
}

impl Ended {
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

impl std::fmt::Display for Ended {
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

/// A failure that ended a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    /// Name of the process.
    pub process: String,
    /// Name of the process and how it ended.
    pub text: String,
    /// Exit status of the launch.
    pub code: u8,
    /// The last lines of the process's error output.
    pub tail: Vec<String>,
    /// Path of the process's log.
    pub log: PathBuf,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "error: {}", self.text)?;
        match self.tail.len() {
            0 => writeln!(f, "it wrote no errors")?,
            _ => writeln!(f, "the last lines that it wrote as errors:")?,
        }
        for line in &self.tail {
            writeln!(f, "  {line}")?;
        }
        write!(f, "its log: {}", self.log.display())
    }
}

/// What the console is told of a failure that ended a run.
#[derive(Debug, Serialize)]
struct Shown<'a> {
    text: &'a str,
    lines: &'a [String],
    log: &'a Path,
    command: String,
}

impl Failure {
    /// Whether the simulator could not listen where another process does: the launch is tried at another port.
    pub(super) fn is_port_taken(&self) -> bool {
        self.process == SIMULATOR && self.code == ADDRESS_TAKEN
    }

    /// Leaves the failure for the console, among the logs of the run, which is resumed by `command`.
    pub(super) fn show(&self, logs: &Path, command: String) -> std::io::Result<()> {
        let shown = Shown {
            text: &self.text,
            lines: &self.tail,
            log: &self.log,
            command,
        };
        let text = serde_json::to_vec(&shown)?;

        // The console must not read a part of it.
        let file = logs.join(FAILED);
        let unfinished = file.with_extension("new");
        std::fs::write(&unfinished, text)?;
        std::fs::rename(unfinished, file)
    }
}

/// Exit status of a process that a signal has ended.
#[must_use]
pub fn code_of(signal: Signal) -> u8 {
    SIGNALS.saturating_add(u8::try_from(signal as i32).unwrap_or_default())
}
