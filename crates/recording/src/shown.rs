//! What observers see of a recorded tick, as in a run in progress: frames have the last report of each robot.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::RobotName;
use protocol::messages::{Presence, Report, RobotFrame};

use crate::content::{PlacedRobot, RecordedTick};
use crate::damage::RecordingError;
use crate::read::Recording;

/// The last report of each robot, as far as ticks have been read.
#[derive(Debug, Default)]
pub struct LastReports {
    reports: BTreeMap<RobotName, Arc<Report>>,
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
        Ok(self.reports.get(name).map(Arc::as_ref))
    }
}

fn robot_frame(robot: &PlacedRobot, report: &Report) -> RobotFrame {
    RobotFrame {
        name: robot.name.clone(),
        location: robot.location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        heading_rad: robot.heading_rad,
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
