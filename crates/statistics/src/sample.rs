//! A sample of numbers: its mean with an interval, its quantiles, its distribution.

use serde::Serialize;

use crate::distribution::student_975;

/// A mean with its 95 % confidence interval.
///
/// The interval is Student's t and not the bootstrap: it is the mean of one arm, which describes, while arms are compared by
/// their differences. With few runs the bootstrap of a mean is too narrow, also as BCa, and t is not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Mean of the sample; NaN, `null` in JSON, without values.
    pub mean: f64,
    /// The interval is `mean` ± this; NaN, `null` in JSON, with fewer than two values.
    pub half_width: f64,
    /// Size of the sample.
    pub n: usize,
}

/// A step of a distribution function.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Step {
    /// The value at which it rises.
    pub value: f64,
    /// Share of the sample that is not larger than the value, up to 1.
    pub share: f64,
}

impl Estimate {
    /// Mean and interval of independent values.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len();
        let mean = mean(values);
        let half_width = if n < 2 {
            f64::NAN
        } else {
            student_975(n - 1) * (variance(values) / n as f64).sqrt()
        };
        Self {
            mean,
            half_width,
            n,
        }
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} \u{b1} {:.1}", self.mean, self.half_width)
    }
}

/// The quantile of a sample at `p`, from 0 to 1: between two values it is linear (type 7 of Hyndman and Fan 1996, the default
/// of R and NumPy). `None` without values.
#[must_use]
pub fn quantile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    quantile_of_sorted(&sorted, p)
}

/// The distribution function of a sample, one step for each different value.
#[must_use]
pub fn ecdf(values: &[f64]) -> Vec<Step> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);

    let mut steps: Vec<Step> = Vec::new();
    for (index, value) in sorted.iter().enumerate() {
        let step = Step {
            value: *value,
            share: (index + 1) as f64 / sorted.len() as f64,
        };
        match steps.last_mut() {
            Some(last) if last.value == step.value => *last = step,
            _ => steps.push(step),
        }
    }
    steps
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub(super) fn quantile_of_sorted(sorted: &[f64], p: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = p.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);

    let low = sorted[below];
    let high = sorted[above];
    Some(low + (high - low) * (place - below as f64))
}

/// The variance of at least two values, with n - 1.
fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares = values.iter().map(|value| (value - mean) * (value - mean));
    squares.sum::<f64>() / (values.len() - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_covers_the_true_mean_as_often_as_it_says() {
        let mut stream = protocol::random::stream(1, "statistics");
        let mut covered = 0;
        for _ in 0..4000 {
            let mut values = [0.0; 8];
            for value in &mut values {
                // A sum of twelve uniform numbers is close enough to normal; its mean is 6.
                let uniform = (0..12).map(|_| protocol::random::unit(&mut stream));
                *value = uniform.sum();
            }

            let estimate = Estimate::of(&values);
            if (estimate.mean - 6.0).abs() <= estimate.half_width {
                covered += 1;
            }
        }
        let share = f64::from(covered) / 4000.0;
        assert!((0.935..0.965).contains(&share), "{share}");
    }

    #[test]
    fn equal_values_leave_no_doubt() {
        let expected = Estimate {
            mean: 3.0,
            half_width: 0.0,
            n: 32,
        };
        assert_eq!(Estimate::of(&[3.0; 32]), expected);
    }

    #[test]
    fn one_value_has_no_interval() {
        let one = Estimate::of(&[3.0]);
        assert_eq!((one.mean, one.n), (3.0, 1));
        assert!(one.half_width.is_nan());
    }

    #[test]
    fn quantiles_are_linear_between_two_values() {
        let values = [40.0, 10.0, 20.0, 30.0];
        for (p, expected) in [(0.0, 10.0), (0.25, 17.5), (0.5, 25.0), (1.0, 40.0)] {
            assert_eq!(quantile(&values, p), Some(expected), "{p}");
        }
        assert_eq!(quantile(&[7.0], 0.5), Some(7.0));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn a_distribution_function_has_a_step_for_each_value() {
        let steps = ecdf(&[2.0, 1.0, 2.0, 5.0]);
        let found: Vec<(f64, f64)> = steps.iter().map(|step| (step.value, step.share)).collect();
        assert_eq!(found, [(1.0, 0.25), (2.0, 0.75), (5.0, 1.0)]);
    }
}
