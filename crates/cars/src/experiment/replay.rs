//! `cars experiment replay`: plays one unit once more and records it.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use experiments::{LaunchUse, Launches, Plan, Robots, Store, write_launch};
use lab::folder::read_summary;
use lab::scratch::Scratch;
use launch::RunOptions;
use protocol::RunName;
use record::{IfTaken, RunFolder, Summary};
use scenario::Scenario;

use super::launcher::launcher;
use crate::errors::{Result, refusal};
use crate::execution::if_taken;
use crate::run::execute;
use crate::table;

/// `cars experiment replay`.
#[derive(Debug, Args)]
pub(super) struct ReplayUnitArgs {
    /// Folder of the experiment.
    folder: PathBuf,
    /// Number of the unit, from 0.
    unit: usize,
    /// Name of the run, and of its folder; without it the experiment's name and the number of the unit.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// Replace the run with this name, if it is over. Without it, the run takes the next free name.
    #[arg(long)]
    replace: bool,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Plays a unit with everything recorded, and compares its digest with that of the unit as it was played before.
pub(super) fn replay(args: ReplayUnitArgs) -> Result<ExitCode> {
    let plan = Plan::load(&args.folder)?;
    plan.check_own_robots()?;
    if args.unit >= plan.units() {
        return Err(refusal!(
            "there is no unit {}: the experiment in {} has the units 0 to {}",
            args.unit,
            args.folder.display(),
            plan.units() - 1
        ));
    }

    let unit = plan.unit(args.unit);
    let launches = Launches::new(Box::new(launcher), LaunchUse::default());
    let mut scenario = plan.scenario_of(&unit, &launches)?;
    drop(launches);
    scenario.record.frames = true;
    let run = match args.run {
        Some(run) => run,
        None => RunName::new(&format!("{}-{}", plan.name(), unit.number))
            .or_else(|_| RunName::new(&format!("unit-{}", unit.number)))?,
    };
    let options = RunOptions {
        run: Some(run.clone()),
        if_taken: if_taken(args.replace),
        seed: None,
        duration: None,
        speed: None,
        out: args.out,
        set: Vec::new(),
    };
    let (summary, folder) = match plan.robots() {
        Robots::InProcess => record(scenario, &run, &options)?,
        Robots::Programs | Robots::Launched(_) => launch(&plan, &scenario, &run, &options)?,
    };
    if !args.quiet {
        table::print(&summary, folder.path())?;
    }

    let name = unit.describe();
    let digest = &summary.digest;
    match Store::open(&args.folder)?.get(unit.key) {
        Some(Ok(played)) if played.digest == *digest => {
            if !args.quiet {
                terminal::note(format_args!("{name} is the same run, digest {digest}"));
            }
            Ok(ExitCode::SUCCESS)
        }
        Some(Ok(played)) => Err(refusal!(
            help = "it was played by another program, or a robot is not reproducible",
            "{name} is another run: its digest is {digest} and was {}",
            played.digest
        )),
        Some(Err(_)) | None => {
            terminal::note(format_args!("{name} has not been played to its end before"));
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Records a run of this process.
fn record(scenario: Scenario, run: &RunName, options: &RunOptions) -> Result<(Summary, RunFolder)> {
    let made = options.folder(run, &scenario)?;
    if let Some(notice) = &made.notice {
        terminal::note(notice);
    }
    let executed = execute(scenario, &made.run, &made.folder, None);
    let summary = executed.inspect_err(|_| made.undo_unless_begun())?;
    Ok((summary, made.folder))
}

/// Records a run of processes.
fn launch(
    plan: &Plan,
    scenario: &Scenario,
    run: &RunName,
    options: &RunOptions,
) -> Result<(Summary, RunFolder)> {
    let files = Scratch::new()?;
    let launch = match plan.robots() {
        Robots::Launched(launch) => Some(launch),
        Robots::InProcess | Robots::Programs => None,
    };
    let file = write_launch(scenario, launch, files.path())?;

    // The launch takes this folder, and this process has to know it.
    let made = RunFolder::make(&options.out, run, options.if_taken)?;
    if let Some(notice) = &made.notice {
        terminal::note(notice);
    }
    let reserved = made.reserve();
    let options = RunOptions {
        if_taken: IfTaken::Reserved,
        ..options.clone()
    };
    let mut command = launcher();
    command
        .arg("launch")
        .arg(file)
        .args(options.to_args(&reserved.run));
    command.args(["--speed", "max", "--no-console", "--quiet"]);
    let status = command.status()?;

    let folder = reserved.folder;
    if folder.restore_replaced()? {
        return Err(refusal!("the launch failed: {status}"));
    }
    let summary = read_summary(&folder)?;
    // Verdicts are exit statuses, too: the run is there.
    let summary = summary.filter(|summary| summary.end.is_some());
    let summary = summary.ok_or_else(|| refusal!("the launch failed: {status}"))?;

    Ok((summary, folder))
}
