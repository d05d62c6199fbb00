//! Chance: named by its seed, the same on every machine.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A stream of draws.
#[derive(Clone, Debug)]
pub(crate) struct Draws(Xoshiro256PlusPlus);

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// From 0 up to but not including 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform between two numbers.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// An index below `count`.
    pub(crate) fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Normal, within three standard deviations: Box and Muller 1958.
    pub(crate) fn normal(&mut self, mean: f64, deviation: f64) -> f64 {
        loop {
            let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
            let value = radius * libm::cos(std::f64::consts::TAU * self.unit());
            if value.abs() <= 3.0 {
                return mean + deviation * value;
            }
        }
    }

    /// Puts values in a random order: Fisher and Yates.
    pub(crate) fn shuffle<T>(&mut self, values: &mut [T]) {
        for last in (1..values.len()).rev() {
            let other = self.index(last + 1);
            values.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_draws_have_their_mean_and_deviation() {
        let mut draws = Draws::new(7);
        let values: Vec<f64> = (0..20_000).map(|_| draws.normal(1.34, 0.26)).collect();
        let mean = values.iter().sum::<f64>() / 20_000.0;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 20_000.0;
        assert!((mean - 1.34).abs() < 0.01, "{mean}");
        // Cutting at three deviations takes 1.3 % off.
        assert!(
            (variance.sqrt() - 0.257).abs() < 0.005,
            "{}",
            variance.sqrt()
        );
    }
}
