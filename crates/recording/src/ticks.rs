//! A recording from its beginning to its end.

use std::collections::VecDeque;

use protocol::Tick;

use crate::content::RecordedTick;
use crate::damage::RecordingError;
use crate::read::Recording;

/// Ticks that are read from the file in one go.
const AT_ONCE: Tick = 64;

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

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The next tick; `None` after the last complete one.
    ///
    /// # Errors
    /// [`RecordingError`] if it cannot be read or is damaged.
    pub fn next_tick(&mut self) -> Result<Option<RecordedTick>, RecordingError> {
        if self.ahead.is_empty() && self.unread < self.recording.len() {
            let to = self.unread.saturating_add(AT_ONCE);
            self.ahead = self.recording.read(self.unread, to)?.into();
            self.unread += self.ahead.len() as Tick;
        }
        Ok(self.ahead.pop_front())
    }
}
