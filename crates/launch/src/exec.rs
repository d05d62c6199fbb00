//! Any program as a robot. This process speaks the protocol for the program, and JSON Lines with it over its standard
//! input and output (`docs/protocol.md`, "Robots over stdin and stdout").

mod line;
mod program;
mod proxy;
mod start;

use std::ffi::OsString;
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use miette::IntoDiagnostic;
use nix::sys::signal::{SigSet, Signal};
use protocol::RobotName;
use robot::{Host, HostError, HostOptions, Stopper};

use crate::ending::code_of;
use line::EndReason;
use program::{ASKING, END_PATIENCE, Program};
use proxy::Proxy;
pub use start::{StartError, start};

/// A signal that goes to a group of processes ends the program at once and reaches us, too: within this time.
const SAME_SIGNAL: Duration = Duration::from_secs(1);

/// How a program that was run as a robot came to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ended {
    /// With the run.
    WithRun,
    /// By a signal to this process; the exit status that reports it.
    BySignal(u8),
    /// The robot gave up, for this reason.
    Failed(String),
}

/// Runs a program as the robot `name` until the run, or the program, ends.
///
/// To be called before this process has other threads: it blocks the signals that ask to end.
///
/// # Errors
/// If the program cannot be started.
pub fn exec(name: &RobotName, options: HostOptions, command: &[OsString]) -> miette::Result<Ended> {
    // Before any other thread is there, so that these signals come to the thread that waits for them. The program does
    // not inherit this.
    let asking: SigSet = ASKING.into_iter().collect();
    asking.thread_block().into_diagnostic()?;

    let stopper = Arc::new(OnceLock::new());
    let (program, heard) = Program::start(name, command, stopper.clone())?;
    let asked = listen(asking, &program, stopper.clone());
    let proxy = Box::new(Proxy::new(program.clone(), heard));
    let outcome = Host::connect(vec![(name.clone(), proxy)], options).and_then(|host| {
        let stopper = stopper.get_or_init(|| host.stopper());
        if program.status().is_some() {
            stopper.stop(); // It was over before its end could be reported.
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
        return Ok(Ended::BySignal(code_of(signal)));
    }

    let reason = match outcome {
        Ok(end) => {
            program.end(end.into());
            return Ok(Ended::WithRun);
        }
        Err(HostError::Stopped) => format!(
            "{name} gives up: {}",
            program.account_or("its program is over")
        ),
        Err(error) => error.to_string(),
    };
    program.end(EndReason::Failed);
    Ok(Ended::Failed(reason))
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
