//! What a recording contains.

use std::collections::BTreeMap;

use protocol::messages::{Awaited, Cut, LogRecord, Panel, Point, Report};
use protocol::{Epoch, Event, RobotName, RunName, Tick};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What does not change during the epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Header {
    /// The run.
    pub run: RunName,
    /// The epoch.
    pub epoch: Epoch,
    /// Seed of the epoch.
    pub seed: u64,
    /// Version of the simulator.
    pub version: String,
    /// Commit that the simulator was built from, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commit: Option<String>,
    /// Version of the contract between simulator and robots.
    pub protocol: u32,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Simulated time at which the run is to end, seconds.
    pub duration_s: f64,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<[f64; 2]>,
    /// The robots of the scenario, by name.
    pub robots: Vec<RobotName>,
}

impl Header {
    /// Simulated time of a tick, nanoseconds: the time of its messages.
    #[must_use]
    pub fn time_ns(&self, tick: Tick) -> u64 {
        (tick as f64 * self.tick_s * 1e9).round() as u64
    }

    /// The tick at a simulated time in nanoseconds.
    #[must_use]
    pub fn tick_at(&self, time_ns: u64) -> Tick {
        (time_ns as f64 / (self.tick_s * 1e9)).round() as Tick
    }
}

/// Everything that is recorded of one tick.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedTick {
    /// The field after the tick.
    pub frame: Frame,
    /// The events of the tick, in the order of `events.jsonl`, without seals. The last tick of a run also has its end.
    pub events: Vec<Event>,
    /// The reports for this tick, whole; a robot that missed the tick has none.
    pub reports: BTreeMap<RobotName, Report>,
    /// The newest panel of each robot from which one arrived during the tick. Not reproducible.
    pub panels: BTreeMap<RobotName, Panel>,
    /// Wall-clock times. Not reproducible.
    pub wall: Wall,
}

impl RecordedTick {
    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.frame.tick
    }

    /// The lines of the log about this tick, which are made from its events.
    #[must_use]
    pub fn log(&self, header: &Header) -> Vec<LogRecord> {
        let tick = self.tick();
        let time_s = tick as f64 * header.tick_s;
        let mut lines = Vec::new();
        for event in &self.events {
            lines.extend(event.log_record(header.epoch, tick, time_s));
        }
        lines
    }
}

/// The field after a tick.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Frame {
    /// The tick.
    pub tick: Tick,
    /// The robots, by name.
    pub robots: Vec<PlacedRobot>,
    /// Centers of the guests in whole millimeters, x and y in turn.
    pub guests_mm: Vec<i64>,
    /// Pairs of robots between which the medium lets nothing through.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cuts: Vec<Cut>,
    /// Robots that a robot could not query in the tick, by the robot that could not query them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unreachable: BTreeMap<RobotName, Vec<RobotName>>,
}

/// A robot in a [`Frame`]. What it does and feels is in its report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlacedRobot {
    /// Name of the robot.
    pub name: RobotName,
    /// Its center.
    pub location: Point,
    /// Whether its last move was refused.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub blocked: bool,
    /// The robot missed this tick, and its last report is that of an earlier tick, or it has never reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missed: Option<Missed>,
}

/// A robot has no report of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Missed {
    /// Tick of its last report; none if it has never reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_report: Option<Tick>,
}

/// Wall-clock times of a tick, in nanoseconds since the epoch began. They differ from run to run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Wall {
    /// When the tick was opened.
    pub opened_ns: u64,
    /// When every awaited report was there.
    pub completed_ns: u64,
    /// When the report of each robot arrived.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub reports_ns: BTreeMap<RobotName, u64>,
    /// Robots for which the clock was held, as people were notified of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub awaited: Vec<Awaited>,
}
