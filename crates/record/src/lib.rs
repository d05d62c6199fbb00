//! The record of a run: its folder ([`RunFolder`]), its events with their seals ([`seal`]), its summary ([`Summary`]), read tick by
//! tick ([`Record`]) and compared ([`difference`]). The simulator writes through it; everything else reads through it.

pub mod difference;
mod error;
pub mod folder;
pub mod read;
pub mod seal;
pub mod summary;

pub use error::RecordError;
pub use folder::new_run::{IfTaken, NewRun, Reserved};
pub use folder::{EpochFiles, RunFolder, RunLock};
pub use read::{Entry, Record};
/// Names of the files in the folder of a run.
pub use scenario::files as names;
pub use summary::Summary;
