//! Files that commands write.

use std::path::Path;

use miette::miette;
use simulator::EpochFiles;

/// Checks that a file to be written is no part of the record of a run.
///
/// # Errors
/// If it is.
pub(crate) fn check_not_record(output: &Path, record: &EpochFiles) -> miette::Result<()> {
    let Ok(path) = output.canonicalize() else {
        return Ok(()); // There is no such file yet.
    };

    for source in [&record.events, &record.recording, &record.scenario] {
        if source.canonicalize().is_ok_and(|source| source == path) {
            return Err(miette!(
                "{} is the record of the run; choose another --output",
                output.display()
            ));
        }
    }
    Ok(())
}
