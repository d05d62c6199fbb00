//! Where files are that a scenario names.

use std::path::Path;

/// Where a scenario file finds what it names.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Folders<'a> {
    /// Where its relative paths lead from.
    pub(crate) files: &'a Path,
    /// Where its runs are.
    pub(crate) runs: &'a Path,
}
