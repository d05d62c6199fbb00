//! What all that goes through a proxy asks for its way.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::shape::{Flow, Shape};

/// The shape of a link, and those who wait for it to change.
#[derive(Debug, Default)]
pub(super) struct Gate {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    shape: Shape,
    /// When somebody first came to the gate.
    first_use: Option<Instant>,
}

impl Gate {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the link is like now.
    pub(super) fn shape(&self) -> Shape {
        self.state().shape
    }

    /// From now on it is like this.
    pub(super) fn set(&self, shape: Shape) {
        self.state().shape = shape;
        self.changed.notify_all();
    }

    /// Notes that the link is used.
    pub(super) fn touch(&self) {
        self.state().first_use.get_or_insert_with(Instant::now);
        self.changed.notify_all();
    }

    /// Waits until the link is used.
    pub(super) fn wait_for_use(&self) -> Instant {
        let mut state = self.state();
        loop {
            match state.first_use {
                Some(at) => return at,
                None => {
                    state = self
                        .changed
                        .wait(state)
                        .unwrap_or_else(PoisonError::into_inner);
                }
            }
        }
    }

    /// Waits while the link is cut. Who goes through a closed one finds out at the socket.
    pub(super) fn pass(&self) {
        let mut state = self.state();
        while state.shape.flow == Flow::Cut {
            state = self
                .changed
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// When pieces that follow one another leave a link.
#[derive(Debug)]
pub(super) struct Pace {
    last: Instant,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self {
            last: Instant::now(),
        }
    }

    /// When what came at `now` may leave a link with this shape; `luck` is from 0 to 1. Nothing overtakes anything.
    pub(super) fn due(&mut self, now: Instant, shape: Shape, luck: f64) -> Instant {
        self.last = self
            .last
            .max(now + shape.delay + shape.jitter.mul_f64(luck));
        self.last
    }

    /// When `bytes` that begin to leave at `now` have left.
    pub(super) fn sent(&mut self, now: Instant, shape: Shape, bytes: usize) -> Instant {
        self.last = self.last.max(now) + transmission(shape, bytes);
        self.last
    }
}

/// How long a link takes to send so many bytes.
fn transmission(shape: Shape, bytes: usize) -> Duration {
    let bits = u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(8);
    // A bandwidth so small that this overflows sends nothing in anybody's lifetime.
    let nanos = |bps: u64| bits.saturating_mul(1_000_000_000).checked_div(bps);
    shape
        .bandwidth_bps
        .and_then(nanos)
        .map_or(Duration::ZERO, Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_late_and_in_order() {
        let ms = Duration::from_millis;
        let mut pace = Pace::new();
        let (now, shape) = (
            pace.last,
            Shape {
                delay: ms(50),
                jitter: ms(10),
                ..Shape::default()
            },
        );

        assert_eq!(pace.due(now, shape, 1.0), now + ms(60));
        assert_eq!(
            pace.due(now + ms(5), shape, 0.0),
            now + ms(60),
            "nothing overtakes anything"
        );
        assert_eq!(pace.due(now + ms(20), shape, 0.0), now + ms(70));
    }

    #[test]
    fn a_narrow_link_takes_its_time_for_each_byte() {
        let mut pace = Pace::new();
        let (now, shape) = (
            pace.last,
            Shape {
                bandwidth_bps: Some(8000),
                ..Shape::default()
            },
        );

        assert_eq!(pace.sent(now, shape, 500), now + Duration::from_millis(500));
        assert_eq!(pace.sent(now, shape, 500), now + Duration::from_secs(1));
        assert_eq!(
            pace.sent(now + Duration::from_secs(9), shape, 1),
            now + Duration::from_millis(9001)
        );
    }
}
