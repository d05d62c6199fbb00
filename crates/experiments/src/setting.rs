//! What an experiment changes in its scenario, and where its file states it.

use std::ops::Range;

use config::Override;

/// A change of the scenario, and where the experiment states it.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The change.
    pub change: Override,
    /// Its place in the experiment file, bytes; `None` if it is an option of the command line.
    pub span: Option<Range<usize>>,
}

impl Setting {
    /// A change that the experiment file states.
    pub(super) fn at(change: Override, span: Range<usize>) -> Self {
        Self {
            change,
            span: Some(span),
        }
    }
}
