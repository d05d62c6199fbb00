//! The first moments of a program: between being a process and being the program.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;

use clap::Args;
use nix::unistd::getppid;

/// Exit status of shells where a command is not found.
const NOT_FOUND: u8 = 127;

/// `cars exec-start`, which `cars exec` starts instead of the program itself.
#[derive(Debug, Args)]
pub(crate) struct StartArgs {
    /// Process id of `cars exec`.
    parent: i32,
    /// The program and its arguments.
    #[arg(last = true, required = true)]
    command: Vec<OsString>,
}

/// Sees to it that this process ends with `cars exec`, however that ends, and becomes the program. What must happen
/// between `fork` and `exec` is unsafe code; a process that becomes another program does the same without.
pub(crate) fn start(args: &StartArgs) -> ExitCode {
    #[cfg(target_os = "linux")]
    if let Err(error) = nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL) {
        eprintln!("this program will not be ended where cars exec is killed: {error}");
    }
    // It may have been killed before the line above.
    if getppid().as_raw() != args.parent {
        return ExitCode::FAILURE;
    }
    let Some((program, rest)) = args.command.split_first() else {
        return ExitCode::FAILURE;
    };
    let error = std::process::Command::new(program).args(rest).exec();
    eprintln!("{} cannot be started: {error}", program.display());
    ExitCode::from(NOT_FOUND)
}
