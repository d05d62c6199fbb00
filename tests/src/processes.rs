//! Real processes: found, stopped, killed, measured.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::{PATIENCE, eventually};

/// A program that runs, with all that it has printed so far.
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
        let mut child = command
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

    /// All that it has printed.
    #[must_use]
    pub fn printed(&self) -> String {
        let lines = self.printed.lock().expect("no reader panics");
        lines.iter().map(|(_, line)| format!("{line}\n")).collect()
    }

    /// Waits until it prints a line that contains `text`, and returns when that was.
    pub fn prints(&mut self, text: &str) -> Instant {
        self.prints_after(text, None)
    }

    /// The same, but only what it prints after a moment counts.
    pub fn prints_after(&mut self, text: &str, after: Option<Instant>) -> Instant {
        let printed = self.printed.clone();
        let begun = Instant::now();

        loop {
            let found = printed
                .lock()
                .expect("no reader panics")
                .iter()
                .find(|(at, line)| after.is_none_or(|after| *at > after) && line.contains(text))
                .map(|(at, _)| *at);
            if let Some(at) = found {
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

    /// Waits for its end.
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

    /// Waits for its end, which must be a success.
    pub fn finish(&mut self) {
        let status = self.wait();
        assert!(status.success(), "{status}:\n{}", self.printed());
    }

    /// Its process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends the program itself a signal.
    pub fn signal(&self, signal: Signal) {
        send(self.child.id(), signal);
    }

    /// The process of the run whose program is called `program`, once it is there.
    #[must_use]
    pub fn process(&self, program: &str) -> u32 {
        eventually(program, || {
            find(&self.run)
                .into_iter()
                .find(|(_, name)| name == program)
                .map(|(pid, _)| pid)
        })
    }

    /// The run's processes: those that carry its name in their environment or arguments, with their programs' names.
    #[must_use]
    pub fn processes(&self) -> Vec<(u32, String)> {
        find(&self.run)
    }

    /// Processor time that the run's processes have used so far, seconds.
    #[must_use]
    pub fn cpu_s(&self) -> f64 {
        find(&self.run).iter().map(|(pid, _)| cpu_s(*pid)).sum()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        for (pid, _) in find(&self.run) {
            let _ = kill(pid_of(pid), Signal::SIGKILL);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn collect(from: Option<impl Read + Send + 'static>, into: &Arc<Mutex<Vec<(Instant, String)>>>) {
    let (Some(from), into) = (from, into.clone()) else {
        return;
    };

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

/// Sends a process a signal.
pub fn send(pid: u32, signal: Signal) {
    kill(pid_of(pid), signal).expect("the process is there");
}

/// Processes whose environment or arguments carry the name of a run. A test gives its runs names that no other has.
#[must_use]
pub fn find(run: &str) -> Vec<(u32, String)> {
    let is_of_run = |pid: u32| {
        let read = |file: &str| std::fs::read(format!("/proc/{pid}/{file}")).unwrap_or_default();
        let holds = |bytes: Vec<u8>, text: String| {
            bytes
                .windows(text.len())
                .any(|part| part == text.as_bytes())
        };
        let arguments = |separator| format!("--run{separator}{run}\0");
        holds(read("environ"), format!("CARS_RUN={run}\0"))
            || holds(read("cmdline"), arguments('='))
            || holds(read("cmdline"), arguments('\0'))
    };
    let pids = std::fs::read_dir("/proc").expect("this is Linux").flatten();
    let pids = pids.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let own = std::process::id();
    let alive =
        |pid: &u32| stat(*pid).is_some_and(|stat| stat.first().is_some_and(|state| state != "Z"));

    pids.filter(|pid| *pid != own && is_of_run(*pid) && alive(pid))
        .map(|pid| (pid, program(pid)))
        .collect()
}

/// The process of a run that runs the robot called `robot`, if it is there.
#[must_use]
pub fn named(run: &str, robot: &str) -> Option<u32> {
    let argument = format!("--name\0{robot}\0");
    let is_robot = |pid: u32| {
        let arguments = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        arguments
            .windows(argument.len())
            .any(|part| part == argument.as_bytes())
    };

    find(run)
        .into_iter()
        .find(|(pid, _)| is_robot(*pid))
        .map(|(pid, _)| pid)
}

fn program(pid: u32) -> String {
    let target = std::fs::read_link(format!("/proc/{pid}/exe")).unwrap_or_default();
    target
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// The fields of `/proc/PID/stat` from the state on.
fn stat(pid: u32) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    Some(
        text.rsplit_once(')')?
            .1
            .split_whitespace()
            .map(str::to_owned)
            .collect(),
    )
}

fn cpu_s(pid: u32) -> f64 {
    // proc(5): utime and stime are fields 14 and 15, in clock ticks of 10 ms.
    let field = |stat: &[String], i: usize| {
        stat.get(i)
            .and_then(|text| text.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    stat(pid).map_or(0.0, |stat| (field(&stat, 11) + field(&stat, 12)) / 100.0)
}
