//! `cars exec`: runs any program as a robot.

use std::ffi::OsString;
use std::process::ExitCode;

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

    let silence = conform::unflushed(&args.command);
    match run_program(name, args.robot.options(), &args.command, &silence)? {
        ProgramEnd::WithRun => Ok(ExitCode::SUCCESS),
        ProgramEnd::BySignal(code) => Ok(ExitCode::from(code)),
        ProgramEnd::Failed(reason) => {
            terminal::note(format_args!("error: {reason}"));
            Ok(ExitCode::FAILURE)
        }
    }
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
