//! The `main` of a robot's program: its arguments, its log, its exit status.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bus::DEFAULT_ENDPOINT;
use clap::Parser;
use protocol::{RobotName, RunName};

use crate::cri::Robot;
use crate::host::{Host, HostError, HostOptions};

/// The arguments of a robot's program.
#[derive(Debug, Clone, Parser)]
#[command(
    version,
    about = "A robot of the Cooperative Affective Robot Simulator"
)]
pub struct RobotArgs {
    /// The robot of the roster to run; several names run several robots in this process.
    #[arg(long = "name", value_name = "NAME")]
    pub names: Vec<RobotName>,
    /// The run to take part in.
    #[arg(long, env = "CARS_RUN", default_value = "default")]
    pub run: RunName,
    /// Where the simulator listens.
    #[arg(long, env = "CARS_CONNECT", default_value = DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    pub connect: String,
    /// How long to try to reach the simulator and to join, seconds.
    #[arg(
        long,
        env = "CARS_PATIENCE_S",
        default_value_t = 20.0,
        value_name = "SECONDS"
    )]
    pub patience_s: f64,
    /// How long to wait for a simulator that is gone, or whose link is cut, seconds.
    #[arg(
        long,
        env = "CARS_GONE_PATIENCE_S",
        default_value_t = 600.0,
        value_name = "SECONDS"
    )]
    pub gone_patience_s: f64,
    /// A configuration file of the middleware instead of the built-in settings.
    #[arg(long, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
}

impl RobotArgs {
    /// The options of a host with these arguments.
    #[must_use]
    pub fn options(&self) -> HostOptions {
        let patience =
            Duration::try_from_secs_f64(self.patience_s).unwrap_or(Duration::from_secs(20));
        let gone_patience =
            Duration::try_from_secs_f64(self.gone_patience_s).unwrap_or(Duration::from_secs(600));
        HostOptions {
            run: self.run.clone(),
            connect: self.connect.clone(),
            patience,
            gone_patience,
            zenoh_config: self.zenoh_config.clone(),
        }
    }
}

/// Runs a robot's program. `make` builds the robot for a name; `default_name` is its name if the command line has none.
/// Returns when the run ends, with exit status 0 if no error ended it.
pub fn main(default_name: &str, make: impl Fn(&RobotName) -> Box<dyn Robot>) -> ExitCode {
    bus::runtime::use_one_thread();

    let mut args: RobotArgs = match terminal::arguments() {
        Ok(args) => args,
        Err(code) => return code,
    };
    if args.names.is_empty() {
        args.names.extend(RobotName::new(default_name));
    }

    terminal::print_diagnostics("warn");

    match take_part(&args, make) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::note(format_args!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

fn take_part(
    args: &RobotArgs,
    make: impl Fn(&RobotName) -> Box<dyn Robot>,
) -> Result<(), HostError> {
    let robots = args
        .names
        .iter()
        .map(|name| (name.clone(), make(name)))
        .collect();
    Host::connect(robots, args.options())?.run().map(|_end| ())
}
