//! What was played, and what the robot did in it.

use std::time::Duration;

use protocol::messages::{Point, PublicState, Report, TickUpdate};
use protocol::{Epoch, Tick};

use crate::seen::ReportedCommand;

/// A tick that was played.
#[derive(Debug, Clone)]
pub struct PlayedTick {
    /// Its epoch.
    pub epoch: Epoch,
    /// Its number.
    pub tick: Tick,
    /// What was new for the robot.
    pub news: TickUpdate,
    /// Where the robot stands in it.
    pub location: Point,
    /// The report of the robot.
    pub report: Report,
    /// Its commands, by number.
    pub commands: Vec<ReportedCommand>,
    /// The place of its report in [`crate::seen::Seen::answers`].
    pub index: usize,
    /// From the clock to the report, wall clock.
    pub took: Duration,
}

impl PlayedTick {
    /// The state that the robot shows of it.
    pub fn state(&self) -> PublicState {
        let report = self.report.clone();
        PublicState {
            epoch: report.epoch,
            tick: report.tick,
            location: self.location,
            speed_mps: report.speed_mps,
            direction_rad: report.direction_rad,
            state_variables: report.state_variables,
            emotion_state: report.emotion_state,
            behavior_state: report.behavior_state,
        }
    }
}

/// Ticks that were played, in their order.
pub type Transcript = Vec<PlayedTick>;
