//! The files of an epoch.

use std::path::PathBuf;

use protocol::Epoch;

/// The files of the record of one epoch.
#[derive(Debug, Clone)]
pub struct EpochFiles {
    /// The epoch.
    pub epoch: Epoch,
    /// Its scenario, complete.
    pub scenario: PathBuf,
    /// Its events.
    pub events: PathBuf,
    /// Its recording.
    pub recording: PathBuf,
}
