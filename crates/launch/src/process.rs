//! One process: its group, its output, its end. Nothing of a group outlives its leader, and no group outlives the
//! launcher's own tasks.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::Arc;
use std::time::Duration;

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use process_wrap::tokio::{ChildWrapper, CommandWrap, KillOnDrop, ProcessGroup};
use tokio::io::{AsyncRead, AsyncReadExt};

use super::lines::Lines;
use super::plan::CommandLine;
use super::screen::Tell;
use super::tail::Tail;

/// Longest wait for the rest of the output of a process that is over, should somebody else hold its pipes.
const REST_OF_OUTPUT: Duration = Duration::from_millis(500);

/// A process group, by its leader.
#[derive(Debug, Clone, Copy)]
pub(super) struct Group(Pid);

impl Group {
    /// Sends a signal to every process of the group; a group that is gone needs none.
    pub(super) fn signal(self, signal: Signal) {
        let _gone = killpg(self.0, signal);
    }
}

/// Kills what is left of a group when dropped: at the end of its leader, or of the launcher, however that comes.
#[derive(Debug)]
struct KillGroup(Group);

impl Drop for KillGroup {
    fn drop(&mut self) {
        self.0.signal(Signal::SIGKILL);
    }
}

/// Where the output of a process goes.
#[derive(Debug, Clone)]
pub(super) struct Output {
    pub(super) tell: Tell,
    /// Its place among the processes.
    pub(super) index: usize,
    /// Its log.
    pub(super) log: PathBuf,
    pub(super) tail: Tail,
}

/// A process that has been started.
pub(super) struct Started {
    pub(super) group: Group,
    child: Box<dyn ChildWrapper>,
    kill: KillGroup,
}

/// Starts a process as the leader of a group of its own, so that a signal reaches whatever it starts in turn and
/// Ctrl-C on the terminal reaches nobody but the launcher.
pub(super) fn start(command: &CommandLine) -> std::io::Result<Started> {
    let mut wrapped = CommandWrap::with_new(&command.program, |inner| {
        inner.args(&command.args).envs(&command.env);
        inner
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
    });
    let child = wrapped
        .wrap(ProcessGroup::leader())
        .wrap(KillOnDrop)
        .spawn()?;
    let pid = child.id().and_then(|id| i32::try_from(id).ok());
    let pid = pid.ok_or_else(|| std::io::Error::other("the system gave no process id"))?;
    let group = Group(Pid::from_raw(pid));

    Ok(Started {
        group,
        child,
        kill: KillGroup(group),
    })
}

impl Started {
    /// Waits for the end of the process and of its output.
    pub(super) async fn run(mut self, output: Output) -> std::io::Result<ExitStatus> {
        let file = Arc::new(open_log(&output.log)?);
        let out = self
            .child
            .stdout()
            .take()
            .map(|pipe| tokio::spawn(copy(pipe, file.clone(), output.clone(), false)));
        let err = self
            .child
            .stderr()
            .take()
            .map(|pipe| tokio::spawn(copy(pipe, file, output, true)));
        let status = self.child.wait().await;

        // What the leader left behind would hold the pipes, and the run.
        drop(self.kill);

        for copying in [out, err].into_iter().flatten() {
            let _given_up = tokio::time::timeout(REST_OF_OUTPUT, copying).await;
        }

        status
    }
}

/// Opened to append, so that two pipes, and a restarted process, write one after the other.
fn open_log(path: &Path) -> std::io::Result<File> {
    File::options().create(true).append(true).open(path)
}

/// Copies a pipe: as it is to the log, by lines to the terminal.
async fn copy(mut pipe: impl AsyncRead + Unpin, log: Arc<File>, output: Output, is_error: bool) {
    let mut buffer = vec![0; 16 * 1024];
    let mut lines = Lines::default();
    while let Ok(read @ 1..) = pipe.read(&mut buffer).await {
        let bytes = &buffer[..read];
        // A full disk must not stop a robot; the terminal still has the lines.
        let _unwritten = (&*log).write_all(bytes);
        lines.push(bytes, |line| show(&output, line, is_error));
    }
    lines.finish(|line| show(&output, line, is_error));
}

fn show(output: &Output, line: String, is_error: bool) {
    if is_error {
        output.tail.push(line.clone());
    }
    output.tell.output(output.index, line, is_error);
}
