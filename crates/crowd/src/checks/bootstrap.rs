//! Intervals of means.

use crate::draws::Draws;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 2_000;
/// Fewest groups of runs that are resampled.
const GROUPS_MIN: usize = 5;
/// Differences of less than this share are rounding.
const ROUNDING: f64 = 1e-9;

/// Bootstrap interval of the mean of runs, 95 %: bootstrap-t (Efron 1979; Hall 1988) over the means of populations, because runs of the same
/// population are alike. Run k is of population k % `populations`. With fewer than five populations it reaches from the lowest to the
/// highest of their means.
pub(crate) fn mean_interval(values: &[f64], populations: usize) -> (f64, f64) {
    let groups = group_means(values, populations);
    let low = groups.iter().copied().fold(f64::INFINITY, f64::min);
    let high = groups.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if groups.len() < GROUPS_MIN || high - low <= ROUNDING * high.abs() {
        return (low, high);
    }

    let (mean, error) = mean_and_error(&groups);
    let mut draws = Draws::new(0);
    let mut resample = groups.clone();
    let mut ratios = Vec::new();
    while ratios.len() < RESAMPLES {
        for value in &mut resample {
            *value = groups[draws.index(groups.len())];
        }
        let (resampled_mean, resampled_error) = mean_and_error(&resample);
        // A resample of one value only has no ratio.
        if resampled_error > ROUNDING * error {
            ratios.push((resampled_mean - mean) / resampled_error);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let tail = RESAMPLES / 40;
    let (lowest, highest) = (ratios[tail - 1], ratios[RESAMPLES - tail]);
    (mean - highest * error, mean - lowest * error)
}

fn group_means(values: &[f64], populations: usize) -> Vec<f64> {
    let mut means = Vec::new();
    for population in 0..populations.min(values.len()) {
        let runs = values.iter().skip(population).step_by(populations);
        means.push(runs.clone().sum::<f64>() / runs.count() as f64);
    }
    means
}

/// The mean of at least two values, and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    (mean, (squares / (count - 1.0) / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In how many of 400 samples the interval covers the true mean. A population shifts its runs.
    fn covered(runs: usize, populations: usize, shift: f64, value: fn(&mut Draws) -> f64) -> usize {
        let mut draws = Draws::new(3);
        let mut covered = 0;
        for _ in 0..400 {
            let shifts: Vec<f64> = (0..populations).map(|_| draws.normal(0.0, shift)).collect();
            let values: Vec<f64> = (0..runs)
                .map(|run| shifts[run % populations] + value(&mut draws))
                .collect();
            let (low, high) = mean_interval(&values, populations);
            covered += usize::from(low <= 2.0 && 2.0 <= high);
        }
        covered
    }

    #[test]
    fn the_interval_covers_the_true_mean_as_often_as_it_says() {
        let normal: fn(&mut Draws) -> f64 = |draws| draws.normal(2.0, 0.5);
        // Exponential, as times between rare events.
        let skewed: fn(&mut Draws) -> f64 = |draws| -2.0 * libm::log(1.0 - draws.unit());
        for (name, covered) in [
            ("quick", covered(10, 10, 0.0, normal)),
            ("50 runs", covered(50, 10, 0.0, normal)),
            ("populations that differ", covered(50, 10, 0.5, normal)),
            ("skewed", covered(50, 10, 0.0, skewed)),
        ] {
            // 380 are expected; 369 and fewer have a probability of 1 %, and so have 391 and more.
            assert!((370..=392).contains(&covered), "{name}: {covered}");
        }
    }

    #[test]
    fn equal_and_few_values_have_an_interval() {
        assert_eq!(mean_interval(&[2.0; 50], 10), (2.0, 2.0));
        assert_eq!(mean_interval(&[1.0, 2.0, 4.0], 10), (1.0, 4.0));
        assert_eq!(mean_interval(&[7.0], 10), (7.0, 7.0));
        // Times are sums of steps, so equal ones differ by rounding.
        let mut rounded = [30.1; 50];
        rounded[7] += 1e-13;
        let (low, high) = mean_interval(&rounded, 10);
        assert!(
            (low - 30.1).abs() + (high - 30.1).abs() < 1e-9,
            "{low} {high}"
        );
        rounded[11] += 1.0;
        let (low, high) = mean_interval(&rounded, 10);
        assert!(low > 29.0 && high < 32.0, "{low} {high}");
    }
}
