//! When a process that ended is started again.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use serde::Deserialize;

/// What to do about a process that ends before the run does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restart {
    /// Leave it.
    #[default]
    Never,
    /// Start it again if it failed.
    OnFailure,
    /// Start it again.
    Always,
}

impl Restart {
    /// Whether a process that ended this way is started again.
    pub(super) fn applies(self, has_failed: bool) -> bool {
        match self {
            Self::Never => false,
            Self::OnFailure => has_failed,
            Self::Always => true,
        }
    }
}

/// This many restarts of one process within [`WINDOW`]; after that it is broken, not unlucky.
pub(super) const BUDGET: usize = 5;
/// Long enough that a process which fails after each longest back-off still runs out of its budget.
const WINDOW: Duration = Duration::from_secs(600);
/// Longest wait before a restart: a person watching still connects it with the failure.
const MAX_BACKOFF: Duration = Duration::from_secs(30);

/// How often a process may still be started again, and after which wait.
#[derive(Debug)]
pub(super) struct Budget {
    backoff: Duration,
    recent: VecDeque<Instant>,
}

impl Budget {
    /// A full budget; `backoff` is the first wait.
    pub(super) fn new(backoff: Duration) -> Self {
        Self {
            backoff,
            recent: VecDeque::new(),
        }
    }

    /// Spends one restart: how long to wait before it and its number among the recent ones, or `None` if the budget is
    /// used up.
    pub(super) fn spend(&mut self, now: Instant) -> Option<(Duration, usize)> {
        while self
            .recent
            .front()
            .is_some_and(|then| now.duration_since(*then) > WINDOW)
        {
            self.recent.pop_front();
        }

        if self.recent.len() >= BUDGET {
            return None;
        }

        let doublings = u32::try_from(self.recent.len()).unwrap_or(u32::MAX);
        let wait = self
            .backoff
            .saturating_mul(2_u32.saturating_pow(doublings))
            .min(MAX_BACKOFF.max(self.backoff));
        self.recent.push_back(now);

        Some((wait, self.recent.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits_s(budget: &mut Budget, now: Instant) -> Vec<u64> {
        std::iter::from_fn(|| budget.spend(now))
            .map(|(wait, _)| wait.as_secs())
            .collect()
    }

    #[test]
    fn the_wait_doubles_until_the_budget_is_used_up() {
        let now = Instant::now();
        assert_eq!(
            waits_s(&mut Budget::new(Duration::from_secs(1)), now),
            [1, 2, 4, 8, 16]
        );
        assert_eq!(
            waits_s(&mut Budget::new(Duration::from_secs(10)), now),
            [10, 20, 30, 30, 30]
        );
    }

    #[test]
    fn a_process_that_held_out_for_long_has_its_budget_back() {
        let mut budget = Budget::new(Duration::from_secs(1));
        let now = Instant::now();
        assert_eq!(waits_s(&mut budget, now).len(), BUDGET);
        assert_eq!(
            waits_s(&mut budget, now + WINDOW + Duration::from_secs(1)),
            [1, 2, 4, 8, 16]
        );
    }
}
