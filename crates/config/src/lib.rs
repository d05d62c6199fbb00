//! Shared parts of scenario, launch and experiment files: quantities with units, errors with file, line and caret, seeds,
//! speeds, overrides of single values, and the files that come with the programs.

pub mod diagnostic;
pub mod overrides;
pub mod seed;
pub mod shipped;
pub mod speed;
pub mod units;

pub use diagnostic::{FileError, Source};
pub use overrides::{Changes, Override};
pub use speed::Speed;
