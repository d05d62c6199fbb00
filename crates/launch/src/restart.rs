//! Restarts of processes that exit before the end of the run.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use serde::Deserialize;

/// Whether a process that exits before the end of the run is restarted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restart {
    /// It is not restarted.
    #[default]
    Never,
    /// It is restarted after a failure.
    OnFailure,
    /// It is restarted after every exit.
    Always,
}

impl Restart {
    /// Whether a process is restarted after a success or a failure.
    pub(super) fn applies(self, has_failed: bool) -> bool {
        match self {
            Self::Never => false,
            Self::OnFailure => has_failed,
            Self::Always => true,
        }
    }
}

/// Most restarts of one process within [`WINDOW`].
pub(super) const BUDGET: usize = 5;
/// Window of the budget. A process that fails after every wait exhausts its budget, even with the longest waits.
const WINDOW: Duration = Duration::from_secs(600);
/// Longest wait before a restart, unless the first wait is longer.
const MAX_BACKOFF: Duration = Duration::from_secs(30);

/// The restarts that a process has left, and the wait before the next one.
#[derive(Debug)]
pub(super) struct RestartBudget {
    backoff: Duration,
    recent: VecDeque<Instant>,
}

impl RestartBudget {
    /// A full budget; `backoff` is the first wait.
    pub(super) fn new(backoff: Duration) -> Self {
        Self {
            backoff,
            recent: VecDeque::new(),
        }
    }

    /// Whether no restart is left.
    pub(super) fn is_exhausted(&self) -> bool {
        self.recent.len() >= BUDGET
    }

    /// Spends one restart. Returns the wait before it and its number among the recent ones, or `None` if the budget is
    /// exhausted.
    pub(super) fn spend(&mut self, now: Instant) -> Option<(Duration, usize)> {
        // A process that has run for long is trusted again.
        self.recent
            .retain(|then| now.duration_since(*then) <= WINDOW);
        if self.recent.len() >= BUDGET {
            return None;
        }

        let doublings = u32::try_from(self.recent.len()).unwrap_or(u32::MAX);
        let factor = 2_u32.saturating_pow(doublings);
        let longest = MAX_BACKOFF.max(self.backoff);
        let wait = self.backoff.saturating_mul(factor).min(longest);
        self.recent.push_back(now);
        Some((wait, self.recent.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits_s(budget: &mut RestartBudget, now: Instant) -> Vec<u64> {
        std::iter::from_fn(|| budget.spend(now))
            .map(|(wait, _)| wait.as_secs())
            .collect()
    }

    #[test]
    fn the_wait_doubles_until_the_budget_is_exhausted() {
        let now = Instant::now();
        let mut short = RestartBudget::new(Duration::from_secs(1));
        assert_eq!(waits_s(&mut short, now), [1, 2, 4, 8, 16]);

        let mut long = RestartBudget::new(Duration::from_secs(10));
        assert_eq!(waits_s(&mut long, now), [10, 20, 30, 30, 30]);
    }

    #[test]
    fn the_budget_is_full_again_after_a_window_without_failures() {
        let mut budget = RestartBudget::new(Duration::from_secs(1));
        let now = Instant::now();
        assert_eq!(waits_s(&mut budget, now).len(), BUDGET);

        let later = now + WINDOW + Duration::from_secs(1);
        assert_eq!(waits_s(&mut budget, later), [1, 2, 4, 8, 16]);
    }
}
