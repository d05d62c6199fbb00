//! A recording from its beginning to its end.

use std::collections::VecDeque;

use protocol::Tick;

use crate::content::RecordedTick;
use crate::damage::RecordingError;
use crate::read::{AT_ONCE, Recording};

/// The ticks of a recording, one after the other.
#[derive(Debug)]
pub struct Ticks {
    recording: Recording,
    /// The first tick that has not been read from the file.
    unread: Tick,
    /// Ticks that have been read and come next.
    ahead: VecDeque<RecordedTick>,
}

impl Ticks {
    /// From tick 0 on.
    #[must_use]
    pub fn of(recording: Recording) -> Self {
        Self {
            recording,
            unread: 0,
            ahead: VecDeque::new(),
        }
    }

    /// Makes this tick the next one.
    pub fn seek(&mut self, tick: Tick) {
        self.unread = tick;
        self.ahead.clear();
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The next tick; `None` after the last complete one. All ticks before one that is damaged can be read.
    ///
    /// # Errors
    /// [`RecordingError`] if it cannot be read or is damaged.
    pub fn next_tick(&mut self) -> Result<Option<RecordedTick>, RecordingError> {
        if self.ahead.is_empty() && self.unread < self.recording.len() {
            let to = self.unread.saturating_add(AT_ONCE);
            let read = self.recording.read(self.unread, to);
            // Damage further on does not keep the next tick from being read.
            let read = read.or_else(|_| self.recording.read(self.unread, self.unread + 1))?;
            self.unread += read.len() as Tick;
            self.ahead = read.into();
        }
        Ok(self.ahead.pop_front())
    }
}
