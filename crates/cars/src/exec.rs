//! `cars exec`: runs any program as a robot.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Args;
use launch::exec::{Ended, exec as run_program, start as become_program};
use miette::miette;
use robot::RobotArgs;

/// `cars exec`.
#[derive(Debug, Args)]
pub(crate) struct ExecArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The program and its arguments.
    #[arg(last = true, required = true, value_name = "PROGRAM")]
    command: Vec<OsString>,
}

/// `cars exec-start`, which `cars exec` starts in place of the program.
#[derive(Debug, Args)]
pub(crate) struct StartArgs {
    /// Process id of `cars exec`.
    parent: i32,
    /// The program and its arguments.
    #[arg(last = true, required = true)]
    command: Vec<OsString>,
}

/// Runs a program as a robot until the run, or the program, ends.
pub(crate) fn exec(args: &ExecArgs) -> miette::Result<ExitCode> {
    bus::runtime::use_one_thread();
    let [name] = args.robot.names.as_slice() else {
        let help = "for example: cars exec --name Leguin -- ./leguin.sh";
        return Err(miette!(
            help = help,
            "a program is one robot: give one --name"
        ));
    };

    match run_program(name, args.robot.options(), &args.command)? {
        Ended::WithRun => Ok(ExitCode::SUCCESS),
        Ended::BySignal(code) => Ok(ExitCode::from(code)),
        Ended::Failed(reason) => {
            eprintln!("error: {reason}");
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Replaces this process by the program that `cars exec` runs.
pub(crate) fn start(args: &StartArgs) -> ExitCode {
    let Err(error) = become_program(args.parent, &args.command);
    eprintln!("{error}");
    ExitCode::from(error.code())
}
