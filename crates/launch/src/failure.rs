//! The failure that ended a run, for people at the terminal and in the console.

use std::path::{Path, PathBuf};

use record::folder::FAILED;
use serde::Serialize;
use terminal::ADDRESS_TAKEN;

use super::file::SIMULATOR;

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
    /// Path of the process's log, if it is kept.
    pub log: Option<PathBuf>,
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
        match &self.log {
            Some(log) => write!(f, "its log: {}", log.display()),
            None => Ok(()),
        }
    }
}

/// What the console is told of a failure that ended a run.
#[derive(Debug, Serialize)]
struct FailureMessage<'a> {
    text: &'a str,
    lines: &'a [String],
    log: Option<&'a Path>,
    command: String,
}

impl Failure {
    /// Whether the simulator could not listen where another process does: the launch is tried at another port.
    pub(super) fn is_port_taken(&self) -> bool {
        self.process == SIMULATOR && self.code == ADDRESS_TAKEN
    }

    /// Leaves the failure for the console, among the logs of the run, which is resumed by `command`.
    pub(super) fn show(&self, logs: &Path, command: String) -> std::io::Result<()> {
        let shown = FailureMessage {
            text: &self.text,
            lines: &self.tail,
            log: self.log.as_deref(),
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
