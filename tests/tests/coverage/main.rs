//! Whether intervals cover, and how p values are distributed, over measures of real runs. A population of runs is played, and
//! samples of n pairs with the same seeds are drawn from it with replacement: the truth is that of the population. It prints the
//! tables of `docs/coverage.md`:
//!
//!     cargo test --release -p system-tests --test coverage -- --ignored --nocapture

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

mod before;
mod intervals;
mod p_values;
mod population;

use self::population::Population;

/// Sizes of samples.
const SIZES: [usize; 5] = [3, 8, 16, 32, 64];
/// Shares of samples whose interval must cover the truth, from 8 pairs on.
const MIN_COVERED: f64 = 0.935;
/// Standard errors of the simulation that are allowed beyond a limit.
const ERRORS: f64 = 3.0;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn intervals_cover_and_p_values_are_uniform() {
    let population = Population::play();
    let all = intervals::kinds(&population);
    let rows = population::side_by_side(&all, intervals::Row::of);
    println!("{}", intervals::table(&rows));

    let times = p_values::kinds(&population);
    let tests = population::side_by_side(&times, p_values::Row::of);
    println!("{}", p_values::table(&tests));

    for row in &rows {
        row.check();
    }
    for row in &tests {
        row.check();
    }
}

/// The standard error of a share of so many draws.
fn error(share: f64, draws: usize) -> f64 {
    (share * (1.0 - share) / draws as f64).sqrt()
}
