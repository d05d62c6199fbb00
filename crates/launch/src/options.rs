//! Options of one execution, shared by `cars launch`, `cars run` and `cars net play`.

use std::path::{Path, PathBuf};

use config::units::Time;
use config::{Changes, Override, Speed};
use protocol::RunName;
use protocol::name::BadName;
use scenario::Scenario;
use simulator::RunFolder;
use simulator::recorder::RunLock;

use super::launched::Launched;

/// Options of one execution of a scenario.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// Name of the run and of its folder; without it the name of the file.
    pub run: Option<RunName>,
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
        }
    }

    /// The options as arguments of another `cars launch`.
    #[must_use]
    pub fn to_args(&self, run: &RunName) -> Vec<String> {
        let mut args = vec![
            format!("--run={run}"),
            format!("--out={}", self.out.display()),
        ];
        args.extend(self.seed.map(|seed| format!("--seed={seed}")));
        if let Some(Time(duration_s)) = self.duration {
            args.push(format!("--duration={duration_s} s"));
        }
        args.extend(self.speed.map(|speed| format!("--speed={speed}")));
        args.extend(self.set.iter().map(|change| format!("--set={change}")));

        args
    }

    /// Name of the run: as given, or the stem of the file.
    ///
    /// # Errors
    /// [`BadName`] if the name of the file cannot be that of a run.
    pub fn run_name(&self, file: &Path) -> Result<RunName, BadName> {
        if let Some(run) = &self.run {
            return Ok(run.clone());
        }
        let stem = file.file_stem().and_then(|stem| stem.to_str());
        RunName::new(stem.unwrap_or("run"))
    }

    /// Makes the folder of the run with the resolved scenario, and points the link `latest` to it. The process that writes
    /// the record must keep the lock.
    ///
    /// # Errors
    /// [`config::FileError`] as [`RunFolder::create`].
    pub fn folder(
        &self,
        run: &RunName,
        scenario: &Scenario,
    ) -> Result<(RunFolder, RunLock), config::FileError> {
        let folder = RunFolder::new(&self.out, run);
        let lock = folder.create(scenario)?;
        Launched::clear(&folder)?;
        folder.point_latest();
        Ok((folder, lock))
    }
}
