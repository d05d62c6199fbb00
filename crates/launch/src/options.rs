//! Options of one execution, shared by `cars launch`, `cars run` and `cars net play`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use config::units::Time;
use config::{Changes, FileError, Override, Speed};
use protocol::RunName;
use record::{IfTaken, NewRun, RecordError, RunFolder};
use scenario::Scenario;

use super::file::{LaunchFile, is_launch_file};

/// Options of one execution of a scenario.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// Name of the run and of its folder; without it that of the launch file, or the name of the file.
    pub run: Option<RunName>,
    /// What is done where the name is taken.
    pub if_taken: IfTaken,
    /// Seed, instead of the scenario's.
    pub seed: Option<u64>,
    /// Simulated duration, instead of the scenario's.
    pub duration: Option<Time>,
    /// Speed of the clock.
    pub speed: Option<Speed>,
    /// Where run folders are made.
    pub out: PathBuf,
    /// Changes of the scenario.
    pub set: Vec<Override>,
}

impl RunOptions {
    /// The changes of the scenario in these options.
    #[must_use]
    pub fn changes(&self) -> Changes {
        Changes {
            seed: self.seed,
            duration_s: self.duration.map(|duration| duration.0),
            set: self.set.clone(),
            runs: Some(self.out.clone()),
        }
    }

    /// The options as arguments of another `cars launch`, for a run whose folder [`RunFolder::make`] has made.
    #[must_use]
    pub fn to_args(&self, run: &RunName) -> Vec<OsString> {
        let mut out = OsString::from("--out=");
        out.push(&self.out);
        let mut args = vec![format!("--run={run}").into(), out];
        if self.if_taken == IfTaken::Reserved {
            args.push("--reserved".into());
        }

        let mut more = Vec::new();
        more.extend(self.seed.map(|seed| format!("--seed={seed}")));
        if let Some(Time(duration_s)) = self.duration {
            more.push(format!("--duration={duration_s} s"));
        }
        more.extend(self.speed.map(|speed| format!("--speed={speed}")));
        more.extend(self.set.iter().map(|change| format!("--set={change}")));
        args.extend(more.into_iter().map(OsString::from));
        args
    }

    /// Name of the run: as given, or that in a launch file, or the stem of the file.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read, or its name cannot be that of a run.
    pub fn run_name(&self, file: &Path) -> Result<RunName, FileError> {
        match &self.run {
            Some(run) => Ok(run.clone()),
            None => default_run_name(file),
        }
    }

    /// Makes the folder of the run with the resolved scenario, and points the link `latest` to it. The process that writes
    /// the record must keep the lock.
    ///
    /// # Errors
    /// [`RecordError`] as [`RunFolder::make`].
    pub fn folder(&self, run: &RunName, scenario: &Scenario) -> Result<NewRun, RecordError> {
        let made = RunFolder::make(&self.out, run, self.if_taken)?;
        made.folder.fill(scenario)?;
        made.folder.point_latest();
        Ok(made)
    }
}

/// Name of a run of a file: that in a launch file, or the stem of the file.
///
/// # Errors
/// [`FileError`] if the file cannot be read, or its name cannot be that of a run.
pub fn default_run_name(file: &Path) -> Result<RunName, FileError> {
    // A roster is no TOML.
    if is_launch_file(file).unwrap_or(false)
        && let Some(run) = LaunchFile::load(file)?.run
    {
        return Ok(run);
    }

    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    RunName::new(&stem).map_err(|error| {
        let place = file.display();
        FileError::new(format!(
            "{place}: the name of the file cannot be that of a run: {error}"
        ))
        .with_help("give the run a name with --run, or rename the file")
    })
}
