//! Quantiles and tails of the distributions that intervals and tests need.

/// The normal distribution function.
fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

/// The quantile of the normal distribution at `p`, from 0 to 1 exclusive.
pub(super) fn normal_quantile(p: f64) -> f64 {
    // Where p is close to 1, the distribution function has lost digits that it has close to 0.
    if p > 0.5 {
        return -normal_quantile(1.0 - p);
    }
    solve(-40.0, 0.0, |z| normal_cdf(z) < p)
}

/// The 0.975 quantile of Student's t with `df` degrees of freedom, at least one.
pub(super) fn student_975(df: usize) -> f64 {
    // That of one degree of freedom, the largest, is 12.7.
    solve(1.0, 13.0, |t| student_central(t, df) < 0.95)
}

/// The probability that Student's t is between -t and t: 26.7.3 and 26.7.4 of Abramowitz and Stegun, Handbook of
/// Mathematical Functions (1964).
fn student_central(t: f64, df: usize) -> f64 {
    let df_number = df as f64;
    let cos_squared = df_number / (df_number + t * t);
    let sin = t / (df_number + t * t).sqrt();

    let first = if df.is_multiple_of(2) { 2 } else { 3 };
    let mut term = 1.0;
    let mut sum = 1.0;
    for k in (first..df).step_by(2) {
        let numerator = (k - 1) as f64;
        term *= cos_squared * numerator / k as f64;
        sum += term;
    }

    if df.is_multiple_of(2) {
        return sin * sum;
    }
    let theta = libm::atan(t / df_number.sqrt());
    let series = if df == 1 {
        0.0
    } else {
        sin * cos_squared.sqrt() * sum
    };
    std::f64::consts::FRAC_2_PI * (theta + series)
}

/// The number between `low` and `high` at which `is_below` becomes false, to the last bit.
pub(super) fn solve(mut low: f64, mut high: f64, is_below: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = low + (high - low) / 2.0;
        if middle <= low || middle >= high {
            return high;
        }
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_published_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, tables 1.3.6.7.1 and 1.3.6.7.2.
        let student = [
            (1, 12.706),
            (2, 4.303),
            (3, 3.182),
            (7, 2.365),
            (10, 2.228),
            (31, 2.040),
            (100, 1.984),
        ];
        for (df, t) in student {
            let found = student_975(df);
            assert!((found - t).abs() < 5e-4, "{df}: {found}");
        }

        for (p, z) in [(0.5, 0.0), (0.975, 1.959_964), (0.001, -3.090_232)] {
            let found = normal_quantile(p);
            assert!((found - z).abs() < 5e-7, "{p}: {found}");
        }
    }
}
