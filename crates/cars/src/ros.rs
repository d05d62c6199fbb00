//! `cars ros`: what is done for ROS 2 by the package for Python, which is the process from then on.

use std::env;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};

use clap::{Args, Subcommand};

use crate::control::RunRef;
use crate::errors::{Result, refusal};

/// Fails where the package or rclpy is missing, and says which.
const CHECK: &str = "import cars.ros; cars.ros._load.load()";
/// What installs them.
const INSTALL: &str = "pip install 'cars-simulator[ros]'";

/// `cars ros`.
#[derive(Debug, Subcommand)]
pub(crate) enum RosCommand {
    /// Show a run in progress to ROS 2, `/clock`, odometry, guests, emotions, and serve its controls: start, pause, step, reset, stop.
    Bridge(BridgeArgs),
}

/// `cars ros bridge`.
#[derive(Debug, Args)]
pub(crate) struct BridgeArgs {
    #[command(flatten)]
    run: RunRef,
}

/// Becomes the bridge.
pub(crate) fn ros(command: &RosCommand) -> Result<ExitCode> {
    let RosCommand::Bridge(args) = command;
    let python = python();
    let checked = Command::new(&python)
        .args(["-c", CHECK])
        .stdin(Stdio::null())
        .output()
        .map_err(|error| refusal!(help = INSTALL, "{} does not run: {error}", python.display()))?;
    if !checked.status.success() {
        let said = String::from_utf8_lossy(&checked.stderr);
        let last = said.trim_end().lines().last().unwrap_or_default();
        return Err(refusal!(
            help = INSTALL,
            "{} lacks what the bridge needs: {last}",
            python.display()
        ));
    }

    let mut bridge = Command::new(&python);
    bridge
        .args(["-m", "cars.ros", "bridge"])
        .args(args.run.options()?);
    // Returns only if it cannot be started. Signals go to the bridge itself.
    let error = bridge.exec();
    Err(refusal!("{} does not run: {error}", python.display()))
}

/// The Python beside this program, in an environment where the wheel is installed; otherwise that of the path.
fn python() -> PathBuf {
    let beside = env::current_exe()
        .ok()
        .map(|own| own.with_file_name("python3"));
    beside
        .filter(|path| path.exists())
        .unwrap_or_else(|| PathBuf::from("python3"))
}
