//! When the barrier's timers fire.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use lockstep::Timer;

/// The timers that are set, with the time when each fires.
#[derive(Debug, Default)]
pub(super) struct Timers {
    due: BTreeMap<Timer, Instant>,
}

impl Timers {
    /// Sets a timer, or sets it anew.
    pub(super) fn set(&mut self, timer: Timer, after: Duration) {
        match Instant::now().checked_add(after) {
            Some(due) => self.due.insert(timer, due),
            None => self.due.remove(&timer),
        };
    }

    /// How long until the next one fires, if one is set.
    pub(super) fn next(&self) -> Option<Duration> {
        let due = self.due.values().min()?;

        Some(due.saturating_duration_since(Instant::now()))
    }

    /// Takes a timer that fires now.
    pub(super) fn take_due(&mut self) -> Option<Timer> {
        let now = Instant::now();
        let timer = self
            .due
            .iter()
            .find(|(_, due)| **due <= now)
            .map(|(timer, _)| timer.clone())?;

        self.due.remove(&timer);
        Some(timer)
    }
}
