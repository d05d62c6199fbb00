//! When the clock of the open tick is put again.
//!
//! Usually only because a message was lost, which is rare: after [`Timing::repeat`]. A robot that has just been welcomed
//! may have dropped the clock and the news that came before its welcome, or while its program was still reading that: it
//! gets both again behind the welcome, and then at doubling intervals. How fast a program reads is not known to the simulator.

use std::hash::{Hash, Hasher};
use std::time::Duration;

use crate::outputs::Timing;

/// How long the next repetition of the clock is away.
///
/// Several robots that are welcomed at about the same time share repetitions: after an `init` all of them join again, and each
/// clock is received by all. It decides when a timer fires and nothing else, so barriers that differ in nothing else are equal.
#[derive(Debug, Clone, Copy, Eq)]
pub(crate) struct Repetition {
    usual: Duration,
    quick: Duration,
    next: Duration,
}

impl PartialEq for Repetition {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Hash for Repetition {
    fn hash<H: Hasher>(&self, _: &mut H) {}
}

impl Repetition {
    pub(crate) fn new(timing: Timing) -> Self {
        Self {
            usual: timing.repeat,
            quick: timing.repeat_for_newcomers.min(timing.repeat),
            next: timing.repeat,
        }
    }

    /// How long the next one is away.
    pub(crate) fn next(self) -> Duration {
        self.next
    }

    /// A tick is opened, perhaps with robots that take part from it on.
    pub(crate) fn begin(&mut self, has_newcomers: bool) {
        self.next = if has_newcomers {
            self.quick
        } else {
            self.usual
        };
    }

    /// A robot was welcomed to the open tick: the next one follows at once. Returns whether its timer has to be set anew.
    pub(crate) fn hasten(&mut self) -> bool {
        // One that is as near comes behind this welcome as well. So a robot that asks again and again neither puts the
        // next one off nor makes more of them than a few in each interval.
        let is_far = self.next > self.quick;
        if is_far {
            self.next = Duration::ZERO;
        }

        is_far
    }

    /// The clock was put again.
    pub(crate) fn advance(&mut self) {
        self.next = (self.next * 2).clamp(self.quick, self.usual);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repetition() -> Repetition {
        Repetition::new(Timing {
            repeat: Duration::from_millis(100),
            repeat_for_newcomers: Duration::from_millis(10),
            ..Timing::default()
        })
    }

    fn intervals_ms(repetition: &mut Repetition, count: usize) -> Vec<u128> {
        let mut intervals = Vec::new();
        for _ in 0..count {
            intervals.push(repetition.next().as_millis());
            repetition.advance();
        }
        intervals
    }

    #[test]
    fn intervals_double_up_to_the_usual_one() {
        let mut repetition = repetition();
        assert_eq!(intervals_ms(&mut repetition, 2), [100, 100]);

        repetition.begin(true);
        assert_eq!(intervals_ms(&mut repetition, 6), [10, 20, 40, 80, 100, 100]);

        assert!(repetition.hasten());
        assert_eq!(intervals_ms(&mut repetition, 4), [0, 10, 20, 40]);

        repetition.begin(false);
        assert_eq!(intervals_ms(&mut repetition, 2), [100, 100]);
    }

    #[test]
    fn a_robot_that_asks_again_and_again_does_not_put_it_off() {
        let mut repetition = repetition();
        assert!(repetition.hasten());
        assert!(!repetition.hasten(), "it follows at once");

        repetition.advance();
        assert_eq!(repetition.next(), Duration::from_millis(10));
        assert!(!repetition.hasten(), "it is near enough");

        repetition.advance();
        assert!(repetition.hasten());
    }

    #[test]
    fn a_usual_interval_that_is_shorter_holds_for_newcomers() {
        let mut repetition = Repetition::new(Timing {
            repeat: Duration::from_millis(4),
            repeat_for_newcomers: Duration::from_millis(10),
            ..Timing::default()
        });
        repetition.begin(true);

        assert_eq!(intervals_ms(&mut repetition, 2), [4, 4]);
    }
}
