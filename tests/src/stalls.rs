//! How long this machine stood still: what a test measures with the wall clock is then not the work of the subject.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How long the thread that watches sleeps.
const SLEEP: Duration = Duration::from_millis(10);
/// A thread that sleeps so much longer has found a stall.
const LEAST: Duration = Duration::from_millis(50);

/// Monitors for stalls until it is dropped: times in which a thread of this process was not run.
pub struct Stalls {
    found: Arc<Mutex<Vec<(Instant, Instant)>>>,
    _ends_thread: Sender<()>,
}

impl Default for Stalls {
    fn default() -> Self {
        Self::watch()
    }
}

impl Stalls {
    /// Begins to watch.
    #[must_use]
    pub fn watch() -> Self {
        let found = Arc::new(Mutex::new(Vec::new()));
        let stalls = found.clone();
        let (ends_thread, end) = channel::<()>();
        std::thread::spawn(move || {
            let mut before = Instant::now();
            while end.recv_timeout(SLEEP) == Err(RecvTimeoutError::Timeout) {
                let now = Instant::now();
                if now - before > SLEEP + LEAST {
                    let stall = (before + SLEEP, now);
                    stalls.lock().expect("no panic").push(stall);
                }
                before = now;
            }
        });

        Self {
            found,
            _ends_thread: ends_thread,
        }
    }

    /// The sum of the stalls so far.
    #[must_use]
    pub fn total(&self) -> Duration {
        let found = self.found.lock().expect("no panic");
        found.iter().map(|(begin, end)| *end - *begin).sum()
    }

    /// How many stalls lasted for longer than this.
    #[must_use]
    pub fn longer_than(&self, limit: Duration) -> usize {
        let found = self.found.lock().expect("no panic");
        found
            .iter()
            .filter(|(begin, end)| *end - *begin > limit)
            .count()
    }

    /// The time from one instant to a later one without the stalls in between; zero if it is not later.
    #[must_use]
    pub fn time_between(&self, from: Instant, to: Instant) -> Duration {
        let mut time = to.saturating_duration_since(from);
        for (begin, end) in self.found.lock().expect("no panic").iter() {
            let begin = (*begin).max(from);
            let end = (*end).min(to);
            time = time.saturating_sub(end.saturating_duration_since(begin));
        }
        time
    }
}
