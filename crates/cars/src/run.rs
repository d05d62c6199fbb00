//! `cars run`: runs a scenario in this process.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use lab::run::check_faults;
use scenario::Scenario;

use crate::errors::Result;
use crate::execution::ExecutionArgs;
use crate::{named, remarks, table};

pub(crate) use lab::run::execute;

/// `cars run`.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// A scenario file, or a launch file, whose scenario is run, or the name of one that comes with the programs.
    #[arg(value_parser = named::run())]
    file: PathBuf,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Runs a scenario in this process.
pub(crate) fn run(args: RunArgs) -> Result<ExitCode> {
    let options = args.execution.options();
    let file = launch::scenario_file(&args.file)?;
    let scenario = Scenario::load(&file, &options.changes())?;
    check_faults(&scenario, 0)?;
    remarks::show(&file, &options.changes());

    let run = options.run_name(&args.file)?;
    let made = options.folder(&run, &scenario)?;
    if let Some(notice) = &made.notice {
        terminal::note(notice);
    }
    let speed = options.speed.and_then(|speed| speed.0);
    let executed = execute(scenario, &made.run, &made.folder, speed);
    let summary = executed.inspect_err(|_| made.undo_unless_begun())?;
    if !args.quiet {
        table::print(&summary, made.folder.path())?;
    }
    Ok(ExitCode::from(summary.verdict().exit_status()))
}
