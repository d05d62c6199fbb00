//! What `launch` and `run` have in common: how a run is named, changed and kept.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::IntoDiagnostic;
use protocol::RunName;
use protocol::random::MAX_SEED;
use simulator::RunFolder;
use simulator::recorder::RunLock;
use simulator::scenario::{Changes, Override, Scenario, parse_speed};
use simulator::units::Time;

/// Options of one execution.
#[derive(Debug, Clone, Args)]
pub(crate) struct ExecutionArgs {
    /// Name of the run, and of its folder; without it the file's name.
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<RunName>,
    /// Seed, or `random` to draw one; it is recorded either way.
    #[arg(long, value_name = "N|random", value_parser = parse_seed)]
    pub(crate) seed: Option<u64>,
    /// Simulated time, for example "600 s".
    #[arg(long, value_name = "TIME")]
    pub(crate) duration: Option<Time>,
    /// Simulated seconds per second, or `max` for as fast as it goes.
    #[arg(long, value_name = "FACTOR|max", value_parser = |text: &str| parse_speed(text).map(Speed))]
    pub(crate) speed: Option<Speed>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// A change of the scenario, for example `guests.count=50` or `robot.Butler.params.refiller=Vonda`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub(crate) set: Vec<Override>,
}

/// Simulated seconds per second; `None` is as fast as it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Speed(pub(crate) Option<f64>);

fn parse_seed(text: &str) -> Result<u64, String> {
    if text == "random" {
        return draw_seed();
    }
    let seed = text.parse().ok().filter(|seed| *seed <= MAX_SEED);
    seed.ok_or_else(|| format!("a seed is a whole number from 0 to {MAX_SEED}, or `random`"))
}

/// A seed that nobody chose; from here on it is part of the run's record.
fn draw_seed() -> Result<u64, String> {
    let mut bytes = [0; 8];
    let read = std::fs::File::open("/dev/urandom")
        .and_then(|mut source| std::io::Read::read_exact(&mut source, &mut bytes));
    read.map_err(|error| format!("no seed can be drawn: {error}"))?;
    Ok(u64::from_le_bytes(bytes) & MAX_SEED)
}

impl ExecutionArgs {
    /// What these options change of a scenario.
    pub(crate) fn changes(&self) -> Changes {
        Changes {
            seed: self.seed,
            duration_s: self.duration.map(|duration| duration.0),
            set: self.set.clone(),
        }
    }

    /// The same options as arguments of another `cars launch`.
    pub(crate) fn to_args(&self, run: &RunName) -> Vec<String> {
        let mut args = vec![
            format!("--run={run}"),
            format!("--out={}", self.out.display()),
        ];
        args.extend(self.seed.map(|seed| format!("--seed={seed}")));
        args.extend(
            self.duration
                .map(|duration| format!("--duration={} s", duration.0)),
        );
        args.extend(self.speed.map(|speed| match speed.0 {
            Some(factor) => format!("--speed={factor}"),
            None => "--speed=max".to_owned(),
        }));
        args.extend(self.set.iter().map(|change| format!("--set={change}")));
        args
    }

    /// Name of the run: as given, or as the file is called.
    pub(crate) fn run_name(&self, file: &Path) -> miette::Result<RunName> {
        let from_file = || {
            RunName::new(
                file.file_stem()
                    .and_then(|stem| stem.to_str())
                    .unwrap_or("run"),
            )
        };
        self.run
            .clone()
            .map_or_else(from_file, Ok)
            .into_diagnostic()
    }

    /// Makes the folder of the run, with the resolved scenario in it, and points `latest` at it. Whoever writes the
    /// record keeps the lock.
    pub(crate) fn folder(
        &self,
        run: &RunName,
        scenario: &Scenario,
    ) -> miette::Result<(RunFolder, RunLock)> {
        let folder = RunFolder::new(&self.out, run);
        let lock = folder.create(scenario)?;
        point_latest(&self.out, run);
        Ok((folder, lock))
    }
}

/// Name under which the last run is found again.
pub(crate) const LATEST: &str = "latest";

/// A convenience: where links cannot be made, runs are found by their names.
fn point_latest(out: &Path, run: &RunName) {
    let link = out.join(LATEST);
    if link.is_symlink() {
        let _ = std::fs::remove_file(&link);
    }
    if let Err(error) = std::os::unix::fs::symlink(run.as_str(), &link) {
        tracing::debug!(%error, "no link to the latest run");
    }
}
