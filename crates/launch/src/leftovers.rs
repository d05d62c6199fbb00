//! What the processes of robots leave behind: programs that they started and that outlive them. A process group has most of
//! them; one that makes a session of its own is found by a variable in its environment.
//!
//! The launcher kills them when a process has ended, and at the end of the run. A small process beside the launcher does so if
//! the launcher is killed: it waits for the end of a pipe that the launcher holds. Where there is no `/proc` only the groups are
//! known. A program that both leaves its group and clears its environment is not found.

use std::collections::BTreeSet;
use std::io::{BufRead, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;

use super::child::own_program;

/// Environment variable of the processes of robots, and of what they start: the launch and the process.
const MARK: &str = "CARS_LAUNCHED_BY";
/// Most searches for what is left: programs may start others meanwhile.
const SEARCHES: usize = 50;
/// Wait between two searches: a killed process takes a moment to disappear.
const SEARCH_AGAIN: Duration = Duration::from_millis(5);

/// The marks of a launch, and the process that acts on them if the launcher is killed.
#[derive(Debug)]
pub(super) struct Leftovers {
    launch: String,
    guard: Option<Child>,
}

impl Leftovers {
    /// Marks of a launch without a process beside it.
    pub(super) fn unguarded() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_ns = now.unwrap_or_default().as_nanos();
        Self {
            launch: format!("{}-{now_ns}", std::process::id()),
            guard: None,
        }
    }

    /// Marks of a launch, with a process that outlives this one, which must be `cars`.
    pub(super) fn guarded() -> Self {
        let mut leftovers = Self::unguarded();
        let guard = Command::new(own_program())
            .args(["guard", &leftovers.launch])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // What ends the group of the launcher does not end it.
            .process_group(0)
            .spawn();

        match guard {
            Ok(guard) => leftovers.guard = Some(guard),
            Err(error) => tracing::warn!(
                "programs that robots start will go on if the launcher is killed: {error}"
            ),
        }
        leftovers
    }

    /// The variable that marks a process and what it starts.
    pub(super) fn mark(&self, process: &str) -> (String, String) {
        (MARK.to_owned(), format!("{}/{process}", self.launch))
    }

    /// Notes a process group that the guard ends.
    pub(super) fn add(&mut self, group: Pid) {
        self.tell_guard(&format!("+{group}\n"));
    }

    /// Forgets a process group: its number may be that of another one soon.
    pub(super) fn remove(&mut self, group: Pid) {
        self.tell_guard(&format!("-{group}\n"));
    }

    fn tell_guard(&mut self, line: &str) {
        let guard = self.guard.as_mut();
        if let Some(pipe) = guard.and_then(|guard| guard.stdin.as_mut()) {
            // A guard that was killed guards nothing.
            let _gone = pipe.write_all(line.as_bytes());
        }
    }

    /// Kills what a process has left behind; returns the names of the programs with their process ids.
    pub(super) fn kill_of(&self, process: &str) -> BTreeSet<String> {
        let (name, value) = self.mark(process);
        kill_marked(|entry| entry == format!("{name}={value}").as_bytes())
    }

    /// Kills what all processes of the launch have left behind.
    pub(super) fn kill_all(&self) -> BTreeSet<String> {
        kill_marked(is_of(&self.launch))
    }
}

impl Drop for Leftovers {
    /// Ends the guard, which has nothing more to do than after a kill.
    fn drop(&mut self) {
        // The end of the pipe is its sign. It has nothing to kill then, and ends at once.
        if let Some(mut guard) = self.guard.take() {
            drop(guard.stdin.take());
            let _reaped = guard.wait();
        }
    }
}

/// Waits for the end of the launcher that holds the other end of the standard input, and kills what the processes of its
/// robots leave behind.
///
/// # Errors
/// If the standard input cannot be read.
pub fn guard(launch: &str) -> std::io::Result<()> {
    let mut groups = BTreeSet::new();
    // Until the launcher closes its end, which it does on drop, or the kernel does when it is killed.
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        match line.split_at_checked(1) {
            Some(("+", group)) => groups.extend(group.parse::<i32>()),
            Some((_, group)) => {
                if let Ok(group) = group.parse::<i32>() {
                    groups.remove(&group);
                }
            }
            None => {}
        }
    }

    // Groups first: one signal reaches most programs at once.
    for group in groups {
        let _gone = killpg(Pid::from_raw(group), Signal::SIGKILL);
    }
    kill_marked(is_of(launch));
    Ok(())
}

/// Whether an entry of an environment is the mark of a launch.
fn is_of(launch: &str) -> impl Fn(&[u8]) -> bool {
    let prefix = format!("{MARK}={launch}/");
    move |entry| entry.starts_with(prefix.as_bytes())
}

/// Kills all processes with such an entry in their environments, also those that these start meanwhile.
fn kill_marked(is_mark: impl Fn(&[u8]) -> bool) -> BTreeSet<String> {
    let mut killed = BTreeSet::new();
    // Until a search finds none: a program that was not killed yet may have started another one after
    // it was looked at. The number of searches is limited, because a program may start others for ever.
    for _ in 0..SEARCHES {
        let found = marked(&is_mark);
        if found.is_empty() {
            break;
        }

        for pid in found {
            let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
            killed.insert(format!("{} ({pid})", name.trim_end()));
            let _gone = kill(pid, Signal::SIGKILL);
        }
        std::thread::sleep(SEARCH_AGAIN);
    }
    killed
}

/// The running processes with such an entry in their environments. A zombie has no environment.
fn marked(is_mark: impl Fn(&[u8]) -> bool) -> Vec<Pid> {
    let Ok(processes) = std::fs::read_dir("/proc") else {
        return Vec::new();
    };

    let mut found = Vec::new();
    for process in processes.flatten() {
        let name = process.file_name();
        let pid = name.to_str().and_then(|name| name.parse().ok());
        // Processes of other users cannot be read: they are none of this launch.
        let environment = std::fs::read(process.path().join("environ"));
        if let (Some(pid), Ok(environment)) = (pid, environment)
            && environment.split(|byte| *byte == 0).any(&is_mark)
        {
            found.push(Pid::from_raw(pid));
        }
    }
    found
}
