//! When the barrier's timers fire.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use lockstep::Timer;

/// A deadline that is found to be over by more than this was not awaited: the process stood still, or had no processor.
const STALL: Duration = Duration::from_millis(20);

/// The timers that are set.
#[derive(Debug, Default)]
pub(super) struct Timers {
    set: BTreeMap<Timer, PendingTimer>,
}

/// A timer that is set.
#[derive(Debug)]
struct PendingTimer {
    /// When it fires.
    due: Instant,
    /// How long after it was set.
    after: Duration,
    was_put_off: bool,
}

impl Timers {
    /// Sets a timer, or sets it anew.
    pub(super) fn set(&mut self, timer: Timer, after: Duration, now: Instant) {
        // A time that cannot be represented never comes, and the timer that it replaces must not fire
        // either.
        let Some(due) = now.checked_add(after) else {
            self.set.remove(&timer);
            return;
        };

        let pending = PendingTimer {
            due,
            after,
            was_put_off: false,
        };
        self.set.insert(timer, pending);
    }

    /// How long until the next one fires, if one is set.
    pub(super) fn next(&self, now: Instant) -> Option<Duration> {
        let due = self.set.values().map(|pending| pending.due).min()?;

        Some(due.saturating_duration_since(now))
    }

    /// Takes a timer that fires now.
    pub(super) fn take_due(&mut self, now: Instant) -> Option<Timer> {
        self.put_off_deadline(now);

        // In a fixed order. The others follow in the next turns of the caller's loop.
        let (timer, _) = self.set.iter().find(|(_, pending)| pending.due <= now)?;
        let timer = timer.clone();
        self.set.remove(&timer);
        Some(timer)
    }

    /// Gives the robots their time once more after a stall of this process: what they have answered meanwhile may not have been
    /// received yet.
    fn put_off_deadline(&mut self, now: Instant) {
        let Some(deadline) = self.set.get_mut(&Timer::Deadline) else {
            return;
        };
        let overdue = now.saturating_duration_since(deadline.due);
        // Once only: a machine that stalls again and again must not keep a robot from being late.
        if overdue > STALL && !deadline.was_put_off {
            deadline.due = now + deadline.after;
            deadline.was_put_off = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AFTER: Duration = Duration::from_millis(100);

    #[test]
    fn a_deadline_is_put_off_once_after_a_stall() {
        let mut timers = Timers::default();
        let begun = Instant::now();
        timers.set(Timer::Deadline, AFTER, begun);
        assert_eq!(timers.take_due(begun), None);

        let woken = begun + AFTER + 2 * STALL;
        assert_eq!(timers.take_due(woken), None);
        assert_eq!(timers.next(woken), Some(AFTER));
        assert_eq!(timers.take_due(woken + AFTER / 2), None);

        let again = woken + 5 * AFTER;
        assert_eq!(timers.take_due(again), Some(Timer::Deadline));
        assert_eq!(timers.next(again), None);

        timers.set(Timer::Deadline, AFTER, again);
        assert_eq!(timers.take_due(again + 5 * AFTER), None);
    }

    #[test]
    fn without_a_stall_timers_fire_when_they_are_due() {
        let mut timers = Timers::default();
        let begun = Instant::now();
        timers.set(Timer::Deadline, AFTER, begun);
        timers.set(Timer::Repeat, 2 * AFTER, begun);
        assert_eq!(timers.next(begun), Some(AFTER));

        let due = begun + AFTER;
        assert_eq!(timers.take_due(due), Some(Timer::Deadline));
        assert_eq!(timers.take_due(due), None);
        assert_eq!(timers.take_due(due + 5 * AFTER), Some(Timer::Repeat));
    }
}
