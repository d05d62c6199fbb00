//! The jokes of a robot, told at random intervals.

use robot::Cars;
use serde::{Deserialize, Serialize};

use crate::chance::Chance;

/// When to tell the next joke, and which.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Jokes {
    chance: Chance,
    /// Time until the next joke, seconds.
    until_s: f64,
}

impl Jokes {
    /// Jokes at exponentially distributed intervals with this mean, drawn from this stream.
    pub(crate) fn new(mut chance: Chance, mean_s: f64) -> Self {
        let until_s = chance.exponential(mean_s);
        Self { chance, until_s }
    }

    /// Draws from another stream, from the next joke on.
    pub(crate) fn reseed(&mut self, chance: Chance) {
        self.chance = chance;
    }

    pub(crate) fn advance(&mut self, tick_s: f64) {
        self.until_s -= tick_s;
    }

    /// Whether the time for a joke has come.
    pub(crate) fn are_due(&self) -> bool {
        self.until_s <= 0.0
    }

    /// Tells one of these jokes, and draws the time of the next.
    pub(crate) fn tell(&mut self, jokes: &[&str], mean_s: f64, cars: &mut Cars<'_>) {
        let joke = jokes[self.chance.one_of(jokes.len())];
        cars.log(format!("jokes: {joke}"));
        self.until_s = self.chance.exponential(mean_s);
    }
}
