//! The shape of a proxied link, and when its bytes may pass.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::shape::{Flow, LinkShape};

/// The shape of a link. Threads can wait for it to change.
#[derive(Debug, Default)]
pub(super) struct Gate {
    state: Mutex<GateState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct GateState {
    shape: LinkShape,
    /// When the first connection was accepted.
    first_use: Option<Instant>,
}

impl Gate {
    fn state(&self) -> MutexGuard<'_, GateState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The current shape.
    pub(super) fn shape(&self) -> LinkShape {
        self.state().shape
    }

    /// Changes the shape.
    pub(super) fn set(&self, shape: LinkShape) {
        self.state().shape = shape;
        self.changed.notify_all();
    }

    /// Records the use of the link.
    pub(super) fn touch(&self) {
        // The first one counts: the times of a plan begin with it.
        self.state().first_use.get_or_insert_with(Instant::now);
        self.changed.notify_all();
    }

    /// Waits for the first use of the link.
    pub(super) fn wait_for_use(&self) -> Instant {
        let mut state = self.state();
        loop {
            if let Some(at) = state.first_use {
                return at;
            }
            state = self.wait(state);
        }
    }

    /// Waits while the link is cut. Reading and writing fail on a closed link, so it needs no wait.
    pub(super) fn pass(&self) {
        let mut state = self.state();
        while state.shape.flow == Flow::Cut {
            state = self.wait(state);
        }
    }

    fn wait<'a>(&self, state: MutexGuard<'a, GateState>) -> MutexGuard<'a, GateState> {
        let state = self.changed.wait(state);
        state.unwrap_or_else(PoisonError::into_inner)
    }
}

/// Computes when successive pieces leave a link. Pieces keep their order.
#[derive(Debug)]
pub(super) struct LinkSchedule {
    last: Instant,
}

impl LinkSchedule {
    pub(super) fn new() -> Self {
        Self {
            last: Instant::now(),
        }
    }

    /// When a piece that arrives at `now` may leave a link with this shape. `luck`, from 0 to 1, is its part of the jitter.
    pub(super) fn due(&mut self, now: Instant, shape: LinkShape, luck: f64) -> Instant {
        let due = now + shape.delay + shape.jitter.mul_f64(luck);
        // Never before the piece ahead, however small its own jitter: a stream keeps its order.
        self.last = self.last.max(due);
        self.last
    }

    /// When `bytes` that begin to leave at `now` have been sent.
    pub(super) fn sent(&mut self, now: Instant, shape: LinkShape, bytes: usize) -> Instant {
        self.last = self.last.max(now) + transmission(shape, bytes);
        self.last
    }
}

/// How long a link takes to send this number of bytes.
fn transmission(shape: LinkShape, bytes: usize) -> Duration {
    let Some(bps) = shape.bandwidth_bps else {
        return Duration::ZERO;
    };

    let bits = u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(8);
    let nanos = bits.saturating_mul(1_000_000_000).checked_div(bps);
    Duration::from_nanos(nanos.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_late_and_in_order() {
        let ms = Duration::from_millis;
        let mut pace = LinkSchedule::new();
        let now = pace.last;
        let shape = LinkShape {
            delay: ms(50),
            jitter: ms(10),
            ..LinkShape::default()
        };
        assert_eq!(pace.due(now, shape, 1.0), now + ms(60));
        assert_eq!(
            pace.due(now + ms(5), shape, 0.0),
            now + ms(60),
            "pieces keep their order"
        );
        assert_eq!(pace.due(now + ms(20), shape, 0.0), now + ms(70));
    }

    #[test]
    fn bandwidth_limits_every_byte() {
        let mut pace = LinkSchedule::new();
        let now = pace.last;
        let shape = LinkShape {
            bandwidth_bps: Some(8000),
            ..LinkShape::default()
        };
        assert_eq!(pace.sent(now, shape, 500), now + Duration::from_millis(500));
        assert_eq!(pace.sent(now, shape, 500), now + Duration::from_secs(1));
        assert_eq!(
            pace.sent(now + Duration::from_secs(9), shape, 1),
            now + Duration::from_millis(9001)
        );
    }
}
