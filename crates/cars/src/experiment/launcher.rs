//! How units of experiments and hunts are launched as processes.

use std::process::Command;
use std::time::Duration;

use clap::Args;
use config::units::Time;
use experiments::{LaunchText, LaunchUse, Launches, Robots, TICK_PATIENCE};
use launch::child::{self, AtExit};
use launch::is_launch_file;
use std::path::Path;

use crate::errors::{Result, refusal};

/// How processes are used.
#[derive(Debug, Clone, Args)]
pub(crate) struct ProcessArgs {
    /// Start fresh processes for every run. Without it, the same processes play one run after another; the results are the same.
    #[arg(long)]
    fresh_processes: bool,
    /// How long a tick of processes may take, wall clock, before the run fails; without it "120 s".
    #[arg(long, value_name = "TIME")]
    tick_patience: Option<Time>,
}

impl ProcessArgs {
    /// The launches of a command.
    ///
    /// # Errors
    /// If the time is none.
    pub(crate) fn launches(&self) -> Result<Launches> {
        let tick_patience = match self.tick_patience {
            None => TICK_PATIENCE,
            Some(Time(time_s)) => Duration::try_from_secs_f64(time_s)
                .ok()
                .filter(|time| !time.is_zero())
                .ok_or_else(|| refusal!("--tick-patience is more than 0 s"))?,
        };
        let usage = LaunchUse {
            is_fresh: self.fresh_processes,
            tick_patience,
        };
        Ok(Launches::new(Box::new(launcher), usage))
    }
}

/// How the robots of a scenario or launch file are played as processes.
///
/// # Errors
/// If the launch file cannot be read.
pub(crate) fn processes_of(file: &Path) -> Result<Robots> {
    if is_launch_file(file).unwrap_or(false) {
        return Ok(Robots::Launched(LaunchText::read(file)?));
    }
    Ok(Robots::Programs)
}

/// The command `cars`, whose process ends in order with the thread that starts it.
pub(super) fn launcher() -> Command {
    child::command(AtExit::Terminate, child::own_program())
}
