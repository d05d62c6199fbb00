//! What was played, and what the robot did in it.

use std::time::Duration;

use protocol::messages::{Point, Report, TickUpdate};
use protocol::{Epoch, Tick};

use crate::seen::ReportedCommand;

/// A tick that was played.
#[derive(Debug, Clone)]
pub(crate) struct PlayedTick {
    pub(crate) epoch: Epoch,
    pub(crate) tick: Tick,
    pub(crate) news: TickUpdate,
    /// Where the robot stands in it.
    pub(crate) location: Point,
    pub(crate) report: Report,
    /// Its commands, by number.
    pub(crate) commands: Vec<ReportedCommand>,
    /// The place of its report in [`crate::seen::Seen::answers`].
    pub(crate) index: usize,
    /// From the clock to the report, wall clock.
    pub(crate) took: Duration,
}

/// Ticks that were played, in their order.
pub(crate) type Transcript = Vec<PlayedTick>;
