//! How a run was launched, in the run's folder, so that it can be resumed after its simulator or the machine was killed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use config::{FileError, Source};
use protocol::RobotName;
use record::names::LAUNCHED;
use record::{RecordError, RunFolder, seal};
use scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::file::LaunchFile;

/// `launched.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Launched {
    /// Absolute path of the launch file or of the roster.
    pub(super) file: PathBuf,
    /// Whether it is a roster.
    pub(super) is_roster: bool,
    /// Its text: the file may have been changed since.
    pub(super) text: String,
    /// Simulated seconds per second; `None` is as fast as possible.
    pub(super) speed: Option<f64>,
    /// Absolute path of the folder of certificates that the command line named.
    pub(super) secure: Option<PathBuf>,
    /// Whether the simulator was allowed to listen without certificates where other machines can connect.
    pub(super) is_insecure: bool,
    /// Robots that were played from their records, with the absolute paths of the recorded runs.
    pub(super) replayed: BTreeMap<RobotName, PathBuf>,
}

impl Launched {
    /// Writes it into the folder of the run.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be written.
    pub(super) fn write(&self, folder: &RunFolder) -> Result<(), RecordError> {
        let text = seal::sealed_text(self).map_err(|error| {
            RecordError::folder(format!("{LAUNCHED} cannot be written: {error}"))
        })?;
        folder.write_line(LAUNCHED, &text)
    }

    /// Reads it from the folder of a run.
    ///
    /// # Errors
    /// [`FileError`] if the run was not launched, or the file cannot be read.
    pub(super) fn read(folder: &RunFolder) -> Result<Self, FileError> {
        let path = folder.file(LAUNCHED);
        if !path.exists() {
            let place = folder.path().display();
            let error = FileError::new(format!("the run in {place} was not started by a launch"));
            return Err(
                error.with_help("`cars run` with the scenario.toml there executes it again")
            );
        }

        let source = Source::read(&path)?;
        serde_json::from_str(&source.text)
            .map_err(|error| FileError::new(format!("{}: {error}", path.display())))
    }

    /// The launch file as it was, for the scenario of the run.
    ///
    /// # Errors
    /// [`FileError`] with line and caret, where a later version does not read it.
    pub(super) fn launch_file(&self, scenario: &Scenario) -> Result<LaunchFile, FileError> {
        let source = Source {
            name: self.file.display().to_string(),
            text: self.text.clone(),
        };
        if self.is_roster {
            return Ok(LaunchFile::of_roster(&self.file, source, scenario));
        }

        let folder = self.file.parent().unwrap_or(Path::new(""));
        let mut file = LaunchFile::parse(source, folder)?;
        file.assign_robots(scenario)?;
        Ok(file)
    }
}
