//! A sample of numbers: its mean, its quantiles, its distribution.

use serde::Serialize;

/// A step of a distribution function.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Step {
    /// The value at which it rises.
    pub value: f64,
    /// Share of the sample that is not larger than the value, up to 1.
    pub share: f64,
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

fn quantile_of_sorted(sorted: &[f64], p: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = p.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);

    let low = sorted[below];
    let high = sorted[above];
    Some(low + (high - low) * (place - below as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

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
