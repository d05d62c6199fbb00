//! Statistics of experiments: estimates of samples, times to an event that some runs do not reach, and differences between
//! arms whose runs are paired by seed. All of it is computed with + - * / , square roots and `libm`, and chance comes from
//! named streams with fixed seeds: the same outcomes give the same numbers to the last bit on every platform.
//!
//! Intervals were chosen by their coverage, and tests by their p values where there is no difference, over measures of real
//! runs: `docs/coverage.md`, from `tests/tests/system/coverage.rs`. The code is our own because `statrs`, the crate for such
//! distributions, calls the platform's `ln` and `exp`, and has neither score intervals nor survival.
//! `tests/tests/system/statistics.rs` compares all of it with SciPy and lifelines.

mod digits;
mod distribution;
mod estimate;
mod holm;
mod paired_times;
mod sample;
mod shares;
mod sign_flip;
mod survival;

pub use digits::{decimals, fixed, signed};
pub use estimate::{Estimate, Interval, MIN_VALUES};
pub use holm::holm;
pub use paired_times::PairedTimes;
pub use sample::{Step, ecdf, quantile};
pub use sign_flip::{FLIPS, SignFlip, dominance, least_p};
pub use survival::{CensoredTime, Survival, SurvivalStep};
