//! Finds, signals and measures real processes.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::{PATIENCE, eventually, has_played};

/// A running program and its output so far.
pub struct Running {
    child: Child,
    run: String,
    /// Folder of its run.
    pub folder: PathBuf,
    printed: Arc<Mutex<Vec<(Instant, String)>>>,
}

impl Running {
    /// Starts a program.
    pub fn start(mut command: Command, run: &str, folder: PathBuf) -> Self {
        let mut child = mark(&mut command)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("cars starts");
        let printed = Arc::default();
        collect(child.stdout.take(), &printed);
        collect(child.stderr.take(), &printed);

        Self {
            child,
            run: run.to_owned(),
            folder,
            printed,
        }
    }

    /// Its output so far.
    #[must_use]
    pub fn printed(&self) -> String {
        let lines = self.printed.lock().expect("no reader panics");
        lines.iter().map(|(_, line)| format!("{line}\n")).collect()
    }

    /// Waits for a line of output that contains `text`; returns its time.
    pub fn prints(&mut self, text: &str) -> Instant {
        self.prints_after(text, None)
    }

    /// Waits for a line of output after a time; returns its time.
    pub fn prints_after(&mut self, text: &str, after: Option<Instant>) -> Instant {
        let begun = Instant::now();
        loop {
            if let Some(at) = self.find_printed(text, after) {
                return at;
            }

            let is_over = self.child.try_wait().expect("it is our child").is_some();
            assert!(
                !is_over && begun.elapsed() < PATIENCE,
                "it did not print {text:?} but\n{}",
                self.printed()
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn find_printed(&self, text: &str, after: Option<Instant>) -> Option<Instant> {
        let lines = self.printed.lock().expect("no reader panics");
        for (at, line) in lines.iter() {
            if after.is_none_or(|after| *at > after) && line.contains(text) {
                return Some(*at);
            }
        }
        None
    }

    /// Waits for its exit.
    pub fn wait(&mut self) -> ExitStatus {
        let begun = Instant::now();

        loop {
            if let Some(status) = self.child.try_wait().expect("it is our child") {
                return status;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "it does not end; it printed\n{}",
                self.printed()
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for its exit, which must be a success; any verdict on the run is one.
    pub fn finish(&mut self) {
        let status = self.wait();
        let has_succeeded = has_played(status, &self.folder);
        assert!(has_succeeded, "{status}:\n{}", self.printed());
    }

    /// Its process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal to the program.
    pub fn signal(&self, signal: Signal) {
        send(self.child.id(), signal);
    }

    /// Waits for the process of the run with this program.
    #[must_use]
    pub fn process(&self, program: &str) -> u32 {
        eventually(program, || {
            let processes = find(&self.run);
            let found = processes.into_iter().find(|(_, name)| name == program)?;
            Some(found.0)
        })
    }

    /// Waits until no process of the run with this program runs: all are stopped, or gone. One that was told to stop, or was killed, may
    /// do further ticks before that.
    pub fn until_down(&self, program: &str) {
        eventually("a process to be stopped", || {
            let mut processes = find(&self.run);
            processes.retain(|(_, name)| name == program);
            let is_stopped = |pid: u32| stat(pid).is_none_or(|stat| stat[0] == "T");
            processes
                .iter()
                .all(|(pid, _)| is_stopped(*pid))
                .then_some(())
        });
    }

    /// The processes of the run: those with its name in their environment or arguments, and the names of their programs.
    #[must_use]
    pub fn processes(&self) -> Vec<(u32, String)> {
        find(&self.run)
    }

    /// Processor time of the run's processes so far, seconds.
    #[must_use]
    pub fn cpu_s(&self) -> f64 {
        find(&self.run).iter().map(|(pid, _)| cpu_s(*pid)).sum()
    }
}

impl Drop for Running {
    #[expect(clippy::print_stdout, reason = "shown if the test fails")]
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("{} printed:\n{}", self.run, self.printed());
        }
        for (pid, _) in find(&self.run) {
            let _ = kill(pid_of(pid), Signal::SIGKILL);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn collect(from: Option<impl Read + Send + 'static>, into: &Arc<Mutex<Vec<(Instant, String)>>>) {
    let Some(from) = from else {
        return;
    };

    let into = into.clone();
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            into.lock()
                .expect("no reader panics")
                .push((Instant::now(), line));
        }
    });
}

fn pid_of(pid: u32) -> Pid {
    Pid::from_raw(i32::try_from(pid).expect("process ids are small"))
}

/// Sends a signal to a process.
pub fn send(pid: u32, signal: Signal) {
    kill(pid_of(pid), signal).expect("the process is there");
}

/// Waits until a run has no process any more.
pub fn nobody_is_left(run: &str) {
    eventually("the last process to be gone", || {
        find(run).is_empty().then_some(())
    });
}

/// Variable with the [`test`] that has started a process.
const TEST: &str = "CARS_TEST";

/// This process and the name of the test that its thread makes: the same test may run in two processes at the same time.
/// A thread without a name belongs to a test that nobody can tell.
fn test() -> Option<String> {
    let thread = std::thread::current();
    Some(format!("{}/{}", std::process::id(), thread.name()?))
}

/// Marks what a command starts as of this test: others may have runs of the same name at the same time.
pub fn mark(command: &mut Command) -> &mut Command {
    match test() {
        Some(test) => command.env(TEST, test),
        None => command,
    }
}

/// Whether another test has started a process; a thread without a name knows only those of this process.
fn is_of_other_test(pid: u32) -> bool {
    let own = match test() {
        Some(test) => format!("\0{TEST}={test}\0"),
        None => format!("\0{TEST}={}/", std::process::id()),
    };
    contains(pid, "environ", &format!("\0{TEST}=")) && !contains(pid, "environ", &own)
}

/// Processes of this test with the name of a run in their environment or arguments.
#[must_use]
pub fn find(run: &str) -> Vec<(u32, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").expect("this is Linux").flatten() {
        let name = entry.file_name();
        let Some(pid) = name.to_str().and_then(|name| name.parse().ok()) else {
            continue;
        };
        let is_found = pid != std::process::id() && is_of_run(pid, run) && !is_of_other_test(pid);
        if is_found && is_alive(pid) {
            found.push((pid, program(pid)));
        }
    }
    found
}

fn is_of_run(pid: u32, run: &str) -> bool {
    contains(pid, "environ", &format!("CARS_RUN={run}\0"))
        || contains(pid, "cmdline", &format!("--run={run}\0"))
        || contains(pid, "cmdline", &format!("--run\0{run}\0"))
}

/// Whether a file of a process in `/proc` contains a text.
fn contains(pid: u32, file: &str, text: &str) -> bool {
    let bytes = std::fs::read(format!("/proc/{pid}/{file}")).unwrap_or_default();
    let mut parts = bytes.windows(text.len());
    parts.any(|part| part == text.as_bytes())
}

/// Whether a process exists and is not a zombie.
fn is_alive(pid: u32) -> bool {
    let stat = stat(pid).unwrap_or_default();
    stat.first().is_some_and(|state| state != "Z")
}

/// The process of a run with the robot called `robot`.
#[must_use]
pub fn named(run: &str, robot: &str) -> Option<u32> {
    let argument = format!("--name\0{robot}\0");
    let mut pids = find(run).into_iter().map(|(pid, _)| pid);
    pids.find(|pid| contains(*pid, "cmdline", &argument))
}

/// The name of a process's program.
fn program(pid: u32) -> String {
    let target = std::fs::read_link(format!("/proc/{pid}/exe")).unwrap_or_default();
    let file = target.file_name().unwrap_or_default();
    file.to_string_lossy().into_owned()
}

/// The fields of `/proc/PID/stat` from the state on.
fn stat(pid: u32) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, fields) = text.rsplit_once(')')?;
    Some(fields.split_whitespace().map(str::to_owned).collect())
}

fn cpu_s(pid: u32) -> f64 {
    let Some(stat) = stat(pid) else {
        return 0.0;
    };

    // proc(5): utime and stime are fields 14 and 15, in clock ticks of 10 ms.
    let mut ticks = 0.0;
    for field in stat.iter().skip(11).take(2) {
        ticks += field.parse::<f64>().unwrap_or(0.0);
    }
    ticks / 100.0
}
