//! What the robots of a recorded run have reported last, and the layers, which follow from what they did.

use std::collections::BTreeMap;
use std::sync::Arc;

use environment::layers::Layers;
use observe::RobotState;
use protocol::messages::{Point, Report};
use protocol::{RobotName, Tick};
use recording::PlacedRobot;
use scenario::Scenario;

/// What robots reported last, where they stand, and the layers.
pub struct LastStates {
    reports: BTreeMap<RobotName, Arc<Report>>,
    locations: BTreeMap<RobotName, Point>,
    layers: Layers,
}

impl LastStates {
    /// Before the first tick of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            reports: BTreeMap::new(),
            locations: BTreeMap::new(),
            layers: Layers::new(scenario),
        }
    }

    /// Takes the reports of a tick, and where its robots stand, into account. All ticks are given, in their order.
    pub fn note(
        &mut self,
        tick: Tick,
        reports: BTreeMap<RobotName, Arc<Report>>,
        robots: Vec<PlacedRobot>,
    ) {
        for robot in robots {
            self.locations.insert(robot.name, robot.location);
        }

        if tick > 0 {
            self.layers.pass_tick();
        }
        self.layers.begin_actions();
        for (robot, report) in &reports {
            let at = self.locations.get(robot).copied().unwrap_or_default();
            self.layers.carry_out(robot, at, &report.layer_actions);
        }
        self.reports.extend(reports);
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

    /// The numbers of the cells of a layer.
    pub fn layer(&self, name: &str) -> Option<&[f64]> {
        self.layers.cells(name)
    }
}
