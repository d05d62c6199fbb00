//! What the robots of a recorded run have reported last.

use std::collections::BTreeMap;

use observe::RobotState;
use protocol::RobotName;
use protocol::messages::{Point, Report};
use recording::PlacedRobot;

/// What robots reported last, and where they stand.
#[derive(Default)]
pub struct LastStates {
    reports: BTreeMap<RobotName, Report>,
    locations: BTreeMap<RobotName, Point>,
}

impl LastStates {
    /// Takes the reports of a tick, and where its robots stand, into account.
    pub fn note(&mut self, reports: BTreeMap<RobotName, Report>, robots: Vec<PlacedRobot>) {
        self.reports.extend(reports);
        for robot in robots {
            self.locations.insert(robot.name, robot.location);
        }
    }

    /// The state of a robot; `None` before its first report.
    pub fn of(&self, robot: &RobotName) -> Option<RobotState<'_>> {
        let report = self.reports.get(robot)?;
        Some(RobotState {
            location: *self.locations.get(robot)?,
            state_variables: &report.state_variables,
            emotion_state: &report.emotion_state,
            behavior_state: &report.behavior_state,
        })
    }
}
