//! The last lines of an error output, to be shown when its process fails.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Last lines of a process's error output that are shown when it fails.
const TAIL_LINES: usize = 12;

/// The last lines that a process wrote to its error output.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tail(Arc<Mutex<VecDeque<String>>>);

impl Tail {
    /// Keeps a line; the oldest one goes.
    pub(crate) fn push(&self, line: String) {
        let mut lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == TAIL_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// The lines, oldest first.
    pub(crate) fn lines(&self) -> Vec<String> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .iter()
            .cloned()
            .collect()
    }
}
