//! `cars exec`: any program as a robot. It speaks the protocol for the program, and JSON Lines with it over its standard
//! input and output (`docs/protocol.md`, "Robots over stdin and stdout").

mod line;
mod program;
mod proxy;
mod start;

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use clap::Args;
use miette::{IntoDiagnostic, miette};
use nix::sys::signal::{SigSet, Signal};
use robot::{Host, HostError, RobotArgs, Stopper};

use crate::launch::ending::code_of;
use line::EndReason;
use program::{END_PATIENCE, Program};
use proxy::Proxy;
pub(crate) use start::{StartArgs, start};

/// Signals that ask to end.
const ASKING: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
/// A signal that goes to a group of processes ends the program at once and reaches us, too: within this time.
const SAME_SIGNAL: Duration = Duration::from_secs(1);

/// `cars exec`.
#[derive(Debug, Args)]
pub(crate) struct ExecArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The program and its arguments.
    #[arg(last = true, required = true, value_name = "PROGRAM")]
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
    // Before any other thread is there, so that these signals come to the thread that waits for them. The program does
    // not inherit this.
    let asking: SigSet = ASKING.into_iter().collect();
    asking.thread_block().into_diagnostic()?;

    let stopper = Arc::new(OnceLock::new());
    let (program, heard) = Program::start(name, &args.command, stopper.clone())?;
    let asked = listen(asking, &program, stopper.clone());
    let proxy = Box::new(Proxy::new(program.clone(), heard));
    let outcome =
        Host::connect(vec![(name.clone(), proxy)], args.robot.options()).and_then(|host| {
            let stopper = stopper.get_or_init(|| host.stopper());
            if program.status().is_some() {
                stopper.stop(); // It was over before anybody could be told.
            }
            host.run()
        });

    let patience = if program.was_asked_to_end() {
        SAME_SIGNAL
    } else {
        Duration::ZERO
    };
    if let Ok(signal) = asked.recv_timeout(patience) {
        program.end(EndReason::Interrupted);
        return Ok(ExitCode::from(code_of(signal)));
    }
    let reason = match outcome {
        Ok(end) => {
            program.end(end.into());
            return Ok(ExitCode::SUCCESS);
        }
        Err(HostError::Stopped) => format!(
            "{name} gives up: {}",
            program.account_or("its program is over")
        ),
        Err(error) => error.to_string(),
    };
    program.end(EndReason::Failed);
    eprintln!("error: {reason}");
    Ok(ExitCode::FAILURE)
}

/// Waits for a signal that asks to end, in a thread of its own: the robot leaves the run, and then the program ends.
fn listen(
    asking: SigSet,
    program: &Arc<Program>,
    stopper: Arc<OnceLock<Stopper>>,
) -> Receiver<Signal> {
    let (tell, asked): (SyncSender<Signal>, _) = std::sync::mpsc::sync_channel(1);
    let program = program.clone();
    std::thread::spawn(move || {
        let Ok(signal) = asking.wait() else { return };
        let _over = tell.send(signal);
        program.interrupt();
        match stopper.get() {
            Some(stopper) => {
                stopper.stop();
                std::thread::sleep(END_PATIENCE);
            }
            None => program.end(EndReason::Interrupted), // Still on its way into the run.
        }
        // Whatever still hangs: a robot that is asked to end ends.
        program.kill();
        std::process::exit(code_of(signal).into());
    });
    asked
}
