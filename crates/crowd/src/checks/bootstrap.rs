//! Intervals of means.

use crate::draws::Draws;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 2_000;

/// Bootstrap interval of the mean of at least one value, 95 %: the percentiles 2.5 and 97.5 of the means of resamples (Efron 1979).
pub(crate) fn mean_interval(values: &[f64]) -> (f64, f64) {
    let mut draws = Draws::new(0);
    let mut means = Vec::new();
    for _ in 0..RESAMPLES {
        let sum: f64 = (0..values.len())
            .map(|_| values[draws.index(values.len())])
            .sum();
        means.push(sum / values.len() as f64);
    }
    means.sort_by(f64::total_cmp);
    let tail = RESAMPLES / 40;
    (means[tail - 1], means[RESAMPLES - tail])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_covers_the_true_mean_about_as_often_as_it_says() {
        let mut draws = Draws::new(3);
        let mut covered = 0;
        for _ in 0..200 {
            let values: Vec<f64> = (0..50).map(|_| draws.normal(2.0, 0.5)).collect();
            let (low, high) = mean_interval(&values);
            covered += usize::from(low <= 2.0 && 2.0 <= high);
        }
        // 190 are expected; 178 and fewer have a probability below 1 %.
        assert!((179..=199).contains(&covered), "{covered}");
    }
}
