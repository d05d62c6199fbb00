//! The incomplete gamma function.

/// Iterations after which a sum or a fraction has converged for the arguments that are used.
const MAX_ITERATIONS: u32 = 10_000;

/// The regularized lower incomplete gamma function P(a, x), for `a` above 0: the distribution function at `x` of a gamma variable
/// with shape `a` and scale 1. It is 0 for `x` at or below 0. Below `a + 1` by its series, else by its continued fraction
/// (Abramowitz and Stegun, 6.5.29 and 6.5.31).
#[must_use]
pub fn regularized_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        series(a, x) * scale
    } else {
        1.0 - fraction(a, x) * scale
    }
}

fn series(a: f64, x: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    for n in 1..MAX_ITERATIONS {
        term *= x / (a + f64::from(n));
        sum += term;
        if term <= sum * f64::EPSILON {
            break;
        }
    }
    sum
}

/// The continued fraction by the method of Lentz.
fn fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let mut c = f64::MAX;
    let mut d = 1.0 / b;
    let mut value = d;
    for n in 1..MAX_ITERATIONS {
        let n = f64::from(n);
        let numerator = n * (a - n);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        let factor = c * d;
        value *= factor;
        if (factor - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    value
}
