//! Where results come from: the only file of an experiment's folder that differs between equal experiments.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use config::FileError;
use serde::{Deserialize, Serialize};

use super::plan::ProgramVersion;

/// The provenance in the folder of an experiment.
pub(super) const PROVENANCE: &str = "provenance.json";

/// Which command wrote results, and where.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// The program.
    #[serde(flatten)]
    pub program: ProgramVersion,
    /// Its arguments, after its name.
    pub command: Vec<String>,
    /// When the results were written, seconds since 1970 (UTC).
    pub written_unix_s: u64,
    /// The machine.
    pub machine: Machine,
}

/// A machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Its name, if it is known.
    pub host: Option<String>,
    /// Its operating system.
    pub os: String,
    /// The architecture of its processors.
    pub architecture: String,
    /// The model of its processors, if it is known.
    pub processor: Option<String>,
    /// Number of processors that this process may use.
    pub processors: usize,
}

impl Provenance {
    /// This process.
    #[must_use]
    pub fn here() -> Self {
        let written = SystemTime::now().duration_since(UNIX_EPOCH);
        // A path need not be UTF-8, and JSON has no other texts.
        let command = std::env::args_os().skip(1);
        Self {
            program: ProgramVersion::this(),
            command: command
                .map(|arg| arg.to_string_lossy().into_owned())
                .collect(),
            written_unix_s: written.map_or(0, |since| since.as_secs()),
            machine: Machine::this(),
        }
    }

    /// Writes it into the folder of an experiment.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        let mut text = serde_json::to_string_pretty(self)
            .unwrap_or_else(|error| unreachable!("it is always JSON: {error}"));
        text.push('\n');
        export::draft::write(&folder.join(PROVENANCE), &text)
    }

    /// Reads it from the folder of an experiment; `None` if no results have been written there.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read.
    pub fn load(folder: &Path) -> Result<Option<Self>, FileError> {
        let path = folder.join(PROVENANCE);
        if !path.exists() {
            return Ok(None);
        }

        let text =
            std::fs::read_to_string(&path).map_err(|error| FileError::unreadable(&path, &error))?;
        let provenance = serde_json::from_str(&text)
            .map_err(|error| FileError::new(format!("{}: {error}", path.display())))?;
        Ok(Some(provenance))
    }
}

impl Machine {
    fn this() -> Self {
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();

        let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = processors
            .lines()
            .find(|line| line.starts_with("model name"));
        let model = model.and_then(|line| line.split_once(':'));

        Self {
            host: host.map(|host| host.trim().to_owned()),
            os: std::env::consts::OS.to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
            processor: model.map(|(_, model)| model.trim().to_owned()),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}
