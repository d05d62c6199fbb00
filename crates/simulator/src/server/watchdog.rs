//! Names what holds the simulator itself up: a disk that does not take the record, work that takes too long, or a process that
//! does not run. Robots that hold the clock are reported by the barrier.

use std::collections::BTreeMap;
use std::sync::mpsc::{RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often to look.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Work that takes longer is reported.
const STALL: Duration = Duration::from_millis(500);
/// The same is named no more often than this.
const NAME_EVERY: Duration = Duration::from_secs(10);

/// What the simulator does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Activity {
    /// It handles messages and ticks.
    Work,
    /// It writes the record.
    Record,
}

/// Looks at the simulator's loop from a thread of its own, which ends when this is dropped.
#[derive(Debug)]
pub(super) struct Watchdog {
    activity: Arc<Mutex<ActivityLog>>,
    _ends_thread: SyncSender<()>,
}

/// What is done, and since when.
#[derive(Debug, Default)]
struct ActivityLog {
    present: Option<(Activity, Instant)>,
    /// When each was named last.
    named_at: BTreeMap<Activity, Instant>,
}

impl Watchdog {
    /// Begins to look. `report` is called with a line for people.
    pub(super) fn start(report: impl Fn(String) + Send + 'static) -> Self {
        let activity = Arc::new(Mutex::new(ActivityLog::default()));
        let watched = activity.clone();
        let (ends_thread, end) = std::sync::mpsc::sync_channel(0);
        let watch = move || {
            loop {
                let before = Instant::now();
                if end.recv_timeout(LOOK_EVERY) != Err(RecvTimeoutError::Timeout) {
                    return;
                }

                let slept = before.elapsed();
                if let Some(line) = look(&watched, slept) {
                    report(line);
                }
            }
        };
        // It is for people only: the run does not need it.
        if let Err(error) = std::thread::Builder::new().spawn(watch) {
            tracing::warn!("what holds the clock will not be reported: {error}");
        }

        Self {
            activity,
            _ends_thread: ends_thread,
        }
    }

    /// Notes what is done from now on, until the next call; `None` if there is nothing to do.
    pub(super) fn note(&self, doing: Option<Activity>) {
        let mut activity = self.activity.lock().unwrap_or_else(PoisonError::into_inner);
        activity.present = doing.map(|doing| (doing, Instant::now()));
    }
}

/// What takes too long, once in a while. `slept` is how long the thread that looks was asleep.
fn look(activity: &Mutex<ActivityLog>, slept: Duration) -> Option<String> {
    // Where this thread did not run either, nothing can be said about the other one.
    let oversleep = slept.saturating_sub(LOOK_EVERY);
    if oversleep > STALL {
        let seconds = oversleep.as_secs_f64();
        return Some(format!(
            "the simulator's process did not run for {seconds:.1} s: it was stopped, or the machine is overloaded"
        ));
    }

    let mut activity = activity.lock().unwrap_or_else(PoisonError::into_inner);
    let (doing, since) = activity.present?;
    let named_at = activity.named_at.get(&doing);
    let was_named = named_at.is_some_and(|at| at.elapsed() < NAME_EVERY);
    if since.elapsed() < STALL || was_named {
        return None;
    }
    activity.named_at.insert(doing, Instant::now());
    let line = match doing {
        Activity::Record => {
            "the disk stalls: to write the record takes more than 0.5 s, and the clock is held"
        }
        Activity::Work => {
            "the simulator is busy for more than 0.5 s with one piece of work, and the clock is held"
        }
    };
    Some(line.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Longer than anything here takes, also on a busy machine.
    const LONG: Duration = Duration::from_secs(30);

    #[test]
    fn a_disk_that_stalls_is_named_once() {
        let (sender, lines) = std::sync::mpsc::channel();
        let watchdog = Watchdog::start(move |line| {
            // The receiver is gone when the test is over.
            let _unread = sender.send(line);
        });
        watchdog.note(Some(Activity::Record));

        let first = std::iter::repeat_with(|| lines.recv_timeout(LONG).unwrap())
            .find(|line| !line.contains("did not run"));
        assert!(first.unwrap().contains("the disk stalls"));

        watchdog.note(Some(Activity::Work));
        let second = std::iter::repeat_with(|| lines.recv_timeout(LONG).unwrap())
            .find(|line| !line.contains("did not run"));
        assert!(second.unwrap().contains("busy"), "named twice");
    }

    #[test]
    fn a_process_that_did_not_run_is_named() {
        let activity = Mutex::default();
        let line = look(&activity, LOOK_EVERY + Duration::from_secs(3)).unwrap();
        assert!(line.contains("did not run for 3.0 s"), "{line}");
        assert_eq!(look(&activity, LOOK_EVERY), None);
    }

    #[test]
    fn the_thread_ends_with_the_watchdog() {
        let (sender, lines) = std::sync::mpsc::channel();
        drop(Watchdog::start(move |line| {
            let _unread = sender.send(line);
        }));
        assert_eq!(
            lines.recv_timeout(LONG),
            Err(RecvTimeoutError::Disconnected)
        );
    }
}
