//! `cars fork`: a recorded run goes on from a tick with changes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use clap::Args;
use config::units::Time;
use config::{Changes, Override};
use lab::folder::{find, recorded_epoch};
use lab::fork::Fork;
use lab::moment::Moment;
use launch::RunOptions;
use miette::{IntoDiagnostic, miette};
use protocol::{Epoch, RunName};
use scenario::Scenario;
use scenario::files::{EVENTS, LATEST, LOCK, LOGS, RECORDING, SCENARIO};
use simulator::RunFolder;

use crate::table;

/// `cars fork`.
#[derive(Debug, Args)]
pub(crate) struct ForkArgs {
    /// The run and the last tick that it shares with the fork, for example `latest@240`, or `latest@120s`.
    #[arg(value_name = "RUN@TICK")]
    at: Place,
    /// What changes from the next tick on, for example `network.commands.loss=0.3` or `robot.Butler.params.affect=off`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Name of the fork; without it RUN-fork-TICK.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// Another end, in simulated time from the beginning of the run, for example "900 s".
    #[arg(long, value_name = "TIME")]
    duration: Option<Time>,
    /// The epoch, in a run in which `init` began several; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// A tick of a run.
#[derive(Debug, Clone)]
struct Place {
    run: PathBuf,
    moment: Moment,
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (run, moment) = text
            .rsplit_once('@')
            .ok_or_else(|| format!("{text:?} is not of the form RUN@TICK"))?;
        Ok(Self {
            run: PathBuf::from(run),
            moment: moment.parse()?,
        })
    }
}

/// Forks a run.
pub(crate) fn fork(args: ForkArgs) -> miette::Result<ExitCode> {
    // A link such as `latest` will lead to the fork.
    let parent_folder = find(&args.out, &args.at.run)?.resolved()?;
    let parent = parent_folder.name()?;
    let files = recorded_epoch(&parent_folder, args.epoch)?;
    let recorded = Scenario::load(&files.scenario, &Changes::default())?;
    let tick = args.at.moment.tick(recorded.tick_s);
    let fork = Fork {
        parent: &parent,
        files: &files,
        tick,
        set: args.set,
        duration_s: args.duration.map(|duration| duration.0),
    };
    let scenario = fork.scenario()?;

    let run = match args.run {
        Some(run) => run,
        None => RunName::new(&format!("{parent}-fork-{tick}")).into_diagnostic()?,
    };
    let place = args.out.join(run.as_str());
    if is_same_place(&place, parent_folder.path()) {
        return Err(miette!(
            help = "give it another name by --run",
            "the fork would overwrite the run {parent}"
        ));
    }
    let options = RunOptions {
        run: Some(run.clone()),
        seed: None,
        duration: args.duration,
        speed: None,
        out: args.out,
        set: Vec::new(),
    };
    let before = Before::of(&options.out, &place);
    let (folder, _lock) = options.folder(&run, &scenario)?;
    let executed = fork.execute(scenario, &run, &folder);
    let summary = executed.inspect_err(|_| before.restore(&folder))?;
    if !args.quiet {
        table::print(&summary, folder.path())?;
    }
    Ok(ExitCode::from(summary.verdict().exit_status()))
}

/// What was there before a fork made its folder.
struct Before {
    has_folder: bool,
    /// The link to the latest run.
    link: PathBuf,
    /// Where it led.
    latest: Option<PathBuf>,
}

impl Before {
    fn of(out: &Path, place: &Path) -> Self {
        let link = out.join(LATEST);
        Self {
            has_folder: place.exists(),
            latest: std::fs::read_link(&link).ok(),
            link,
        }
    }

    /// Removes what a fork that failed has made. Files of others stay in a folder that was there before.
    fn restore(&self, folder: &RunFolder) {
        if let Err(error) = self.remove(folder) {
            let place = folder.path().display();
            terminal::note(format_args!("note: {place} could not be removed: {error}"));
        }
        // Without the link, runs have to be named.
        let _unlinked = self.restore_link(folder);
    }

    fn remove(&self, folder: &RunFolder) -> std::io::Result<()> {
        if !self.has_folder {
            return std::fs::remove_dir_all(folder.path());
        }

        // The scenario has the name of the log. It stays beside files of others, so that the folder is still that of a run.
        for file in [folder.log(), folder.file(EVENTS), folder.file(RECORDING)] {
            if file.exists() {
                std::fs::remove_file(file)?;
            }
        }
        if has_others(folder)? {
            return Ok(());
        }
        std::fs::remove_dir_all(folder.path())
    }

    fn restore_link(&self, folder: &RunFolder) -> std::io::Result<()> {
        let latest = std::fs::read_link(&self.link)?;
        if latest.file_name() != folder.path().file_name() {
            return Ok(()); // Another run has begun since.
        }

        std::fs::remove_file(&self.link)?;
        match &self.latest {
            Some(latest) if self.link.with_file_name(latest).exists() => {
                std::os::unix::fs::symlink(latest, &self.link)
            }
            _ => Ok(()),
        }
    }
}

/// Whether a folder has more than what every run's folder has from the beginning.
fn has_others(folder: &RunFolder) -> std::io::Result<bool> {
    for entry in std::fs::read_dir(folder.path())? {
        let name = entry?.file_name();
        let is_own = [SCENARIO, LOCK, LOGS].iter().any(|own| name == *own);
        if !is_own {
            return Ok(true);
        }
    }
    let mut logs = std::fs::read_dir(folder.file(LOGS))?;
    Ok(logs.next().is_some())
}

fn is_same_place(one: &Path, other: &Path) -> bool {
    one.canonicalize().ok() == other.canonicalize().ok()
}
