//! Remarks about files that can be used, and may not mean what they say.

use std::path::Path;

use config::{Changes, FileError};
use scenario::Scenario;

/// Shows the remarks about a scenario file that has been loaded.
pub(crate) fn show(path: &Path, changes: &Changes) {
    // It has been loaded, so an error is that of a file that has changed since.
    if let Ok(remarks) = Scenario::remarks(path, changes) {
        show_all(remarks);
    }
}

/// Shows remarks.
pub(crate) fn show_all(remarks: Vec<FileError>) {
    for remark in remarks {
        terminal::note(config::render(&remark, None));
    }
}
