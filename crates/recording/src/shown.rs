//! What observers see of a recorded tick, as in a run in progress: frames have the last report of each robot, and panels
//! are shown for a while.

use std::collections::BTreeMap;

use protocol::messages::{Presence, Report, RobotFrame};
use protocol::{RobotName, Tick};

use crate::content::{Header, PlacedRobot, RecordedTick};
use crate::damage::RecordingError;
use crate::read::Recording;

/// How long a panel is shown, simulated seconds. In a fast run panels arrive more seldom, and would show old states.
const PANEL_S: f64 = 2.0;

/// For how many ticks a panel is shown: in one process, until the next one.
#[must_use]
pub fn panel_ticks(tick_s: f64) -> Tick {
    (PANEL_S / tick_s).round().max(1.0) as Tick
}

impl Header {
    /// The first of the ticks of which panels are shown in a tick.
    #[must_use]
    pub fn first_of_panels(&self, tick: Tick) -> Tick {
        tick.saturating_sub(panel_ticks(self.tick_s) - 1)
    }
}

/// The last report of each robot, as far as ticks have been read.
#[derive(Debug, Default)]
pub struct LastReports {
    reports: BTreeMap<RobotName, Report>,
}

impl LastReports {
    /// The robots of a tick, as the frame of a run in progress has them. A robot is shown from its first report on. Ticks may
    /// come in any order.
    ///
    /// # Errors
    /// [`RecordingError`] if the last report of a robot that missed the tick cannot be read.
    pub fn robots(
        &mut self,
        recording: &Recording,
        recorded: &RecordedTick,
    ) -> Result<Vec<RobotFrame>, RecordingError> {
        let mut robots = Vec::new();
        for robot in &recorded.frame.robots {
            let report = self.last_report(recording, recorded, robot)?;
            robots.extend(report.map(|report| robot_frame(robot, report)));
        }
        Ok(robots)
    }

    fn last_report(
        &mut self,
        recording: &Recording,
        recorded: &RecordedTick,
        robot: &PlacedRobot,
    ) -> Result<Option<&Report>, RecordingError> {
        let name = &robot.name;
        let mut newer = recorded.reports.get(name).cloned();
        if newer.is_none() {
            let Some(tick) = robot.missed.and_then(|missed| missed.last_report) else {
                return Ok(None);
            };
            let last = self.reports.get(name);
            if last.is_none_or(|report| report.tick != tick) {
                let read = recording.read(tick, tick.saturating_add(1))?.pop();
                newer = read.and_then(|mut tick| tick.reports.remove(name));
                self.reports.remove(name);
            }
        }

        if let Some(report) = newer {
            self.reports.insert(name.clone(), report);
        }
        Ok(self.reports.get(name))
    }
}

fn robot_frame(robot: &PlacedRobot, report: &Report) -> RobotFrame {
    RobotFrame {
        name: robot.name.clone(),
        location: robot.location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        blocked: robot.blocked,
        emotion_state: report.emotion_state.clone(),
        behavior_state: report.behavior_state.clone(),
        state_variables: report.state_variables.clone(),
        generation: report.generation,
        presence: match robot.missed {
            Some(_) => Presence::Gone,
            None => Presence::Here,
        },
    }
}
