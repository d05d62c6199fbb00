//! Runs any program as a robot. This process implements the protocol and exchanges JSON Lines with the program over its
//! standard input and output (`docs/protocol.md`, "Robots over stdin and stdout").

mod faults;
mod line;
mod program;
mod proxy;
mod remarks;

use std::ffi::OsString;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use nix::sys::signal::{SigSet, Signal};
use protocol::RobotName;
use robot::{Host, HostError, HostOptions, Stopper};

use crate::ending::code_of;
use crate::error::LaunchError;
use faults::Faults;
pub use faults::{FaultListener, ProgramFault};
use line::EndReason;
use program::{ASKING, END_PATIENCE, Program, start_thread};
use proxy::{ProgramRobot, SilenceNotice};
use remarks::Remarks;

/// How long to wait for a signal that has killed the program: a signal to the process group reaches this process, too.
const SAME_SIGNAL: Duration = Duration::from_secs(1);

/// How the run of a program as a robot ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProgramEnd {
    /// The run is over.
    WithRun,
    /// A signal has ended this process; the exit status that reports it.
    BySignal(u8),
    /// The robot has given up, for this reason.
    Failed(String),
}

/// What people and programs are told about a program while it runs.
pub struct ProgramNotices {
    /// What to report, once, when the program does not answer for `after`.
    pub silence: String,
    /// How long to wait for an answer before that.
    pub after: Duration,
    /// Receives what the program does against the rules of the page, beside the log of the run and standard error.
    pub on_fault: Option<FaultListener>,
}

/// Runs a program as the robot `name` until the run or the program ends.
///
/// It must be called before this process has other threads, because it blocks the signals to end.
///
/// # Errors
/// If the program cannot be started.
pub fn exec(
    name: &RobotName,
    options: HostOptions,
    command: &[OsString],
    notices: ProgramNotices,
) -> Result<ProgramEnd, LaunchError> {
    // All later threads inherit the mask, so only the thread in `listen` receives these signals. So does the program, until
    // `cars child` empties it.
    let asking: SigSet = ASKING.into_iter().collect();
    asking
        .thread_block()
        .map_err(LaunchError::system("signals cannot be received"))?;

    let stopper = Arc::new(OnceLock::new());
    let (program, events) = Program::start(name, command, stopper.clone())?;
    // From here on a signal ends the program as well. Until then it waits: it is blocked.
    let asked = listen(asking, &program, stopper.clone())?;
    let remarks = Remarks::default();
    // Shared: the robot reports faults of lines, and after it has left the run, this thread that of the end.
    let faults = Arc::new(Mutex::new(Faults::new(notices.on_fault)));
    let proxy = Box::new(ProgramRobot::new(
        program.clone(),
        events,
        SilenceNotice {
            text: format!("{name}: {}", notices.silence),
            after: notices.after,
        },
        remarks.clone(),
        faults.clone(),
    ));
    let outcome = Host::connect(vec![(name.clone(), proxy)], options).and_then(|host| {
        let stopper = stopper.get_or_init(|| host.stopper());
        if program.status().is_some() {
            stopper.stop(); // It exited before the stopper was set.
        }
        host.run()
    });

    let patience = if program.was_ended_by_signal() {
        SAME_SIGNAL
    } else {
        Duration::ZERO
    };
    for remark in remarks.in_words() {
        terminal::note(format_args!("{name}: {remark}"));
    }
    if let Ok(signal) = asked.recv_timeout(patience) {
        let _is_expected = program.end(EndReason::Interrupted);
        return Ok(ProgramEnd::BySignal(code_of(signal)));
    }

    match outcome {
        Ok(end) => {
            // The run is right without it, so the robot has not failed.
            if let Some(remark) = program.end(end.into()) {
                faults
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .end(&remark);
                terminal::note(format_args!("{name}: {remark}"));
            }
            Ok(ProgramEnd::WithRun)
        }
        Err(error) => {
            let reason = match error {
                HostError::Stopped => {
                    let reason = program.explain_end("its program is over");
                    format!("{name} gives up: {reason}")
                }
                error => error.to_string(),
            };
            let _is_secondary = program.end(EndReason::Failed);
            Ok(ProgramEnd::Failed(reason))
        }
    }
}

/// Waits for a signal to end on a thread of its own: the robot leaves the run, then the program is ended.
fn listen(
    asking: SigSet,
    program: &Arc<Program>,
    stopper: Arc<OnceLock<Stopper>>,
) -> Result<Receiver<Signal>, LaunchError> {
    let (sender, asked) = sync_channel(1);
    let program = program.clone();
    start_thread(move || {
        let Ok(signal) = asking.wait() else { return };
        let _over = sender.send(signal);
        program.interrupt();
        match stopper.get() {
            Some(stopper) => {
                stopper.stop();
                std::thread::sleep(END_PATIENCE);
            }
            None => {
                // The robot has not joined yet.
                let _is_expected = program.end(EndReason::Interrupted);
            }
        }

        // The main thread has not ended the process in time, so it hangs.
        program.kill();
        std::process::exit(code_of(signal).into());
    })?;
    Ok(asked)
}
