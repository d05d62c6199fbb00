//! One process: its group, its output, its end. The rest of a group is killed when its leader exits, and every group is
//! killed when the launcher's task ends.

use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use process_wrap::tokio::{ChildWrapper, CommandWrap, KillOnDrop, ProcessGroup};
use tokio::io::{AsyncRead, AsyncReadExt};

use super::lines::Lines;
use super::log::ProcessLog;
use super::plan::CommandLine;
use super::screen::ScreenHandle;
use super::tail::Tail;

/// Longest wait for the rest of the output of an exited process, in case another process holds its pipes.
const REST_OF_OUTPUT: Duration = Duration::from_millis(500);

/// A process group, by its leader.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group(pub(super) Pid);

impl Group {
    /// Sends a signal to every process of the group, if there is one left.
    pub(super) fn signal(self, signal: Signal) {
        let _gone = killpg(self.0, signal);
    }
}

/// Kills the rest of a group on drop: after its leader has exited, or when the launcher ends, also by a panic.
#[derive(Debug)]
struct KillGroup(Group);

impl Drop for KillGroup {
    fn drop(&mut self) {
        self.0.signal(Signal::SIGKILL);
    }
}

/// Where the output of a process goes.
#[derive(Debug, Clone)]
pub(super) struct OutputSink {
    pub(super) screen: ScreenHandle,
    /// Index of the process.
    pub(super) index: usize,
    pub(super) log: ProcessLog,
    pub(super) tail: Tail,
}

/// A process that has been started.
pub(super) struct Started {
    pub(super) group: Group,
    child: Box<dyn ChildWrapper>,
    kill: KillGroup,
}

/// Starts a process as the leader of a group of its own: signals to the group reach its descendants, and Ctrl-C on the
/// terminal reaches only the launcher.
pub(super) fn start(command: &CommandLine) -> std::io::Result<Started> {
    let mut wrapped = CommandWrap::with_new(&command.program, |inner| {
        inner.args(&command.args).envs(&command.env);
        inner
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
    });
    let wrapped = wrapped.wrap(ProcessGroup::leader()).wrap(KillOnDrop);
    let child = wrapped.spawn()?;

    let pid = child.id().and_then(|id| i32::try_from(id).ok());
    let pid = pid.ok_or_else(|| std::io::Error::other("the system gave no process id"))?;
    let group = Group(Pid::from_raw(pid));

    Ok(Started {
        group,
        child,
        kill: KillGroup(group),
    })
}

/// How often to look whether a process is stopped.
const LOOK_EVERY: Duration = Duration::from_millis(300);

/// Tells people when a process is stopped by a signal or a debugger, and when it runs again. Returns when it has exited, and
/// at once on systems without `/proc`.
pub(super) async fn watch_stops(group: Group, name: String, screen: ScreenHandle) {
    let file = format!("/proc/{}/stat", group.0);
    let mut was_stopped = false;

    // The name of the program, in parentheses, may contain anything; the state follows it.
    while let Ok(text) = std::fs::read_to_string(&file)
        && let Some((_, fields)) = text.rsplit_once(") ")
    {
        let is_stopped = fields.starts_with(['T', 't']);
        if is_stopped != was_stopped {
            screen.notice(if is_stopped {
                format!("{name} is stopped by a signal or a debugger, and the clock is held")
            } else {
                format!("{name} runs again")
            });
        }

        was_stopped = is_stopped;
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

impl Started {
    /// Waits for the exit of the process and the end of its output.
    pub(super) async fn run(mut self, output: OutputSink) -> std::io::Result<ExitStatus> {
        output.log.open()?;
        let mut copies = Vec::new();
        if let Some(pipe) = self.child.stdout().take() {
            copies.push(tokio::spawn(copy(pipe, output.clone(), false)));
        }
        if let Some(pipe) = self.child.stderr().take() {
            copies.push(tokio::spawn(copy(pipe, output, true)));
        }
        // Its output is copied meanwhile, by tasks of their own: a full pipe would keep it from
        // exiting.
        let status = self.child.wait().await;

        // Processes that the leader left behind would keep the pipes open.
        drop(self.kill);
        for copying in copies {
            let _given_up = tokio::time::timeout(REST_OF_OUTPUT, copying).await;
        }

        status
    }
}

/// Copies a pipe: bytes to the log, lines to the terminal.
async fn copy(mut pipe: impl AsyncRead + Unpin, output: OutputSink, is_error: bool) {
    let mut buffer = vec![0; 16 * 1024];
    let mut lines = Lines::default();
    while let Ok(read @ 1..) = pipe.read(&mut buffer).await {
        let bytes = &buffer[..read];
        // A full disk must not stop a robot; the terminal still has the lines.
        let _unwritten = output.log.append(bytes);
        lines.push(bytes, |line| show(&output, line, is_error));
    }
    lines.finish(|line| show(&output, line, is_error));
}

fn show(output: &OutputSink, line: String, is_error: bool) {
    if is_error {
        output.tail.push(line.clone());
    }
    output.screen.output(output.index, line, is_error);
}
