//! The last lines of a process's error output, which are shown if it fails.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Number of lines that are kept.
const TAIL_LINES: usize = 12;

/// The last lines that a process wrote to its error output.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tail(Arc<Mutex<VecDeque<String>>>);

impl Tail {
    /// Adds a line and drops the oldest one if there are too many.
    pub(crate) fn push(&self, line: String) {
        let mut lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == TAIL_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// The lines, oldest first.
    pub(crate) fn lines(&self) -> Vec<String> {
        let lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().cloned().collect()
    }
}
