//! The program: its start, its pipes, its end.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use miette::{IntoDiagnostic, WrapErr};
use nix::sys::signal::Signal;
use nix::sys::wait::{Id, WaitPidFlag, waitid};
use nix::unistd::Pid;
use protocol::RobotName;
use robot::Stopper;

use super::line::{EndReason, Told};
use crate::ending::Ended;
use crate::lines::Lines;
use crate::tail::Tail;

/// Signals that ask to end.
pub(super) const ASKING: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];
/// How long a program that is told to end has for it.
pub(super) const END_PATIENCE: Duration = Duration::from_secs(2);
/// Longest line that a program may write, bytes.
pub(super) const MAX_LINE: usize = 1 << 20;
/// Lines that are read before the program must wait for them to be heeded.
const QUEUE: usize = 16;
/// Longest wait for the rest of what a program wrote that is over, should somebody else hold its pipes.
const REST_OF_OUTPUT: Duration = Duration::from_secs(2);
/// A program that answers a tick and dies has answered it: so long its robot stays, unless the next clock comes, for its
/// report to get through. The middleware may let its leaving overtake it.
const LAST_REPORT: Duration = Duration::from_secs(1);

/// What is heard of the program.
#[derive(Debug)]
pub(super) enum Heard {
    /// A line, without its end.
    Line(Vec<u8>),
    /// A line that is longer than [`MAX_LINE`]: its beginning.
    TooLong(Vec<u8>),
    /// It has closed its output.
    Closed,
    /// It is over.
    Ended,
    /// It is to end, because this process is.
    Interrupted,
}

/// The program, as this process holds it.
pub(super) struct Program {
    child: Mutex<Child>,
    /// `None` once it has been closed.
    stdin: Mutex<Option<ChildStdin>>,
    tail: Tail,
    status: Mutex<Option<ExitStatus>>,
    /// Told when there is a status.
    ended: Condvar,
    heard: SyncSender<Heard>,
}

impl Program {
    /// Starts the program. What it says comes out of the second; its end also stops the robot's loop.
    pub(super) fn start(
        name: &RobotName,
        command: &[OsString],
        stopper: Arc<OnceLock<Stopper>>,
    ) -> miette::Result<(Arc<Self>, Receiver<Heard>)> {
        let own = std::env::current_exe()
            .into_diagnostic()
            .wrap_err("this program does not find itself")?;
        let mut child = Command::new(own)
            .args(["exec-start", &std::process::id().to_string(), "--"])
            .args(command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .into_diagnostic()
            .wrap_err("the program cannot be started")?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
            unreachable!("all three are piped")
        };

        let pid = i32::try_from(child.id())
            .into_diagnostic()
            .wrap_err("the system's process id")?;
        let (tell, heard) = std::sync::mpsc::sync_channel(QUEUE);
        let program = Arc::new(Self {
            child: Mutex::new(child),
            stdin: Mutex::new(Some(stdin)),
            tail: Tail::default(),
            status: Mutex::new(None),
            ended: Condvar::new(),
            heard: tell.clone(),
        });

        // Dropped when there is nothing more to read.
        let (reading, rest) = std::sync::mpsc::sync_channel::<()>(1);
        let (also_reading, tail, name) = (reading.clone(), program.tail.clone(), name.clone());
        std::thread::spawn(move || {
            read_lines(stdout, &tell);
            drop(reading);
        });
        std::thread::spawn(move || {
            forward(stderr, &name, &tail);
            drop(also_reading);
        });
        let kept = program.clone();
        std::thread::spawn(move || kept.keep(Pid::from_raw(pid), &rest, &stopper));

        Ok((program, heard))
    }

    /// Waits for its end, and for what it had to say.
    fn keep(&self, pid: Pid, rest: &Receiver<()>, stopper: &OnceLock<Stopper>) {
        // It stays a zombie, so that its process id is nobody else's, until whoever might kill it knows.
        while waitid(Id::Pid(pid), WaitPidFlag::WEXITED | WaitPidFlag::WNOWAIT)
            == Err(nix::errno::Errno::EINTR)
        {}

        let status = lock(&self.child).wait();
        let _somebody_else_holds_its_pipes =
            rest.recv_timeout(REST_OF_OUTPUT) == Err(RecvTimeoutError::Timeout);
        *lock(&self.status) = status.ok();
        self.ended.notify_all();

        // Between two ticks nobody listens to the program.
        if let Some(stopper) = stopper.get().cloned() {
            std::thread::spawn(move || {
                std::thread::sleep(LAST_REPORT);
                stopper.stop();
            });
        }

        let _over = self.heard.send(Heard::Ended);
    }

    /// Writes a line to the program.
    ///
    /// # Errors
    /// It does not read any more.
    pub(super) fn tell(&self, told: &Told<'_>) -> std::io::Result<()> {
        match lock(&self.stdin).as_mut() {
            Some(stdin) => stdin.write_all(&told.line()),
            None => Err(std::io::ErrorKind::BrokenPipe.into()),
        }
    }

    /// How it ended, if it has.
    pub(super) fn status(&self) -> Option<ExitStatus> {
        *lock(&self.status)
    }

    /// Waits for its end.
    pub(super) fn wait(&self, patience: Duration) -> Option<ExitStatus> {
        let waited = self
            .ended
            .wait_timeout_while(lock(&self.status), patience, |status| status.is_none());
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Whether it was ended by a signal that asks to.
    pub(super) fn was_asked_to_end(&self) -> bool {
        use std::os::unix::process::ExitStatusExt;
        let signal = self.status().and_then(|status| status.signal());
        signal.is_some_and(|signal| ASKING.iter().any(|asking| *asking as i32 == signal))
    }

    /// What became of a program that says no more: how it ended and what it complained of, or `otherwise`.
    pub(super) fn account_or(&self, otherwise: &str) -> String {
        let Some(status) = self.wait(REST_OF_OUTPUT) else {
            return otherwise.to_owned();
        };

        let ended = format!("its program {} before the run did", Ended::Exited(status));

        match self.tail.lines() {
            lines if lines.is_empty() => format!("{ended}, and wrote no errors"),
            lines => format!(
                "{ended}; the last lines that it wrote as errors:\n  {}",
                lines.join("\n  ")
            ),
        }
    }

    /// Wakes whoever waits for the program in the middle of a tick.
    pub(super) fn interrupt(&self) {
        // A full queue is being read.
        let _woken = self.heard.try_send(Heard::Interrupted);
    }

    /// Tells it to end, gives it time to, and kills it if it does not.
    pub(super) fn end(self: &Arc<Self>, reason: EndReason) {
        // A program that does not read holds this thread until it is killed.
        let program = self.clone();
        std::thread::spawn(move || {
            let _gone = program.tell(&Told::End { reason });
            drop(lock(&program.stdin).take());
        });

        if self.wait(END_PATIENCE).is_none() {
            self.kill();
            self.wait(END_PATIENCE);
        }
    }

    /// Kills it.
    pub(super) fn kill(&self) {
        // One that is over already needs no signal.
        let _gone = lock(&self.child).kill();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is kept here is replaced as a whole: a panic leaves nothing half done.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads what the program says, line by line. A queue that nobody reads is the end of this process.
fn read_lines(stdout: ChildStdout, heard: &SyncSender<Heard>) {
    let mut stdout = BufReader::new(stdout);
    loop {
        let mut line = Vec::new();
        let read = stdout
            .by_ref()
            .take(MAX_LINE as u64 + 1)
            .read_until(b'\n', &mut line);
        let (word, is_over) = match read {
            Ok(1..) if line.ends_with(b"\n") => (Heard::Line(line), false),
            Ok(1..) if line.len() > MAX_LINE => (Heard::TooLong(line), true),
            // The last line, which has no end.
            Ok(1..) => (Heard::Line(line), false),
            Ok(0) | Err(_) => (Heard::Closed, true),
        };
        if heard.send(word).is_err() || is_over {
            return;
        }
    }
}

/// Hands the program's error output on, line by line.
fn forward(mut stderr: ChildStderr, name: &RobotName, tail: &Tail) {
    let (mut buffer, mut lines) = (vec![0; 16 * 1024], Lines::default());
    let show = |line: String| {
        // Who reads ours may be gone; the program is not to notice.
        let _unread = writeln!(std::io::stderr(), "{name}: {line}");
        tail.push(line);
    };

    while let Ok(read @ 1..) = stderr.read(&mut buffer) {
        lines.push(&buffer[..read], show);
    }

    lines.finish(show);
}
