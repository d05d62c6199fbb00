//! Paired differences between two arms: a test that assumes nothing about their distribution, and the size of the effect.

use rand_xoshiro::rand_core::Rng;
use serde::Serialize;

/// Number of draws of the test where not every assignment of signs is computed; the smallest p value is 1 / (draws + 1).
pub const FLIPS: u32 = 19_999;

/// Most pairs for which every assignment of signs is computed: 2^14, which is fewer than [`FLIPS`].
const MAX_EXACT: usize = 14;
/// Name of the stream of random signs.
const STREAM: &str = "statistics/signs";

/// Sums that are equal in exact numbers may differ by this share of the sum of all sizes.
const ROUNDING: f64 = 1e-11;

/// The two-sided sign-flip test of the mean of paired differences: if the arms did not differ, each difference could as well
/// have the other sign (Fisher 1935).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignFlip {
    /// Share of the assignments of signs whose mean is at least as far from 0.
    pub p: f64,
    /// Whether every assignment was computed; otherwise [`FLIPS`] of them were drawn, and that of the sample counts as one more.
    pub is_exact: bool,
}

impl SignFlip {
    /// Tests differences between the runs of two arms with the same seeds.
    #[must_use]
    pub fn of(differences: &[f64]) -> Self {
        let sum: f64 = differences.iter().sum();
        let total: f64 = differences.iter().map(|value| value.abs()).sum();
        let threshold = sum.abs() - ROUNDING * total;

        if differences.len() <= MAX_EXACT {
            let all = 1_u64 << differences.len();
            let mut extreme = 0;
            for signs in 0..all {
                if flipped(differences, &[signs]).abs() >= threshold {
                    extreme += 1;
                }
            }
            return Self {
                p: f64::from(extreme) / all as f64,
                is_exact: true,
            };
        }

        let mut stream = protocol::random::stream(0, STREAM);
        let mut signs = vec![0; differences.len().div_ceil(64)];
        let mut extreme = 1;
        for _ in 0..FLIPS {
            for word in &mut signs {
                *word = stream.next_u64();
            }
            if flipped(differences, &signs).abs() >= threshold {
                extreme += 1;
            }
        }
        Self {
            p: f64::from(extreme) / f64::from(FLIPS + 1),
            is_exact: false,
        }
    }
}

/// The smallest p value that so many pairs can have: where all of their differences have one sign.
#[must_use]
pub fn least_p(pairs: usize) -> f64 {
    match i32::try_from(pairs) {
        Ok(0) => 1.0,
        Ok(few) if pairs <= MAX_EXACT => libm::scalbn(2.0, -few),
        _ => 1.0 / f64::from(FLIPS + 1),
    }
}

/// Cliff's delta of pairs, d_w (Cliff 1993): the share of pairs in which the arm is higher, less the share in which it is
/// lower, from -1 to 1. Unlike Cohen's d it has a value where all differences are equal, which happens often in simulations,
/// and it does not depend on how a measure is scaled. 0 without pairs.
#[must_use]
pub fn dominance(differences: &[f64]) -> f64 {
    if differences.is_empty() {
        return 0.0;
    }

    let higher = differences.iter().filter(|value| **value > 0.0).count();
    let lower = differences.iter().filter(|value| **value < 0.0).count();
    (higher as f64 - lower as f64) / differences.len() as f64
}

/// The sum of the differences with other signs: those whose bit is set are turned.
fn flipped(differences: &[f64], signs: &[u64]) -> f64 {
    let mut sum = 0.0;
    for (values, word) in differences.chunks(64).zip(signs) {
        for (bit, value) in values.iter().enumerate() {
            // A branch on random bits would take several times as long.
            let sign = (word >> bit & 1) << 63;
            sum += f64::from_bits(value.to_bits() ^ sign);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Darwin's differences in height between cross- and self-fertilized maize, eighths of an inch (Fisher 1935, The Design
    /// of Experiments, sections 17 and 21).
    const MAIZE: [f64; 15] = [
        49.0, -67.0, 8.0, 16.0, 6.0, 23.0, 28.0, 41.0, 14.0, 29.0, 56.0, 24.0, 75.0, 60.0, -48.0,
    ];

    #[test]
    fn darwins_maize_is_tested_as_fisher_did() {
        // Fisher counts 1,726 of 32,768 assignments.
        let found = SignFlip::of(&MAIZE);
        let published = 1726.0 / 32_768.0;
        let error = (published * (1.0 - published) / f64::from(FLIPS)).sqrt();
        assert!(!found.is_exact);
        assert!((found.p - published).abs() < 4.0 * error, "{found:?}");

        let mut extreme = 0;
        for signs in 0..1_u64 << MAIZE.len() {
            if flipped(&MAIZE, &[signs]).abs() >= 314.0 {
                extreme += 1;
            }
        }
        assert_eq!(extreme, 1726);
    }

    #[test]
    fn few_pairs_are_tested_exactly() {
        let found = SignFlip::of(&[1.0; 8]);
        assert_eq!(found.p, 2.0 / 256.0);
        assert!(found.is_exact);
        assert_eq!(SignFlip::of(&[0.0; 8]).p, 1.0);
        assert_eq!(SignFlip::of(&[]).p, 1.0);
    }

    #[test]
    fn no_p_value_is_less_than_the_least() {
        for pairs in 0..=14 {
            assert_eq!(SignFlip::of(&vec![0.3; pairs]).p, least_p(pairs), "{pairs}");
        }
        assert_eq!(least_p(65), SignFlip::of(&[0.3; 65]).p);
    }

    #[test]
    fn many_pairs_use_signs_of_their_own() {
        // If pairs shared signs, the sum of 65 equal differences would be extreme more often.
        let found = SignFlip::of(&[0.1; 65]);
        assert_eq!(found.p, 1.0 / f64::from(FLIPS + 1));
    }

    #[test]
    fn the_effect_is_the_share_of_pairs_that_are_higher() {
        assert_eq!(dominance(&[1.0, 5.0, -2.0, 0.0]), 0.25);
        assert_eq!(dominance(&MAIZE), 11.0 / 15.0);
        assert_eq!(dominance(&[]), 0.0);
    }

    proptest! {
        #[test]
        fn the_test_is_the_same_for_the_arms_exchanged(values in prop::collection::vec(-9.0..9.0, 0..20)) {
            let exchanged: Vec<f64> = values.iter().map(|value| -value).collect();
            prop_assert_eq!(SignFlip::of(&values), SignFlip::of(&exchanged));
            prop_assert_eq!(dominance(&values), -dominance(&exchanged));
        }
    }
}
