//! The robot's process: started in a group of its own, watched, and never left behind.

use std::collections::BTreeSet;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use crate::load::ProcessGroup;
use crate::stdio::without_reports;

/// What is shown of a program's output, bytes from its end.
const TAIL_BYTES: u64 = 1500;
/// What is read of the beginning of a program's standard output, bytes: more than `cars exec` ever reports.
const HEAD_BYTES: u64 = 1 << 16;

/// The same command again.
pub fn copy(command: &Command) -> Command {
    let mut own = Command::new(command.get_program());
    own.args(command.get_args());

    if let Some(folder) = command.get_current_dir() {
        own.current_dir(folder);
    }

    for (name, value) in command.get_envs() {
        match value {
            Some(value) => own.env(name, value),
            None => own.env_remove(name),
        };
    }

    own
}

/// The groups of all robots that run.
static GROUPS: Mutex<BTreeSet<Pid>> = Mutex::new(BTreeSet::new());

/// Kills all robots, before this process ends by a signal. No further one is started.
pub fn kill_all() {
    let groups = GROUPS.lock().unwrap_or_else(PoisonError::into_inner);
    for group in groups.iter() {
        // One that has ended needs none.
        let _ended = killpg(*group, Signal::SIGKILL);
    }
    // Whoever starts a robot at this moment waits for the lock until the process ends.
    std::mem::forget(groups);
}

/// A robot's process, with all that it started.
pub struct RobotProcess {
    child: Child,
    group: ProcessGroup,
    output: File,
    errors: File,
    ended: Option<ExitStatus>,
}

impl RobotProcess {
    /// Starts the command as it is, with more in its environment.
    pub fn start(command: &Command, environment: &[(&str, String)]) -> std::io::Result<Self> {
        // Files, not pipes: a program that prints much is never blocked by a kit that does not read.
        let output = tempfile::tempfile()?;
        let errors = tempfile::tempfile()?;
        let mut own = copy(command);
        own.envs(environment.iter().map(|(name, value)| (name, value)));
        own.stdin(Stdio::null())
            .stdout(output.try_clone()?)
            .stderr(errors.try_clone()?);

        let mut groups = GROUPS.lock().unwrap_or_else(PoisonError::into_inner);
        let child = own.process_group(0).spawn()?;
        let id = i32::try_from(child.id()).map_err(std::io::Error::other)?;
        let group = Pid::from_raw(id);
        groups.insert(group);
        Ok(Self {
            child,
            group: ProcessGroup(group),
            output,
            errors,
            ended: None,
        })
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.ended.is_none() {
            // It is our child and was not waited for before: asking cannot fail.
            self.ended = self.child.try_wait().ok().flatten();
        }
        self.ended
    }

    /// Sends a signal to the program and all that it started, as a launcher does.
    pub fn signal(&self, signal: Signal) {
        // A group that has ended needs none.
        let _ended = killpg(self.group.0, signal);
    }

    /// Whether the program, and all that it started, is stopped by a signal.
    pub fn is_stopped(&self) -> bool {
        self.group.is_stopped()
    }

    /// Whether the program, and all that it started, rests.
    pub fn is_idle(&self) -> bool {
        self.group.is_idle()
    }

    /// How long its threads have waited for a processor so far.
    pub fn starved(&self) -> Duration {
        self.group.starved()
    }

    /// The beginning of what it wrote to its standard output.
    pub fn output(&self) -> String {
        String::from_utf8_lossy(&first_bytes(&self.output).unwrap_or_default()).into_owned()
    }

    /// How much it wrote to its standard error, bytes.
    pub fn error_bytes(&self) -> u64 {
        self.errors.metadata().map_or(0, |metadata| metadata.len())
    }

    /// The last that it wrote to its standard error.
    pub fn errors(&self) -> String {
        tail(&self.errors)
    }

    /// What became of it, in words.
    pub fn fate(&mut self) -> String {
        let fate = match self.ended() {
            None => "it runs".to_owned(),
            Some(status) => format!("its process has ended ({status})"),
        };

        let printed = [without_reports(&tail(&self.output)), self.errors()]
            .join("\n")
            .trim()
            .to_owned();
        if printed.is_empty() {
            return format!("{fate} and has printed nothing");
        }
        format!("{fate} and has printed: {printed}")
    }
}

/// The end of a file that may still be written.
fn tail(file: &File) -> String {
    String::from_utf8_lossy(&last_bytes(file).unwrap_or_default())
        .trim()
        .to_owned()
}

/// Reads in place, at most [`HEAD_BYTES`].
fn first_bytes(file: &File) -> std::io::Result<Vec<u8>> {
    let length = file.metadata()?.len().min(HEAD_BYTES);
    let mut bytes = vec![0; usize::try_from(length).map_err(std::io::Error::other)?];
    file.read_exact_at(&mut bytes, 0)?;

    Ok(bytes)
}

/// Reads in place: the file's cursor belongs to the writer.
fn last_bytes(file: &File) -> std::io::Result<Vec<u8>> {
    let length = file.metadata()?.len();
    let from = length.saturating_sub(TAIL_BYTES);
    let mut bytes = vec![0; usize::try_from(length - from).map_err(std::io::Error::other)?];
    file.read_exact_at(&mut bytes, from)?;

    Ok(bytes)
}

impl Drop for RobotProcess {
    fn drop(&mut self) {
        self.signal(Signal::SIGKILL);
        // Before its number is free for another process.
        let mut groups = GROUPS.lock().unwrap_or_else(PoisonError::into_inner);
        groups.remove(&self.group.0);
        drop(groups);
        // Only our own child can be waited for; what it started ends with the group.
        let _ = self.child.wait();
    }
}
