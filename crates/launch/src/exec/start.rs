//! The first moments of a program: between being a process and being the program.

use std::convert::Infallible;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;

use nix::unistd::getppid;

/// Exit status of shells where a command is not found.
const NOT_FOUND: u8 = 127;

/// This process does not become the program.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// `cars exec` is gone already.
    #[error("the process that asked for the program has ended")]
    ParentGone,
    /// The command names no program.
    #[error("no program is given")]
    NoProgram,
    /// The system does not start it.
    #[error("{program} cannot be started: {error}")]
    NotStarted {
        /// As given.
        program: String,
        /// Why.
        error: std::io::Error,
    },
}

impl StartError {
    /// The exit status that reports it, as shells do.
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::NotStarted { .. } => NOT_FOUND,
            Self::ParentGone | Self::NoProgram => 1,
        }
    }
}

/// Sees to it that this process ends with `cars exec` (process id `parent`), however that ends, and becomes the program.
/// What must happen between `fork` and `exec` is unsafe code; a process that becomes another program does the same
/// without.
///
/// # Errors
/// [`StartError`] if this process cannot become the program; otherwise this function does not return.
pub fn start(parent: i32, command: &[OsString]) -> Result<Infallible, StartError> {
    #[cfg(target_os = "linux")]
    if let Err(error) = nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL) {
        tracing::warn!("this program will not be ended where cars exec is killed: {error}");
    }

    // It may have been killed before the line above.
    if getppid().as_raw() != parent {
        return Err(StartError::ParentGone);
    }

    let Some((program, rest)) = command.split_first() else {
        return Err(StartError::NoProgram);
    };
    let error = std::process::Command::new(program).args(rest).exec();
    Err(StartError::NotStarted {
        program: program.display().to_string(),
        error,
    })
}
