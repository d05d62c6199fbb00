//! The bootstrap over seeds.

use rand_xoshiro::rand_core::Rng;
use serde::Serialize;

use crate::distribution::{normal_cdf, normal_quantile};
use crate::sample::{mean, quantile_of_sorted};

/// Number of resamples of an interval.
pub const RESAMPLES: usize = 10_000;

/// Fewest seeds of an interval.
const MIN_SEEDS: usize = 3;
/// Share of an interval below and above.
const TAIL: f64 = 0.025;
/// Name of the stream of resamples.
const STREAM: &str = "statistics/bootstrap";

/// A statistic over seeds with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bootstrapped {
    /// The statistic of the sample.
    pub value: f64,
    /// Its 95 % confidence interval.
    pub interval: Interval,
}

/// A 95 % confidence interval, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Interval {
    /// Bias-corrected and accelerated (BCa, Efron 1987), from [`RESAMPLES`] resamples.
    Bca {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Fewer than three seeds.
    TooFew,
    /// Every resample has the same value, so that the sample does not show how much the statistic varies.
    AllEqual,
}

impl Interval {
    /// Lower and upper end, if there is an interval.
    #[must_use]
    pub fn bounds(&self) -> Option<(f64, f64)> {
        match self {
            Self::Bca { low, high } => Some((*low, *high)),
            Self::TooFew | Self::AllEqual => None,
        }
    }
}

impl std::fmt::Display for Interval {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bca { low, high } => write!(f, "[{low:.1}, {high:.1}]"),
            Self::TooFew => write!(f, "fewer than {MIN_SEEDS} seeds"),
            Self::AllEqual => write!(f, "all equal"),
        }
    }
}

/// The statistic of `n` seeds and its interval. `statistic` gets the indices of seeds, from 0 to `n` exclusive, each as often
/// as the seed is in the sample: with every index once it is the value.
#[must_use]
pub fn bootstrap(n: usize, statistic: impl Fn(&[usize]) -> f64) -> Bootstrapped {
    let mut indices: Vec<usize> = (0..n).collect();
    let value = statistic(&indices);
    if n < MIN_SEEDS {
        return Bootstrapped {
            value,
            interval: Interval::TooFew,
        };
    }

    let mut resampled = resample(n, &statistic);
    resampled.sort_by(f64::total_cmp);
    let lowest = resampled[0];
    let highest = resampled[RESAMPLES - 1];
    // Values that are equal in exact numbers may differ in their last bits.
    let rounding = 1e-12 * lowest.abs().max(highest.abs());
    if highest - lowest <= rounding {
        return Bootstrapped {
            value,
            interval: Interval::AllEqual,
        };
    }

    let mut without_one = Vec::new();
    for left_out in 0..n {
        indices.remove(left_out);
        without_one.push(statistic(&indices));
        indices.insert(left_out, left_out);
    }
    let shape = Shape {
        bias: bias(&resampled, value, rounding),
        acceleration: acceleration(&without_one),
    };
    Bootstrapped {
        value,
        interval: Interval::Bca {
            low: shape.end(&resampled, TAIL),
            high: shape.end(&resampled, 1.0 - TAIL),
        },
    }
}

/// The statistic of [`RESAMPLES`] samples of `n` seeds with replacement, in the order of the draws. The draws depend on `n`
/// alone.
pub fn resample(n: usize, statistic: impl Fn(&[usize]) -> f64) -> Vec<f64> {
    let mut stream = protocol::random::stream(0, STREAM);
    let mut indices = vec![0; n];
    let mut values = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        for index in &mut indices {
            // The upper word of the product is uniform from 0 to n exclusive, up to 2^-64 n.
            let product = u128::from(stream.next_u64()) * n as u128;
            *index = (product >> 64) as usize;
        }
        values.push(statistic(&indices));
    }
    values
}

/// How the distribution of resamples differs from a normal one around the value.
#[derive(Debug, Clone, Copy)]
struct Shape {
    bias: f64,
    acceleration: f64,
}

impl Shape {
    /// The end of an interval that a share `tail` of the distribution is below: equations 14.9 and 14.10 of Efron and
    /// Tibshirani 1993, An Introduction to the Bootstrap.
    fn end(self, sorted: &[f64], tail: f64) -> f64 {
        let z = self.bias + normal_quantile(tail);
        let p = normal_cdf(self.bias + z / (1.0 - self.acceleration * z));
        quantile_of_sorted(sorted, p).unwrap_or(f64::NAN)
    }
}

/// How far the median of the resamples is from the value, in standard deviations; resamples equal to the value count half.
fn bias(resampled: &[f64], value: f64, rounding: f64) -> f64 {
    let below = resampled.partition_point(|other| *other < value - rounding);
    let not_above = resampled.partition_point(|other| *other <= value + rounding);
    let count = (below + not_above) as f64;

    // A value beyond all resamples is treated like one that half a resample exceeds.
    let draws = 2.0 * resampled.len() as f64;
    normal_quantile(count.clamp(1.0, draws - 1.0) / draws)
}

/// How the spread changes with the value, from the statistics of the sample without each of its seeds.
fn acceleration(without_one: &[f64]) -> f64 {
    let mean = mean(without_one);
    let mut squares = 0.0;
    let mut cubes = 0.0;
    for value in without_one {
        let difference = mean - value;
        squares += difference * difference;
        cubes += difference * difference * difference;
    }
    if squares == 0.0 {
        return 0.0;
    }
    cubes / (6.0 * squares * squares.sqrt())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of_mean(values: &[f64]) -> Bootstrapped {
        bootstrap(values.len(), |indices| {
            let sum: f64 = indices.iter().map(|index| values[*index]).sum();
            sum / indices.len() as f64
        })
    }

    /// The variance with n of the sample with these indices.
    fn variance(values: &[f64], indices: &[usize]) -> f64 {
        let values: Vec<f64> = indices.iter().map(|index| values[*index]).collect();
        let center = mean(&values);
        let squares = values
            .iter()
            .map(|value| (value - center) * (value - center));
        squares.sum::<f64>() / values.len() as f64
    }

    #[test]
    fn the_interval_of_a_variance_is_the_published_one() {
        // Efron and Tibshirani 1993, An Introduction to the Bootstrap, tables 14.1 and 14.2: spatial abilities of 26 children.
        // Variance 171.5, acceleration 0.061; from 2,000 resamples bias 0.146 and the 90 % interval from 115.8 to 259.6.
        let spatial: [f64; 26] = [
            48.0, 36.0, 20.0, 29.0, 42.0, 42.0, 20.0, 42.0, 22.0, 41.0, 45.0, 14.0, 6.0, 0.0, 33.0,
            28.0, 34.0, 4.0, 32.0, 24.0, 47.0, 41.0, 24.0, 26.0, 30.0, 41.0,
        ];
        let all: Vec<usize> = (0..26).collect();
        let value = variance(&spatial, &all);
        assert!((value - 171.5).abs() < 0.05, "{value}");

        let mut without_one = Vec::new();
        for left_out in 0..26 {
            let others: Vec<usize> = (0..26).filter(|index| *index != left_out).collect();
            without_one.push(variance(&spatial, &others));
        }
        let mut resampled = resample(26, |indices| variance(&spatial, indices));
        resampled.sort_by(f64::total_cmp);
        let shape = Shape {
            bias: bias(&resampled, value, 0.0),
            acceleration: acceleration(&without_one),
        };
        assert!((shape.acceleration - 0.061).abs() < 5e-4, "{shape:?}");
        // The error of the published numbers is that of 2,000 resamples: 0.028 in the bias.
        assert!((shape.bias - 0.146).abs() < 0.1, "{shape:?}");
        let low = shape.end(&resampled, 0.05);
        let high = shape.end(&resampled, 0.95);
        assert!((low - 115.8).abs() < 4.0, "{low}");
        assert!((high - 259.6).abs() < 8.0, "{high}");
    }

    #[test]
    fn samples_without_spread_have_no_interval() {
        assert_eq!(of_mean(&[1.0, 2.0]).interval, Interval::TooFew);
        assert_eq!(of_mean(&[0.1; 9]).interval, Interval::AllEqual);
        assert!(of_mean(&[0.0, 0.0, 1.0]).interval.bounds().is_some());
    }

    #[test]
    fn an_interval_covers_the_true_mean_almost_as_often_as_it_says() {
        let mut stream = protocol::random::stream(1, "statistics");
        let mut covered = 0;
        for _ in 0..400 {
            // Skewed: the mean of -ln(u) is 1.
            let values: Vec<f64> = (0..32)
                .map(|_| -libm::log(1.0 - protocol::random::unit(&mut stream)))
                .collect();
            let (low, high) = of_mean(&values).interval.bounds().unwrap();
            if (low..=high).contains(&1.0) {
                covered += 1;
            }
        }
        let share = f64::from(covered) / 400.0;
        assert!((0.90..0.97).contains(&share), "{share}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn the_interval_moves_with_the_sample(
            values in prop::collection::vec(-50_i32..50, 3..20),
            shift in -50_i32..50,
        ) {
            let sample: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
            let moved: Vec<f64> = sample.iter().map(|value| value + f64::from(shift)).collect();
            let sample = of_mean(&sample);
            let moved = of_mean(&moved);

            prop_assert!((moved.value - sample.value - f64::from(shift)).abs() < 1e-9);
            match (sample.interval.bounds(), moved.interval.bounds()) {
                (Some((low, high)), Some((moved_low, moved_high))) => {
                    prop_assert!(low <= high);
                    prop_assert!((moved_low - low - f64::from(shift)).abs() < 1e-9);
                    prop_assert!((moved_high - high - f64::from(shift)).abs() < 1e-9);
                }
                (sample, moved) => prop_assert_eq!(sample, moved),
            }
        }
    }
}
