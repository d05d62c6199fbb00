//! The programs of a build, and processes that end with their measurement.

use std::io::Read;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use bus::runtime::{ONE_THREAD, RUNTIME_VARIABLE};
use launch::child::{self, AtExit};
use miette::{IntoDiagnostic, WrapErr, miette};

/// How often the processes are polled for their end. It is no part of the measured time, which the process with the clock
/// measures.
const POLL: Duration = Duration::from_millis(20);

/// The folder of a build's programs.
#[derive(Debug)]
pub(crate) struct Programs {
    folder: PathBuf,
}

impl Programs {
    /// The programs beside this executable.
    pub(crate) fn of_this_build() -> miette::Result<Self> {
        let own = std::env::current_exe().into_diagnostic()?;
        let folder = own.parent().unwrap_or(Path::new("/"));
        Self::of(folder)
    }

    /// The programs in a folder.
    ///
    /// # Errors
    /// If one of them is missing.
    pub(crate) fn of(folder: &Path) -> miette::Result<Self> {
        let programs = Self {
            folder: folder.to_owned(),
        };

        for name in [
            "cars",
            "cars-bench",
            "cars-sim",
            "cars-butler",
            "cars-leguin",
        ] {
            let program = folder.join(name);
            if !program.exists() {
                return Err(miette!(
                    help = "build all programs first: `cargo build --release --workspace`",
                    "there is no {}",
                    program.display()
                ));
            }
        }

        Ok(programs)
    }

    /// One of the build's programs, with the threads that suit the lock-step.
    pub(crate) fn command(&self, name: &str) -> Command {
        command(&self.folder.join(name))
    }
}

/// This program, with the threads that suit the lock-step.
pub(crate) fn own_command() -> miette::Result<Command> {
    let own = std::env::current_exe().into_diagnostic()?;
    Ok(command(&own))
}

fn command(program: &Path) -> Command {
    let mut command = child::command(AtExit::Kill, program);
    command
        .stdin(Stdio::null())
        .env(RUNTIME_VARIABLE, ONE_THREAD);
    command
}

/// An endpoint on this machine where nothing listens.
pub(crate) fn free_endpoint(is_secured: bool) -> miette::Result<String> {
    let listener = TcpListener::bind("127.0.0.1:0").into_diagnostic()?;
    let address = listener.local_addr().into_diagnostic()?;
    let link = if is_secured { "tls" } else { "tcp" };
    Ok(format!("{link}/{address}"))
}

/// Processes of one measurement. They are killed on drop, so none outlives a measurement that fails.
#[derive(Debug, Default)]
pub(crate) struct Processes {
    children: Vec<Child>,
}

impl Processes {
    /// Starts a process.
    pub(crate) fn start(&mut self, command: &mut Command) -> miette::Result<()> {
        let child = command
            .spawn()
            .into_diagnostic()
            .wrap_err_with(|| format!("starting {}", command.get_program().display()))?;
        self.children.push(child);
        Ok(())
    }

    /// Waits until all processes have exited with success.
    ///
    /// # Errors
    /// At the first failure, without waiting for the others: they might wait for the failed process.
    pub(crate) fn wait(&mut self) -> miette::Result<()> {
        while self.is_any_running()? {
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    fn is_any_running(&mut self) -> miette::Result<bool> {
        let mut is_running = false;
        for child in &mut self.children {
            match child.try_wait().into_diagnostic()? {
                None => is_running = true,
                Some(status) if status.success() => {}
                Some(status) => return Err(miette!("a process of the benchmark failed: {status}")),
            }
        }
        Ok(is_running)
    }

    /// Output of the process that was started first, after its end. Empty unless its output was piped.
    pub(crate) fn output_of_first(&mut self) -> miette::Result<String> {
        let mut printed = String::new();
        let first = self.children.first_mut();
        if let Some(output) = first.and_then(|child| child.stdout.as_mut()) {
            output.read_to_string(&mut printed).into_diagnostic()?;
        }
        Ok(printed)
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for child in &mut self.children {
            // Killing a process that has exited fails, which is fine.
            let _ended_already = child.kill();
            let _ended_already = child.wait();
        }
    }
}
