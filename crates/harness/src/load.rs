//! What the system knows of the robot's processes: whether they rest, and how long they waited for a processor. It is how
//! the kit tells a robot that does nothing from a robot that a loaded machine does not let run.

use std::path::Path;
use std::thread::available_parallelism;
use std::time::Duration;

use nix::unistd::Pid;

/// So many programs for each processor make a machine busy. A kit by itself makes up to five.
const BUSY: f64 = 8.0;

/// How often it is looked how many programs run or wait now, and the time between two looks.
const LOOKS: u32 = 10;
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// Whether so many programs of this machine run or wait for a processor, on average over the last minute or right now, that a
/// robot which does nothing wrong may lose its link. Where the system does not show it, it is taken to be at rest.
pub fn is_machine_busy() -> bool {
    let processors = available_parallelism().map_or(1.0, |count| count.get() as f64);
    let mut now = 0.0;
    for _ in 0..LOOKS {
        let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let (over_a_minute, runnable) = load(&text);
        if over_a_minute > BUSY * processors {
            return true;
        }
        now += runnable / f64::from(LOOKS);
        std::thread::sleep(BETWEEN_LOOKS);
    }
    now > BUSY * processors
}

/// How many programs run or wait on average over the last minute, and how many do now: proc(5) has the averages over 1, 5 and
/// 15 minutes, and then the number now before a slash.
fn load(text: &str) -> (f64, f64) {
    let number = |text: Option<&str>| text.and_then(|text| text.parse().ok()).unwrap_or_default();
    let mut fields = text.split([' ', '/']);
    (number(fields.next()), number(fields.nth(2)))
}

/// The processes of a group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProcessGroup(pub(crate) Pid);

impl ProcessGroup {
    /// Whether no thread of the group runs or waits for a processor. Where the system does not show it, the group is taken to rest.
    pub(crate) fn is_idle(self) -> bool {
        self.all_threads(|state| state != "R")
    }

    /// Whether all threads of the group are stopped, or have ended. Where the system does not show it, they are taken to be.
    pub(crate) fn is_stopped(self) -> bool {
        self.all_threads(|state| ["T", "Z", "X"].contains(&state))
    }

    /// Whether the states of all threads are such, as proc(5) writes them.
    fn all_threads(self, is_such: impl Fn(&str) -> bool) -> bool {
        let mut are_such = true;
        self.each_thread(|thread| {
            let stat = std::fs::read_to_string(thread.join("stat")).unwrap_or_default();
            if let Some(state) = after_name(&stat).split_whitespace().next() {
                are_such &= is_such(state);
            }
        });
        are_such
    }

    /// How long the group's threads have waited for a processor so far, together. Threads that have ended do not count.
    pub(crate) fn starved(self) -> Duration {
        let mut starved = Duration::ZERO;
        self.each_thread(|thread| {
            // proc(5): time on a processor, time waiting for one, number of time slices; nanoseconds.
            let text = std::fs::read_to_string(thread.join("schedstat")).unwrap_or_default();
            let waited = text.split_whitespace().nth(1);
            let waited = waited.and_then(|waited| waited.parse().ok());
            starved += Duration::from_nanos(waited.unwrap_or_default());
        });
        starved
    }

    fn each_thread(self, mut look: impl FnMut(&Path)) {
        let Ok(processes) = std::fs::read_dir("/proc") else {
            return;
        };
        for process in processes.flatten() {
            if !self.has(&process.path()) {
                continue;
            }

            let Ok(threads) = std::fs::read_dir(process.path().join("task")) else {
                continue;
            };
            for thread in threads.flatten() {
                look(&thread.path());
            }
        }
    }

    /// Whether a process of `/proc` is of this group.
    fn has(self, process: &Path) -> bool {
        let Ok(stat) = std::fs::read_to_string(process.join("stat")) else {
            return false;
        };

        // proc(5): state, parent, group.
        let group = after_name(&stat).split_whitespace().nth(2);
        group == Some(self.0.to_string().as_str())
    }
}

/// The fields of a `stat` file after the name, which may contain spaces and parentheses.
fn after_name(stat: &str) -> &str {
    stat.rsplit_once(')').map_or("", |(_, fields)| fields)
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::CommandExt;
    use std::process::Command;

    use super::*;

    #[test]
    fn the_load_of_a_minute_and_of_now_are_read() {
        assert_eq!(load("0.54 16.40 2.10 43/612 70123\n"), (0.54, 43.0));
        assert_eq!(load(""), (0.0, 0.0));
    }

    #[test]
    fn a_group_that_sleeps_is_idle_and_one_that_computes_is_not() {
        for (script, is_idle) in [("sleep 60; :", true), ("while :; do :; done", false)] {
            let mut shell = Command::new("sh");
            let mut child = shell.args(["-c", script]).process_group(0).spawn().unwrap();
            let group = ProcessGroup(Pid::from_raw(i32::try_from(child.id()).unwrap()));

            // A fresh process starts up first, and may pause while it does.
            let mut found = group.is_idle();
            for _ in 0..1000 {
                if found == is_idle {
                    break;
                }
                std::thread::sleep(Duration::from_millis(10));
                found = group.is_idle();
            }

            nix::sys::signal::killpg(group.0, nix::sys::signal::Signal::SIGKILL).unwrap();
            child.wait().unwrap();
            assert_eq!(found, is_idle, "{script}");
        }
    }
}
