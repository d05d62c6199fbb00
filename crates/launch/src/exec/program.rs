//! The process of the program: its start, its pipes, its end.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use nix::sys::signal::Signal;
use nix::sys::wait::{Id, WaitPidFlag, waitid};
use nix::unistd::Pid;
use protocol::RobotName;
use robot::Stopper;

use super::line::{EndReason, ToProgram};
use crate::child::{self, AtExit};
use crate::ending::ProcessEnd;
use crate::error::LaunchError;
use crate::lines::Lines;
use crate::tail::Tail;

/// Signals that end this process, and the program with it.
pub(super) const ASKING: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
/// How long a program may take to exit before it is killed.
pub(super) const END_PATIENCE: Duration = Duration::from_secs(2);
/// Longest line that a program may write, bytes.
pub(super) const MAX_LINE: usize = 1 << 20;
/// Capacity of the queue of lines; the program blocks while it is full.
const QUEUE: usize = 16;
/// Longest wait for the rest of the output of an exited program, in case another process holds its pipes.
const REST_OF_OUTPUT: Duration = Duration::from_secs(2);
/// How long the robot stays in the run after its program has exited. A program that answers a tick and exits has answered
/// it, and the report needs this time, because zenoh may let the undeclared token overtake it.
const LAST_REPORT: Duration = Duration::from_secs(1);

/// An event of the program.
#[derive(Debug)]
pub(super) enum ProgramEvent {
    /// A line.
    Line(Vec<u8>),
    /// The beginning of a line that is longer than [`MAX_LINE`].
    TooLong(Vec<u8>),
    /// It has closed its standard output.
    Closed,
    /// It has exited.
    Ended,
    /// A signal ends this process, and the program with it.
    Interrupted,
}

/// The process of the program.
pub(super) struct Program {
    child: Mutex<Child>,
    /// `None` once it has been closed.
    stdin: Mutex<Option<ChildStdin>>,
    tail: Tail,
    status: Mutex<Option<ExitStatus>>,
    /// Notified when `status` is set.
    ended: Condvar,
    queue: SyncSender<ProgramEvent>,
}

impl Program {
    /// Starts the program. Returns it and its events. Its exit also stops the robot's loop.
    pub(super) fn start(
        name: &RobotName,
        command: &[OsString],
        stopper: Arc<OnceLock<Stopper>>,
    ) -> Result<(Arc<Self>, Receiver<ProgramEvent>), LaunchError> {
        let mut child = spawn(command)?;
        let pid =
            i32::try_from(child.id()).map_err(LaunchError::system("the system's process id"))?;
        // Taken out of `child`: a thread that reads or writes must not wait for one that holds its
        // lock.
        let stdin = child.stdin.take();
        let stdout = child.stdout.take();
        let stderr = child.stderr.take();

        let (queue, events) = sync_channel(QUEUE);
        let program = Arc::new(Self {
            child: Mutex::new(child),
            stdin: Mutex::new(stdin),
            tail: Tail::default(),
            status: Mutex::new(None),
            ended: Condvar::new(),
            queue: queue.clone(),
        });

        // Each reader drops its sender at the end of its pipe, which closes `rest`.
        let (reading, rest) = sync_channel::<()>(1);
        if let Some(stdout) = stdout {
            let reading = reading.clone();
            start_thread(move || {
                read_lines(stdout, &queue);
                drop(reading);
            })?;
        }
        if let Some(stderr) = stderr {
            let tail = program.tail.clone();
            let name = name.clone();
            start_thread(move || {
                forward(stderr, &name, &tail);
                drop(reading);
            })?;
        }

        let watched = program.clone();
        start_thread(move || watched.watch(Pid::from_raw(pid), &rest, &stopper))?;
        Ok((program, events))
    }

    /// Waits for the exit of the program and the rest of its output, then reports the exit.
    fn watch(&self, pid: Pid, rest: &Receiver<()>, stopper: &OnceLock<Stopper>) {
        // The exited process stays a zombie until `child` is locked, so `kill` cannot hit a reused process id.
        while waitid(Id::Pid(pid), WaitPidFlag::WEXITED | WaitPidFlag::WNOWAIT)
            == Err(nix::errno::Errno::EINTR)
        {}

        let status = lock(&self.child).wait();
        let _another_process_holds_its_pipes =
            rest.recv_timeout(REST_OF_OUTPUT) == Err(RecvTimeoutError::Timeout);
        *lock(&self.status) = status.ok();
        self.ended.notify_all();

        // Between two ticks no thread receives events of the program.
        if let Some(stopper) = stopper.get().cloned() {
            let stop = stopper.clone();
            let stops_later = start_thread(move || {
                std::thread::sleep(LAST_REPORT);
                stop.stop();
            });
            if stops_later.is_err() {
                stopper.stop();
            }
        }

        // Last: after the lines that it has written, if its pipe was read to the end in time.
        let _over = self.queue.send(ProgramEvent::Ended);
    }

    /// Writes a line to the program.
    ///
    /// # Errors
    /// If its standard input is closed.
    pub(super) fn send(&self, message: &ToProgram<'_>) -> std::io::Result<()> {
        match lock(&self.stdin).as_mut() {
            Some(stdin) => stdin.write_all(&message.line()),
            None => Err(std::io::ErrorKind::BrokenPipe.into()),
        }
    }

    /// Its exit status, if it has exited.
    pub(super) fn status(&self) -> Option<ExitStatus> {
        *lock(&self.status)
    }

    /// Waits for its exit; returns `None` after `patience`.
    pub(super) fn wait(&self, patience: Duration) -> Option<ExitStatus> {
        let waited = self
            .ended
            .wait_timeout_while(lock(&self.status), patience, |status| status.is_none());
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Whether one of the signals in [`ASKING`] has killed it.
    pub(super) fn was_ended_by_signal(&self) -> bool {
        use std::os::unix::process::ExitStatusExt;
        let signal = self.status().and_then(|status| status.signal());
        signal.is_some_and(|signal| ASKING.iter().any(|asking| *asking as i32 == signal))
    }

    /// Explains why the program writes no more lines: its exit status and the last lines of its error output, or
    /// `otherwise` if it is still running.
    pub(super) fn explain_end(&self, otherwise: &str) -> String {
        // A program that closes its output is most likely about to exit, and its status says more.
        let Some(status) = self.wait(REST_OF_OUTPUT) else {
            return otherwise.to_owned();
        };

        let ended = format!(
            "its program {} before the run did",
            ProcessEnd::Exited(status)
        );

        let lines = self.tail.lines();
        if lines.is_empty() {
            return format!("{ended}, and wrote no errors");
        }
        let lines = lines.join("\n  ");
        format!("{ended}; the last lines that it wrote as errors:\n  {lines}")
    }

    /// Interrupts a tick that waits for the program.
    pub(super) fn interrupt(&self) {
        // If the queue is full, the tick is not waiting.
        let _woken = self.queue.try_send(ProgramEvent::Interrupted);
    }

    /// Sends the line `end` and closes the pipe; kills the program if it does not exit in time. Returns what is wrong with its
    /// end, which no other line tells.
    pub(super) fn end(self: &Arc<Self>, reason: EndReason) -> Option<String> {
        // A program that does not read blocks this thread until it is killed.
        let program = self.clone();
        let says_so = start_thread(move || {
            let _gone = program.send(&ToProgram::End { reason });
            drop(lock(&program.stdin).take());
        });
        if says_so.is_err() {
            // The end of its input is all that it learns.
            drop(lock(&self.stdin).take());
        }

        // `wait` is about the exit and the rest of the output; where another process holds the pipes,
        // the program may have exited all the same.
        if self.wait(END_PATIENCE).is_none() && !self.has_exited() {
            self.kill();
            self.wait(END_PATIENCE);
            return Some(format!(
                "its program had not exited {} s after the line `end`, and was killed",
                END_PATIENCE.as_secs()
            ));
        }

        let status = self.wait(END_PATIENCE).filter(|status| !status.success())?;
        Some(format!(
            "its program {} after the line `end`, where exit status 0 is expected",
            ProcessEnd::Exited(status)
        ))
    }

    /// Whether the process has exited, although another one may hold its pipes.
    fn has_exited(&self) -> bool {
        matches!(lock(&self.child).try_wait(), Ok(Some(_)))
    }

    /// Kills the program.
    pub(super) fn kill(&self) {
        // Killing a program that has exited fails, which is fine.
        let _gone = lock(&self.child).kill();
    }
}

/// Starts a thread.
///
/// # Errors
/// If the system starts no further one.
pub(super) fn start_thread(work: impl FnOnce() + Send + 'static) -> Result<(), LaunchError> {
    let started = std::thread::Builder::new().spawn(work);
    started
        .map(drop)
        .map_err(LaunchError::system("no thread can be started"))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Values are replaced as a whole, so a panic leaves a consistent one.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts the program, which ends with this process, with all three standard streams as pipes.
fn spawn(command: &[OsString]) -> Result<Child, LaunchError> {
    let Some((program, arguments)) = command.split_first() else {
        return Err(LaunchError::refused("no program is given"));
    };

    child::command(AtExit::Kill, program)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|source| LaunchError::NotStarted {
            program: "the program".to_owned(),
            source,
        })
}

/// Queues the lines of the program's standard output until its end. The queue is closed only when this process ends.
fn read_lines(stdout: ChildStdout, queue: &SyncSender<ProgramEvent>) {
    let mut stdout = BufReader::new(stdout);
    loop {
        let event = read_line(&mut stdout);
        let is_last = !matches!(event, ProgramEvent::Line(_));
        if queue.send(event).is_err() || is_last {
            return;
        }
    }
}

/// The next line; the last one may have no end.
fn read_line(stdout: &mut BufReader<ChildStdout>) -> ProgramEvent {
    let mut line = Vec::new();
    // One byte more than allowed, so that a line which is too long is told from one that just fits.
    let mut limited = stdout.by_ref().take(MAX_LINE as u64 + 1);
    match limited.read_until(b'\n', &mut line) {
        Ok(0) | Err(_) => ProgramEvent::Closed,
        Ok(_) if line.len() > MAX_LINE && !line.ends_with(b"\n") => ProgramEvent::TooLong(line),
        Ok(_) => ProgramEvent::Line(line),
    }
}

/// Copies the program's error output line by line to this process's, and keeps the last lines.
fn forward(mut stderr: ChildStderr, name: &RobotName, tail: &Tail) {
    let mut buffer = vec![0; 16 * 1024];
    let mut lines = Lines::default();
    let show = |line: String| {
        // A closed error output of this process must not affect the program.
        let _unread = writeln!(std::io::stderr(), "{name}: {line}");
        tail.push(line);
    };
    while let Ok(read @ 1..) = stderr.read(&mut buffer) {
        lines.push(&buffer[..read], show);
    }

    lines.finish(show);
}
