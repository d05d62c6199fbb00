//! Shared parts of scenario, launch and experiment files: quantities with units, errors with file, line and caret, seeds,
//! speeds, and overrides of single values.

pub mod diagnostic;
pub mod overrides;
pub mod seed;
pub mod speed;
pub mod units;

pub use diagnostic::{FileError, Source};
pub use overrides::{Changes, Override};
pub use speed::Speed;
