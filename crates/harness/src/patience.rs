//! How long the kit waits. No verdict may follow from the wall clock alone where a loaded machine can have the same effect.

use std::time::{Duration, Instant};

use crate::process::RobotProcess;
use crate::report::RuleFailure;

/// Longest wait for a program to start and to ask to join.
pub const START_PATIENCE: Duration = Duration::from_secs(40);
/// Longest wait for anything else.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// How often a wait is extended, at most.
const EXTENSIONS: u32 = 6;
/// A robot that waited for a processor for less than this share of its time is not extended.
const STARVING: u32 = 10;

/// The limit of a wait for something that the robot must do. The time that its threads spend waiting for a processor does
/// not count.
pub struct Limit {
    patience: Duration,
    deadline: Instant,
    starved: Duration,
    extensions: u32,
}

impl Limit {
    /// From now on.
    pub fn new(patience: Duration) -> Self {
        Self {
            patience,
            deadline: Instant::now() + patience,
            starved: Duration::ZERO,
            extensions: 0,
        }
    }

    /// Whether the robot has had its time.
    pub fn is_over(&mut self, process: &RobotProcess) -> bool {
        let now = Instant::now();
        if now < self.deadline {
            return false;
        }

        let starved = process.starved();
        // It gets back what it has waited for a processor since the last look, its threads together; no
        // more than its time again.
        let more = starved.saturating_sub(self.starved).min(self.patience);
        self.starved = starved;
        self.extensions += 1;
        self.deadline = now + more;

        more < self.patience / STARVING || self.extensions > EXTENSIONS
    }
}

/// By how much an attempt takes longer than the first one.
const SCALES: [u32; 3] = [1, 3, 9];

/// Judges what a machine that stands still for a moment could have caused as well: the rule is broken only if it is in
/// each attempt, and each attempt has more time than the one before.
pub fn in_each_attempt(
    mut judge: impl FnMut(u32) -> Result<(), RuleFailure>,
) -> Result<(), RuleFailure> {
    let mut first = None;
    for scale in SCALES {
        match judge(scale) {
            Ok(()) => return Ok(()),
            Err(failure) => {
                first.get_or_insert(failure);
            }
        }
    }

    first.map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_attempt_that_succeeds_is_enough() {
        let mut scales = Vec::new();
        let judged = in_each_attempt(|scale| {
            scales.push(scale);
            if scale < SCALES[2] {
                return Err(RuleFailure::new("a", format!("at {scale}")));
            }
            Ok(())
        });
        assert_eq!(judged, Ok(()));
        assert_eq!(scales, SCALES);

        let judged = in_each_attempt(|scale| Err(RuleFailure::new("a", format!("at {scale}"))));
        assert_eq!(judged, Err(RuleFailure::new("a", "at 1")));
    }
}
