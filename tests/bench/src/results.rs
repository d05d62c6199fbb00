//! Measured rates and the statistics of the table.

use crate::subject::Subject;

/// Results of one subject, ticks per second, by round.
pub(crate) struct Results {
    pub(crate) subject: Subject,
    /// With this build.
    pub(crate) here: Vec<f64>,
    /// With the build of `--against`; empty without one.
    pub(crate) there: Vec<f64>,
}

impl Results {
    /// No rounds yet.
    pub(crate) fn of(subject: Subject) -> Self {
        Self {
            subject,
            here: Vec::new(),
            there: Vec::new(),
        }
    }

    pub(crate) fn best(&self) -> f64 {
        self.here.iter().copied().fold(f64::MIN, f64::max)
    }

    pub(crate) fn worst(&self) -> f64 {
        self.here.iter().copied().fold(f64::MAX, f64::min)
    }
}

/// Median of the ratios of values of the same round. The machine's speed drifts between rounds; both values of a round
/// drift together.
pub(crate) fn paired_ratio(values: &[f64], others: &[f64]) -> f64 {
    let mut ratios = Vec::new();
    for (value, other) in values.iter().zip(others) {
        ratios.push(value / other);
    }

    median(&ratios)
}

/// The middle value, or the mean of the two in the middle; NaN of no values.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);

    let middle = sorted.len() / 2;
    match sorted.as_slice() {
        [] => f64::NAN,
        sorted if sorted.len() % 2 == 1 => sorted[middle],
        sorted => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_those_of_sorted_values() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&[7.0]), 7.0);
    }

    #[test]
    fn ratios_are_paired_by_round() {
        // The machine is ten times as fast in the second round, and nothing has changed.
        assert_eq!(paired_ratio(&[1.0, 10.0, 2.0], &[2.0, 20.0, 4.0]), 0.5);
    }
}
