//! `cars exec-start`: ties this process to `cars exec`, then replaces itself by the program.

use std::convert::Infallible;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;

use nix::unistd::getppid;

/// Exit status of shells where a command is not found.
const NOT_FOUND: u8 = 127;

/// Why this process cannot become the program.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// `cars exec` has exited already.
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
            Self::NotStarted { .. } => NOT_FOUND,
            Self::ParentGone | Self::NoProgram => 1,
        }
    }
}

/// Makes the kernel kill this process when `cars exec` (process id `parent`) exits, and becomes the program. Setting this
/// between `fork` and `exec` would need unsafe code; a process that replaces itself does not.
///
/// # Errors
/// [`StartError`] if this process cannot become the program; otherwise the function does not return.
pub fn start(parent: i32, command: &[OsString]) -> Result<Infallible, StartError> {
    #[cfg(target_os = "linux")]
    if let Err(error) = nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL) {
        tracing::warn!("this program will survive if cars exec is killed: {error}");
    }

    // The parent may have exited before the line above.
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
