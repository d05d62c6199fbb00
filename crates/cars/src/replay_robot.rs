//! The program of a robot that is played from its record, which `cars launch --replay-robot` starts.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use lab::LabError;
use lab::folder::recorded_epoch;
use lab::replayed::Replayed;
use record::RunFolder;
use robot::{Host, Robot, RobotArgs, RobotName};

use crate::errors::Result;

/// `cars replay-robot`.
#[derive(Debug, Args)]
pub(crate) struct ReplayRobotArgs {
    /// The folder of the recorded run.
    #[arg(long, value_name = "DIR")]
    record: PathBuf,
    #[command(flatten)]
    robot: RobotArgs,
}

/// Takes part with a robot from a record.
pub(crate) fn take_part(args: &ReplayRobotArgs) -> Result<ExitCode> {
    let mut robots: Vec<(RobotName, Box<dyn Robot>)> = Vec::new();
    for name in &args.robot.names {
        robots.push((name.clone(), Box::new(open(&args.record, name)?)));
    }
    let host = Host::connect(robots, args.robot.options())?;
    host.run()?;
    Ok(ExitCode::SUCCESS)
}

/// A robot from the last epoch of a recorded run.
///
/// # Errors
/// If the folder is not that of a run, or the record has no reports of the robot.
pub(crate) fn open(folder: &Path, robot: &RobotName) -> Result<Replayed, LabError> {
    let files = recorded_epoch(&RunFolder::at(folder.to_owned()), None)?;
    Replayed::open(files, robot.clone())
}
