//! Why a run has failed: its launcher leaves the reason in a file, and pages show it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Why a run has failed, as its launcher says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Failed {
    /// Which process has failed, and how it ended.
    text: String,
    /// The last lines that it wrote as errors.
    lines: Vec<String>,
    /// Its log.
    log: PathBuf,
    /// The command by which the run goes on.
    command: String,
}

impl Failed {
    /// `None` while there is no such file. It appears as a whole.
    pub(crate) fn read(file: &Path) -> Option<Self> {
        let text = std::fs::read(file).ok()?;
        match serde_json::from_slice(&text) {
            Ok(failed) => Some(failed),
            Err(error) => {
                tracing::warn!("{}: {error}", file.display());
                None
            }
        }
    }
}
