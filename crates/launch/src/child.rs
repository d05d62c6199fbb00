//! Ties processes to this one: the kernel ends them when this process exits, however it exits.
//!
//! A program is started through `cars child`, which asks the kernel for a signal at the exit of its parent (`PDEATHSIG`) and
//! then becomes the program. To ask between `fork` and `exec` would need unsafe code; a process that replaces itself does not.
//! The kernel sends the signal when the *thread* that started the process exits, so programs are started on threads that stay
//! until the end. Systems other than Linux have no such signal.

use std::convert::Infallible;
use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use nix::sys::signal::SigSet;
use nix::unistd::getppid;

/// Exit status of shells where a command is not found.
const NOT_FOUND: u8 = 127;
/// Exit status of shells where a command cannot be run.
const CANNOT_RUN: u8 = 126;
/// Argument of `cars child` for [`AtExit::Terminate`].
const TERMINATE: &str = "--terminate";

/// What happens to a process when its parent exits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AtExit {
    /// It receives SIGKILL.
    Kill,
    /// It receives SIGTERM, and ends by itself: it has a record to write or processes of its own to end.
    Terminate,
}

/// Why this process cannot become the program.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The parent has exited already.
    #[error("the process that asked for the program has ended")]
    ParentGone,
    /// The command names no program.
    #[error("no program is given")]
    NoProgram,
    /// The system cannot start the program.
    #[error("{program} cannot be started: {error}")]
    NotStarted {
        /// The program as given.
        program: String,
        /// The system's reason.
        error: std::io::Error,
    },
}

impl StartError {
    /// The exit status that reports it, as shells do.
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::NotStarted { error, .. } if error.kind() == ErrorKind::NotFound => NOT_FOUND,
            Self::NotStarted { .. } => CANNOT_RUN,
            Self::ParentGone | Self::NoProgram => 1,
        }
    }
}

/// The command of a program that ends with this process, which must be `cars`.
#[must_use]
pub fn command(at_exit: AtExit, program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(own_program());
    command.args(prefix(at_exit)).arg(program);
    command
}

/// The command of `cars`, at this path, that ends with the thread of this process that starts it.
#[must_use]
pub fn cars(at_exit: AtExit, cars: &Path) -> Command {
    let mut command = Command::new(cars);
    command.args(prefix(at_exit)).arg(cars);
    command
}

/// This program, also where another build has replaced its file.
#[must_use]
pub fn own_program() -> PathBuf {
    if cfg!(target_os = "linux") {
        return PathBuf::from("/proc/self/exe");
    }
    std::env::current_exe().unwrap_or_else(|_| PathBuf::from("cars"))
}

/// Arguments of this program that precede a program and its arguments.
pub(crate) fn prefix(at_exit: AtExit) -> Vec<String> {
    // With the id of this process, so that the child notices if it has ended before the kernel was
    // asked.
    let mut prefix = vec!["child".to_owned(), std::process::id().to_string()];
    if at_exit == AtExit::Terminate {
        prefix.push(TERMINATE.to_owned());
    }
    prefix.push("--".to_owned());
    prefix
}

/// Makes the kernel end this process when its parent (process id `parent`) exits, and becomes the program.
///
/// # Errors
/// [`StartError`] if this process cannot become the program; otherwise the function does not return.
pub fn become_program(
    parent: i32,
    at_exit: AtExit,
    command: &[OsString],
) -> Result<Infallible, StartError> {
    ask_for_signal(at_exit);

    // The parent may have exited before it was asked for.
    if getppid().as_raw() != parent {
        return Err(StartError::ParentGone);
    }

    let Some((program, rest)) = command.split_first() else {
        return Err(StartError::NoProgram);
    };

    // A parent that blocks signals waits for them itself. A blocked signal stays blocked in a program that does not know of it.
    if let Err(error) = SigSet::empty().thread_set_mask() {
        tracing::warn!("this program may not receive all signals: {error}");
    }
    let error = Command::new(program).args(rest).exec();
    Err(StartError::NotStarted {
        program: program.display().to_string(),
        error,
    })
}

#[cfg(target_os = "linux")]
fn ask_for_signal(at_exit: AtExit) {
    use nix::sys::signal::Signal;

    let signal = match at_exit {
        AtExit::Kill => Signal::SIGKILL,
        AtExit::Terminate => Signal::SIGTERM,
    };
    if let Err(error) = nix::sys::prctl::set_pdeathsig(signal) {
        tracing::warn!("this program will go on if its parent is killed: {error}");
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_signal(_: AtExit) {}
