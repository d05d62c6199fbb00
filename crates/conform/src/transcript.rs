//! What was played, and what the robot did in it.

use std::time::Duration;

use protocol::messages::{News, Point, Report};
use protocol::{Epoch, Tick};

use crate::seen::SentCommand;

/// A tick that was played.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) epoch: Epoch,
    pub(crate) tick: Tick,
    pub(crate) news: News,
    /// Where the robot stands in it.
    pub(crate) location: Point,
    pub(crate) report: Report,
    /// Its commands, by number.
    pub(crate) commands: Vec<SentCommand>,
    /// The place of its report in [`crate::seen::Seen::answers`].
    pub(crate) index: usize,
    /// From the clock to the report, wall clock.
    pub(crate) took: Duration,
}

/// Ticks that were played, in their order.
pub(crate) type Transcript = Vec<Entry>;
