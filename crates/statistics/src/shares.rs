//! Shares of runs: score intervals, which are never of width zero.

use crate::distribution::{normal_quantile, solve};
use crate::estimate::{Estimate, Interval};

impl Estimate {
    /// The share of runs with an event: the score interval (Wilson 1927).
    #[must_use]
    pub fn share(events: usize, n: usize) -> Self {
        if n == 0 {
            return Self::no_share();
        }

        let value = events as f64 / n as f64;
        let (low, high) = wilson(value, n as f64);
        Self {
            value,
            n,
            interval: Interval::Ends { low, high },
        }
    }

    /// The difference of the shares of two arms whose runs are paired, from the pairs in which only the run of the arm has the
    /// event, those in which only that of the baseline has it, and all pairs: the score interval (Tango 1998, Equivalence test
    /// and confidence interval for the difference in proportions for the paired-sample design, Statistics in Medicine 17).
    #[must_use]
    pub fn difference_of_shares(only_arm: usize, only_baseline: usize, n: usize) -> Self {
        if n == 0 {
            return Self::no_share();
        }

        let pairs = n as f64;
        let more = only_arm as f64;
        let fewer = only_baseline as f64;
        let value = (more - fewer) / pairs;
        let z = z();
        let score = |difference| score(more, fewer, pairs, difference);
        // The score falls with the difference that is tested.
        let low = solve(-1.0, value, |difference| score(difference) > z);
        let high = solve(value, 1.0, |difference| score(difference) > -z);
        Self {
            value,
            n,
            interval: Interval::Ends { low, high },
        }
    }

    fn no_share() -> Self {
        Self {
            value: f64::NAN,
            n: 0,
            interval: Interval::TooFew,
        }
    }
}

/// The score interval of a share of so many runs.
pub(super) fn wilson(share: f64, n: f64) -> (f64, f64) {
    let z = z();
    let scale = 1.0 + z * z / n;
    let center = (share + z * z / (2.0 * n)) / scale;
    let variance = share * (1.0 - share) / n + z * z / (4.0 * n * n);
    let half_width = z * variance.sqrt() / scale;

    // At the ends, the exact numbers are 0 and 1.
    let low = if share > 0.0 {
        center - half_width
    } else {
        0.0
    };
    let high = if share < 1.0 {
        center + half_width
    } else {
        1.0
    };
    (low.max(0.0), high.min(1.0))
}

/// Tango's statistic: how far the pairs are from a difference of the shares, in standard errors under that difference.
fn score(more: f64, fewer: f64, n: f64, difference: f64) -> f64 {
    let excess = more - fewer - n * difference;
    // The share of pairs with the event in the baseline only, by maximum likelihood under the difference.
    let b = (2.0 * n - more + fewer) * difference - more - fewer;
    let c = -fewer * difference * (1.0 - difference);
    let root = (b * b - 8.0 * n * c).max(0.0).sqrt();
    let only_baseline = (root - b) / (4.0 * n);

    let variance = n * (2.0 * only_baseline + difference * (1.0 - difference));
    if variance > 0.0 {
        excess / variance.sqrt()
    } else if excess == 0.0 {
        0.0
    } else {
        excess.signum() * f64::INFINITY
    }
}

fn z() -> f64 {
    normal_quantile(0.975)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn assert_ends(found: &Estimate, expected: (f64, f64)) {
        let (low, high) = found.bounds().unwrap();
        assert!((low - expected.0).abs() < 1e-4, "{found:?}");
        assert!((high - expected.1).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn intervals_of_shares_are_the_published_ones() {
        // Newcombe 1998, Two-sided confidence intervals for the single proportion, Statistics in Medicine 17, table I.
        assert_ends(&Estimate::share(81, 263), (0.2553, 0.3662));
        assert_ends(&Estimate::share(15, 148), (0.0624, 0.1605));
        assert_ends(&Estimate::share(0, 20), (0.0, 0.1611));
        assert_ends(&Estimate::share(1, 29), (0.0061, 0.1718));
    }

    #[test]
    fn no_share_is_certain() {
        assert_ends(&Estimate::share(0, 64), (0.0, 0.0566));
        assert_ends(&Estimate::share(64, 64), (0.9434, 1.0));
        assert_ends(&Estimate::difference_of_shares(3, 0, 64), (-0.0124, 0.1290));
        assert_ends(&Estimate::difference_of_shares(0, 0, 8), (-0.3244, 0.3244));
        assert_ends(&Estimate::difference_of_shares(64, 0, 64), (0.8868, 1.0));
        assert_eq!(Estimate::share(0, 0).interval, Interval::TooFew);
    }

    proptest! {
        #[test]
        fn ends_lie_around_the_difference_and_turn_with_the_arms(more in 0_usize..40, fewer in 0_usize..40, same in 0_usize..40) {
            let n = more + fewer + same;
            prop_assume!(n > 0);
            let found = Estimate::difference_of_shares(more, fewer, n);
            let (low, high) = found.bounds().unwrap();
            prop_assert!(-1.0 <= low && low <= found.value && found.value <= high && high <= 1.0);
            prop_assert!(high - low > 0.01);
            let turned = Estimate::difference_of_shares(fewer, more, n).bounds().unwrap();
            prop_assert!((turned.0 + high).abs() < 1e-9 && (turned.1 + low).abs() < 1e-9);
        }
    }
}
