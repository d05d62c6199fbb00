//! `cars fork`: a recorded run goes on from a tick with changes.

use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use clap::Args;
use config::units::Time;
use config::{Changes, Override};
use lab::folder::{find, is_same_place, recorded_epoch, run_name};
use lab::fork::Fork;
use lab::moment::Moment;
use lab::run::project_robots;
use launch::RunOptions;
use protocol::{Epoch, RunName};
use scenario::{ChanceKind, Scenario};

use crate::errors::{Result, refusal};
use crate::execution::{if_taken, parse_seed};
use crate::table;

/// `cars fork`.
#[derive(Debug, Args)]
pub(crate) struct ForkArgs {
    /// The run and the last tick that it shares with the fork, for example `latest@240`, or `latest@120s`.
    #[arg(value_name = "RUN@TICK")]
    at: TickOfRun,
    /// What changes from the next tick on, for example `network.commands.loss=0.3` or `robot.Butler.params.affect=off`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// The seed of what is drawn from the next tick on, or `random` to draw one: the same past with another future.
    #[arg(long, value_name = "N|random", value_parser = parse_seed)]
    seed: Option<u64>,
    /// Draw only this anew: network, guests, sensing, robot.NAME (a name or a pattern), separated by commas; without it, all.
    #[arg(long, value_name = "KIND", value_delimiter = ',', requires = "seed")]
    reseed: Vec<ChanceKind>,
    /// Name of the fork; without it RUN-fork-TICK, with -seed-N after it if there is one.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// Replace the run with this name, if it is over. Without it, the fork takes the next free name.
    #[arg(long)]
    replace: bool,
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
pub(crate) struct TickOfRun {
    pub(crate) run: PathBuf,
    pub(crate) moment: Moment,
}

impl FromStr for TickOfRun {
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
pub(crate) fn fork(args: ForkArgs) -> Result<ExitCode> {
    // A link such as `latest` will lead to the fork.
    let parent_folder = find(&args.out, &args.at.run)?.resolved()?;
    let parent = run_name(&parent_folder);
    let files = recorded_epoch(&parent_folder, args.epoch)?;
    let recorded = Scenario::load(&files.scenario, &Changes::default())?;
    let fork = Fork {
        parent: &parent,
        files: &files,
        tick: args.at.moment.tick(recorded.tick_s),
        set: args.set,
        duration_s: args.duration.map(|duration| duration.0),
        reseed: args.seed.map(|seed| (seed, args.reseed)),
    };
    let scenario = fork.scenario()?;

    let run = args.run.unwrap_or_else(|| fork.name());
    let place = args.out.join(run.as_str());
    if args.replace && is_same_place(&place, parent_folder.path()) {
        return Err(refusal!(
            help = "give it another name by --run",
            "the fork would overwrite the run {parent}"
        ));
    }
    let options = RunOptions {
        run: Some(run.clone()),
        if_taken: if_taken(args.replace),
        seed: None,
        duration: args.duration,
        speed: None,
        out: args.out,
        set: Vec::new(),
    };
    let made = options.folder(&run, &scenario)?;
    if let Some(notice) = &made.notice {
        terminal::note(notice);
    }
    let executed = fork.execute(scenario, &made.run, &made.folder, &project_robots(), || {
        Ok(())
    });
    let summary = executed.inspect_err(|_| made.undo())?;
    if !args.quiet {
        table::print(&summary, made.folder.path())?;
    }
    Ok(ExitCode::from(summary.verdict().exit_status()))
}
