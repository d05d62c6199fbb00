//! The triangular distribution, from which guests take speeds and durations.

use crate::error::TriangularError;
use rand::{Rng, RngExt};

/// A triangular distribution of a quantity that cannot be negative (seed, "Obstacles": speed and duration).
///
/// The unit is that of the quantity. `min == max` is allowed and means a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangular {
    min: f64,
    mode: f64,
    max: f64,
}

impl Triangular {
    /// The distribution on `[min, max]` with its peak at `mode`.
    ///
    /// # Errors
    ///
    /// [`TriangularError`] unless all three are finite and `0 <= min <= mode <= max`.
    pub fn new(min: f64, mode: f64, max: f64) -> Result<Self, TriangularError> {
        if 0.0 <= min && min <= mode && mode <= max && max.is_finite() {
            Ok(Self { min, mode, max })
        } else {
            Err(TriangularError { min, mode, max })
        }
    }

    /// The smallest value that is drawn.
    #[must_use]
    pub fn min(&self) -> f64 {
        self.min
    }

    /// The most likely value.
    #[must_use]
    pub fn mode(&self) -> f64 {
        self.mode
    }

    /// The largest value that is drawn.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.max
    }

    /// One value; takes exactly one number from the stream, also for a constant, so that two halls which differ
    /// in a parameter only still draw alike.
    pub(crate) fn sample(&self, rng: &mut impl Rng) -> f64 {
        self.quantile(rng.random())
    }

    /// The value below which a share `p` of all draws lies; `p` from 0 to 1.
    #[must_use]
    pub fn quantile(&self, p: f64) -> f64 {
        let (range, rise) = (self.max - self.min, self.mode - self.min);
        let value = if p * range < rise {
            self.min + (p * range * rise).sqrt()
        } else {
            self.max - ((range - p * range) * (self.max - self.mode)).sqrt()
        };
        // Rounding may leave the interval by a bit; what was promised is the interval.
        value.clamp(self.min, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn refuses_what_is_not_a_triangle() {
        for (min, mode, max) in [
            (-1.0, 0.0, 1.0),
            (0.0, 2.0, 1.0),
            (1.0, 0.0, 2.0),
            (f64::NAN, 1.0, 2.0),
            (0.0, f64::NAN, 2.0),
            (0.0, 1.0, f64::NAN),
            (0.0, 1.0, f64::INFINITY),
        ] {
            assert!(
                Triangular::new(min, mode, max).is_err(),
                "{min} {mode} {max}"
            );
        }
        let text = Triangular::new(0.5, 0.2, 1.0).unwrap_err().to_string();
        assert_eq!(
            text,
            "need 0 <= min <= mode <= max, all finite; got min 0.5, mode 0.2, max 1"
        );
    }

    #[test]
    fn constant_is_constant_and_still_draws_one() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut other = rng.clone();
        assert_eq!(
            Triangular::new(0.7, 0.7, 0.7).unwrap().sample(&mut rng),
            0.7
        );
        other.next_u64();
        assert_eq!(rng, other);
    }

    #[test]
    fn mean_is_that_of_the_triangle() {
        let (min, mode, max) = (0.2, 0.6, 1.6);
        let triangular = Triangular::new(min, mode, max).unwrap();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
        let draws: Vec<f64> = (0..100_000).map(|_| triangular.sample(&mut rng)).collect();
        assert!(draws.iter().all(|draw| (min..=max).contains(draw)));
        let mean = draws.iter().sum::<f64>() / 1e5;
        // Standard error is 0.0009; four of them.
        assert!((mean - (min + mode + max) / 3.0).abs() < 0.004, "{mean}");
        let below_mode = draws.iter().filter(|&&draw| draw < mode).count() as f64 / 1e5;
        assert!(
            (below_mode - (mode - min) / (max - min)).abs() < 0.006,
            "{below_mode}"
        );
    }
}
