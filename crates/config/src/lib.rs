//! What scenario files, launch files and experiment files share: quantities with units, errors that show file, line and
//! caret, seeds, speeds, and overrides of single values.

pub mod diagnostic;
pub mod overrides;
pub mod seed;
pub mod speed;
pub mod units;

pub use diagnostic::{FileError, Source};
pub use overrides::{Changes, Override};
pub use speed::Speed;
