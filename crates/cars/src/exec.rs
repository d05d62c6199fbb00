//! `cars exec`: runs any program as a robot.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use conform::StdioLine;
use launch::child::{AtExit, become_program};
use launch::exec::{FaultListener, ProgramEnd, ProgramFault, ProgramNotices, exec as run_program};
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
    /// Print what the program does against the rules of docs/protocol.md that `cars exec` sees and others cannot, on standard
    /// output, one JSON object a line. `cars conform` asks for it.
    #[arg(long, env = conform::STDIO_VARIABLE)]
    report_faults: bool,
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

    let notices = ProgramNotices {
        silence: conform::unflushed(&args.command),
        after: args.flush_notice,
        on_fault: args.report_faults.then(report_faults).transpose()?,
    };
    match run_program(name, args.robot.options(), &args.command, notices)? {
        ProgramEnd::WithRun => Ok(ExitCode::SUCCESS),
        ProgramEnd::BySignal(code) => Ok(ExitCode::from(code)),
        ProgramEnd::Failed(reason) => {
            terminal::note(format_args!("error: {reason}"));
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Prints which rules are observed, and then the faults of the program.
fn report_faults() -> Result<FaultListener> {
    terminal::data(StdioLine::observed().line())?;
    Ok(Box::new(|fault| {
        let (rule, came) = match fault {
            ProgramFault::UnknownFields(came) => (conform::STDIO_FIELDS, came),
            ProgramFault::LogLimits(came) => (conform::STDIO_LOG, came),
            ProgramFault::End(came) => (conform::STDIO_END, came),
        };
        if let Err(error) = terminal::data(StdioLine::fault(rule, came).line()) {
            terminal::note(format_args!(
                "a fault cannot be reported ({error}): {rule}: {came}"
            ));
        }
    }))
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
