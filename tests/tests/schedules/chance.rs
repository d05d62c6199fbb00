//! The one source of chance of a schedule.

use protocol::random::{Stream, stream, unit};

/// Draws from a stream of the seed.
pub(crate) struct Chance(Stream);

impl Chance {
    pub(crate) fn new(seed: u64, name: &str) -> Self {
        Self(stream(seed, name))
    }

    /// Whether something of this probability happens.
    pub(crate) fn happens(&mut self, probability: f64) -> bool {
        unit(&mut self.0) < probability
    }

    /// A whole number below `count`.
    pub(crate) fn below(&mut self, count: u64) -> u64 {
        (unit(&mut self.0) * count as f64) as u64
    }

    /// A number from 0 to `most`.
    pub(crate) fn up_to(&mut self, most: f64) -> f64 {
        unit(&mut self.0) * most
    }

    /// A whole number between the two; each power of two is as likely as the next.
    pub(crate) fn magnitude(&mut self, least: u64, most: u64) -> u64 {
        let orders = u64::from((most / least).ilog2()) + 1;
        let order = least << self.below(orders);

        (order + self.below(order)).min(most)
    }

    /// One of these.
    pub(crate) fn one_of<T: Clone>(&mut self, choices: &[T]) -> T {
        let index = self.below(choices.len() as u64) as usize;

        choices[index].clone()
    }
}
