//! `cars exec`: runs any program as a robot.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use launch::child::{AtExit, become_program};
use launch::exec::{ProgramEnd, exec as run_program};
use robot::RobotArgs;

use crate::errors::{Result, refusal};

/// `cars exec`.
#[derive(Debug, Args)]
pub(crate) struct ExecArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// After how long without an answer people are told that the program may not have flushed its output, seconds.
    #[arg(
        long = "flush-notice-s",
        env = "CARS_FLUSH_NOTICE_S",
        default_value = "5",
        value_name = "SECONDS",
        value_parser = seconds
    )]
    flush_notice: Duration,
    /// The program and its arguments.
    #[arg(last = true, required = true, value_name = "PROGRAM")]
    command: Vec<OsString>,
}

/// `cars child`, through which this program starts others.
#[derive(Debug, Args)]
pub(crate) struct ChildArgs {
    /// Process id of the parent.
    parent: i32,
    /// Send SIGTERM at the parent's exit, instead of SIGKILL.
    #[arg(long)]
    terminate: bool,
    /// The program and its arguments.
    #[arg(last = true, required = true)]
    command: Vec<OsString>,
}

/// Runs a program as a robot until the run, or the program, ends.
pub(crate) fn exec(args: &ExecArgs) -> Result<ExitCode> {
    bus::runtime::use_one_thread();
    let [name] = args.robot.names.as_slice() else {
        let help = "for example: cars exec --name Leguin -- ./leguin.sh";
        return Err(refusal!(
            help = help,
            "a program is one robot: give one --name"
        ));
    };

    let notice = conform::unflushed(&args.command);
    let options = args.robot.options();
    match run_program(name, options, &args.command, &notice, args.flush_notice)? {
        ProgramEnd::WithRun => Ok(ExitCode::SUCCESS),
        ProgramEnd::BySignal(code) => Ok(ExitCode::from(code)),
        ProgramEnd::Failed(reason) => {
            terminal::note(format_args!("error: {reason}"));
            Ok(ExitCode::FAILURE)
        }
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

/// Replaces this process by a program that ends with its parent.
pub(crate) fn child(args: &ChildArgs) -> ExitCode {
    let at_exit = if args.terminate {
        AtExit::Terminate
    } else {
        AtExit::Kill
    };
    let Err(error) = become_program(args.parent, at_exit, &args.command);
    terminal::note(error.to_string());
    ExitCode::from(error.code())
}
