//! Runs as files for other programs: tables of events and states ([`tables`]), a log for ShiViz ([`shiviz`]), a trace of
//! wall-clock time ([`trace`]), emotions ([`emotionml`]), trajectories ([`trajectories`]) and a bag of ROS 2 ([`ros`]). A record is
//! read tick by tick, so the length of a run does not matter.

pub mod csv;
pub mod draft;
pub mod emotionml;
pub mod ros;
pub mod shiviz;
pub mod tables;
pub mod trace;
pub mod trajectories;

use config::FileError;
use record::RecordError;
use recording::RecordingError;

/// Why an export is incomplete. What was written of it is of no use.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The record of the run cannot be read.
    #[error(transparent)]
    Read(#[from] RecordError),
    /// A file of the export cannot be made.
    #[error(transparent)]
    File(#[from] FileError),
    /// The output cannot be written.
    #[error("the export cannot be written: {0}")]
    Write(#[from] std::io::Error),
}

impl From<RecordingError> for ExportError {
    fn from(error: RecordingError) -> Self {
        Self::Read(RecordError::unusable(error))
    }
}
