//! Random numbers for robots: one stream for each purpose, so that a blocked step does not change when the next guest
//! takes a treat.

use rand::{Rng, SeedableRng};
use robot::Stream;
use serde::{Deserialize, Serialize};

/// A random stream that counts its draws, so that it can be saved and continued.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Position", into = "Position")]
pub struct Chance {
    position: Position,
    stream: Stream,
}

/// What is saved of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Position {
    key: u64,
    drawn: u64,
}

impl From<Position> for Chance {
    fn from(position: Position) -> Self {
        let mut stream = Stream::seed_from_u64(position.key);
        for _ in 0..position.drawn {
            stream.next_u64();
        }
        Self { position, stream }
    }
}

impl From<Chance> for Position {
    fn from(chance: Chance) -> Self {
        chance.position
    }
}

impl Chance {
    /// A stream whose seed is the next number of `parent`, the robot's own stream.
    pub fn split(parent: &mut Stream) -> Self {
        Self::from(Position {
            key: parent.next_u64(),
            drawn: 0,
        })
    }

    /// A stream from a seed.
    #[must_use]
    pub fn new(key: u64) -> Self {
        Self::from(Position { key, drawn: 0 })
    }

    /// Uniform in [0, 1): the upper 53 bits of a draw.
    pub fn uniform(&mut self) -> f64 {
        self.position.drawn += 1;
        // Both conversions are exact: 53 bits fit, and the factor is a power of two.
        (self.stream.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Exponential with this mean, by inversion. Not `rand_distr::Exp`: it takes the platform's logarithm and exponential function
    /// as soon as any dependency turns `num-traits/std` on, and a number of draws that differs.
    pub fn exponential(&mut self, mean: f64) -> f64 {
        -libm::log(1.0 - self.uniform()) * mean
    }

    /// Uniform between 0.5 and 1.5 times `mean`. It uses the basic operations alone, as everything must that decides
    /// where a body goes.
    pub fn around(&mut self, mean: f64) -> f64 {
        mean * (0.5 + self.uniform())
    }

    /// A direction as a unit vector, all directions equally probable: a point of a square, drawn until it is in the unit
    /// disc and not so near to its center that the direction would be coarse.
    pub fn direction(&mut self) -> (f64, f64) {
        loop {
            let x = 2.0 * self.uniform() - 1.0;
            let y = 2.0 * self.uniform() - 1.0;
            let square = x * x + y * y;
            if (1e-6..=1.0).contains(&square) {
                let length = square.sqrt();
                return (x / length, y / length);
            }
        }
    }

    /// An index below `count`, which must not be 0.
    pub fn one_of(&mut self, count: usize) -> usize {
        // Counts are small, so the product stays exact enough; the minimum guards the rounding at the upper end.
        ((self.uniform() * count as f64) as usize).min(count - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_stream_continues() {
        let mut chance = Chance::new(7);
        for _ in 0..100 {
            chance.uniform();
        }
        let text = serde_json::to_string(&chance).unwrap();
        let mut again: Chance = serde_json::from_str(&text).unwrap();
        assert_eq!(again.uniform().to_bits(), chance.uniform().to_bits());
    }

    #[test]
    fn draws_have_the_mean_they_should() {
        let mut chance = Chance::new(1);
        let mean =
            |draw: &mut dyn FnMut() -> f64| (0..20_000).map(|_| draw()).sum::<f64>() / 20_000.0;
        assert!((mean(&mut || chance.uniform()) - 0.5).abs() < 0.01);
        assert!((mean(&mut || chance.exponential(3.0)) - 3.0).abs() < 0.1);
        assert!((mean(&mut || chance.around(5.0)) - 5.0).abs() < 0.05);
        assert!(mean(&mut || chance.direction().0).abs() < 0.02);
        let (x, y) = chance.direction();
        assert!((x * x + y * y - 1.0).abs() < 1e-15);
    }
}
