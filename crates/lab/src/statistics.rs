//! Confidence intervals of means.

/// A mean with the half width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Mean of the sample.
    pub mean: f64,
    /// The interval is `mean` ± this (Student's t).
    pub half_width: f64,
}

/// Fewest values of a useful interval; with fewer, the quantile below would not be exact to three digits.
pub const MIN_SAMPLE: u64 = 8;

impl Estimate {
    /// Mean and interval of independent values, at least two.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|value| (value - mean) * (value - mean));
        let variance = squares.sum::<f64>() / (n - 1.0);
        Self {
            mean,
            half_width: student_975(n - 1.0) * (variance / n).sqrt(),
        }
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} \u{b1} {:.1}", self.mean, self.half_width)
    }
}

/// The 0.975 quantile of Student's t with `df` degrees of freedom: the expansion 26.7.5 of Abramowitz and Stegun,
/// Handbook of Mathematical Functions (1964).
fn student_975(df: f64) -> f64 {
    /// The 0.975 quantile of the normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
    let z2 = Z * Z;
    let g1 = Z * (z2 + 1.0) / 4.0;
    let g2 = Z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let g3 = Z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    let g4 = Z * ((((79.0 * z2 + 776.0) * z2 + 1482.0) * z2 - 1920.0) * z2 - 945.0) / 92160.0;
    Z + (g1 + (g2 + (g3 + g4 / df) / df) / df) / df
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_published_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, table of critical values of Student's t.
        for (df, t) in [
            (7.0, 2.365),
            (10.0, 2.228),
            (15.0, 2.131),
            (31.0, 2.040),
            (100.0, 1.984),
        ] {
            let found = student_975(df);
            assert!((found - t).abs() < 1e-3, "{df}: {found}");
        }
    }

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
        assert_eq!(
            Estimate::of(&[3.0; 32]),
            Estimate {
                mean: 3.0,
                half_width: 0.0
            }
        );
    }
}
