//! Shared parts of scenario, launch and experiment files: quantities with units, errors with file, line and caret, seeds,
//! speeds, overrides of single values, lists of fixed lengths, and the files that come with the programs.

pub mod bulk;
pub mod diagnostic;
mod fixed_list;
pub mod overrides;
mod render;
pub mod seed;
pub mod shipped;
pub mod speed;
pub mod units;

pub use diagnostic::{FileError, Source};
pub use fixed_list::FixedList;
pub use overrides::{Changes, Override};
pub use render::{render, render_plain};
pub use speed::Speed;
