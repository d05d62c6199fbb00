//! Statistics of experiments: estimates of samples, times to an event that some runs do not reach, and differences between
//! arms whose runs are paired by seed. All of it is computed with + - * / , square roots and `libm`, and chance comes from
//! named streams with fixed seeds: the same outcomes give the same numbers to the last bit on every platform.
//!
//! The code is our own because `statrs`, the crate for such distributions, calls the platform's `ln` and `exp`, and has
//! neither the bootstrap nor survival. `tests/tests/system/statistics.rs` compares all of it with SciPy and lifelines.

mod bootstrap;
mod distribution;
mod holm;
mod sample;
mod sign_flip;
mod survival;

pub use bootstrap::{Bootstrapped, Interval, RESAMPLES, bootstrap, resample};
pub use holm::holm;
pub use sample::{Estimate, Step, ecdf, quantile};
pub use sign_flip::{FLIPS, SignFlip, dominance};
pub use survival::{LogRank, RestrictedMeans, Survival, SurvivalStep, TimeTo, share_of_events};

/// Fewest seeds of an experiment: with 8 pairs the smallest p value of a sign-flip test is 2 / 2^8 = 0.008, so that a
/// difference can be shown at all.
pub const MIN_SAMPLE: u64 = 8;
