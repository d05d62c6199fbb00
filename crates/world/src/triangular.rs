//! The triangular distribution, from which the guests' speeds and durations are drawn.

use rand::Rng;
use rand_distr::Distribution;

use crate::error::TriangularError;

/// A triangular distribution of a non-negative quantity (paper, "Obstacles": speed and duration).
///
/// Values have the unit of the quantity. `min == max` is allowed and gives a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangular {
    distribution: rand_distr::Triangular<f64>,
    min: f64,
    mode: f64,
    max: f64,
}

impl Triangular {
    /// The distribution on `[min, max]` with its peak at `mode`.
    ///
    /// # Errors
    ///
    /// Returns a [`TriangularError`] unless all three are finite and `0 <= min <= mode <= max`.
    pub fn new(min: f64, mode: f64, max: f64) -> Result<Self, TriangularError> {
        let refused = TriangularError { min, mode, max };
        if min < 0.0 || !max.is_finite() {
            return Err(refused);
        }

        let distribution = rand_distr::Triangular::new(min, max, mode).map_err(|_| refused)?;
        Ok(Self {
            distribution,
            min,
            mode,
            max,
        })
    }

    /// The lower end of the distribution.
    #[must_use]
    pub fn min(&self) -> f64 {
        self.min
    }

    /// The most likely value.
    #[must_use]
    pub fn mode(&self) -> f64 {
        self.mode
    }

    /// The upper end of the distribution.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.max
    }

    /// Draws one value.
    ///
    /// Takes exactly one number from the stream, even for a constant, so that runs that differ only in a parameter
    /// consume the stream in the same way. It is the same on every platform: of what differs, it takes square roots only,
    /// which are exact.
    #[must_use]
    pub fn sample(&self, rng: &mut impl Rng) -> f64 {
        // Rounding can leave the interval by a few units in the last place.
        self.distribution.sample(rng).clamp(self.min, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn rejects_parameters_out_of_order() {
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

        let error = Triangular::new(0.5, 0.2, 1.0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "must be finite with 0 <= min <= mode <= max; got min 0.5, mode 0.2, max 1"
        );
    }

    #[test]
    fn a_constant_still_consumes_one_draw() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut other = rng.clone();
        let constant = Triangular::new(0.7, 0.7, 0.7).unwrap();

        assert_eq!(constant.sample(&mut rng), 0.7);

        other.next_u64();
        assert_eq!(rng, other);
    }

    #[test]
    fn draws_have_the_mean_and_mode_of_the_triangle() {
        let min = 0.2;
        let mode = 0.6;
        let max = 1.6;
        let triangular = Triangular::new(min, mode, max).unwrap();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);

        let draws: Vec<f64> = (0..100_000).map(|_| triangular.sample(&mut rng)).collect();
        assert!(draws.iter().all(|draw| (min..=max).contains(draw)));

        // The standard error is 0.0009; allow four of them.
        let mean = draws.iter().sum::<f64>() / 1e5;
        assert!((mean - (min + mode + max) / 3.0).abs() < 0.004, "{mean}");

        let below_mode = draws.iter().filter(|&&draw| draw < mode).count() as f64 / 1e5;
        assert!(
            (below_mode - (mode - min) / (max - min)).abs() < 0.006,
            "{below_mode}"
        );
    }
}
