//! What a recording contains.

use std::collections::BTreeMap;

use protocol::messages::{
    Awaited, Cut, DisplayUnit, GuestMood, LayerFrame, LogRecord, Panel, Point, Report, SiteFrame,
    Standing, StateVariables, StaticWorld,
};
use protocol::{Epoch, Event, Message, RobotName, RunName, Tick};
use schemars::JsonSchema;
use serde::de::{Error, IgnoredAny};
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
    /// In what people are shown lengths and speeds.
    #[serde(default)]
    pub display_unit: DisplayUnit,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<[f64; 2]>,
    /// Walls, shapes of bodies, and where robots look.
    #[serde(default, skip_serializing_if = "StaticWorld::is_empty")]
    pub static_world: StaticWorld,
    /// The sites as they are at the start, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<SiteFrame>,
    /// The layers as they are at the start, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerFrame>,
    /// The robots of the scenario, by name.
    pub robots: Vec<RobotName>,
}

impl Header {
    /// Simulated time of a tick, nanoseconds: the time of its messages.
    #[must_use]
    pub fn time_ns(&self, tick: Tick) -> u64 {
        (tick as f64 * self.tick_s * 1e9).round() as u64
    }

    /// The sites after a tick, by name.
    #[must_use]
    pub fn sites_of(&self, frame: &Frame) -> Vec<SiteFrame> {
        let mut sites = self.sites.clone();
        for site in &mut sites {
            if let Some(state) = frame.sites.get(&site.name) {
                site.state = state.clone();
            }
        }
        sites
    }

    /// The layers after a tick, by name.
    #[must_use]
    pub fn layers_of(&self, frame: &Frame) -> Vec<LayerFrame> {
        let mut layers = self.layers.clone();
        for layer in &mut layers {
            let mut changed = frame.layers.iter();
            if let Some(now) = changed.find(|now| now.name == layer.name) {
                layer.clone_from(now);
            }
        }
        layers
    }

    /// What every reader of the format shows of the file.
    pub(crate) fn metadata(&self) -> BTreeMap<String, String> {
        let mut metadata = BTreeMap::from([
            ("run".to_owned(), self.run.to_string()),
            ("epoch".to_owned(), self.epoch.to_string()),
            ("seed".to_owned(), self.seed.to_string()),
            ("version".to_owned(), self.version.clone()),
            ("protocol".to_owned(), self.protocol.to_string()),
            ("tick_s".to_owned(), self.tick_s.to_string()),
        ]);
        if let Some(commit) = &self.commit {
            metadata.insert("commit".to_owned(), commit.clone());
        }
        metadata
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
    pub wall: WallTimes,
}

/// Everything that is recorded of one tick, of which nothing is copied: a [`RecordedTick`].
#[derive(Debug, Clone)]
pub struct TickView<'a> {
    /// The field after the tick.
    pub frame: &'a Frame,
    /// The events of the tick, without seals.
    pub events: &'a [Event],
    /// The reports for this tick.
    pub reports: BTreeMap<&'a RobotName, &'a Report>,
    /// The newest panels.
    pub panels: &'a BTreeMap<RobotName, Panel>,
    /// Wall-clock times.
    pub wall: &'a WallTimes,
}

impl TickView<'_> {
    /// The lines of the log about this tick, which are made from its events.
    pub(crate) fn log(&self, header: &Header) -> Vec<LogRecord> {
        log(self.frame.tick, self.events, self.wall, header)
    }
}

impl RecordedTick {
    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.frame.tick
    }

    /// The tick as it is recorded.
    #[must_use]
    pub fn view(&self) -> TickView<'_> {
        TickView {
            frame: &self.frame,
            events: &self.events,
            reports: self.reports.iter().collect(),
            panels: &self.panels,
            wall: &self.wall,
        }
    }

    /// The lines of the log about this tick, which are made from its events.
    #[must_use]
    pub fn log(&self, header: &Header) -> Vec<LogRecord> {
        log(self.tick(), &self.events, &self.wall, header)
    }
}

fn log(tick: Tick, events: &[Event], wall: &WallTimes, header: &Header) -> Vec<LogRecord> {
    let mut lines = wall.late.clone();
    for event in events {
        lines.extend(event.log_record(header.epoch, tick, header.tick_s));
    }
    lines
}

/// What is recorded of one tick, with reports and panels as they are in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct RawTick {
    /// The field after the tick.
    pub frame: Frame,
    /// The events of the tick.
    pub events: Vec<Event>,
    /// The reports for this tick.
    pub reports: BTreeMap<RobotName, Json>,
    /// The newest panels.
    pub panels: BTreeMap<RobotName, Json>,
    /// Wall-clock times.
    pub wall: WallTimes,
}

impl RawTick {
    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.frame.tick
    }

    /// The lines of the log about this tick.
    #[must_use]
    pub fn log(&self, header: &Header) -> Vec<LogRecord> {
        log(self.tick(), &self.events, &self.wall, header)
    }

    /// Decodes reports and panels.
    pub(crate) fn decode(self) -> Result<RecordedTick, serde_json::Error> {
        let mut reports = BTreeMap::new();
        for (robot, report) in self.reports {
            reports.insert(robot, Report::from_json(&report.0)?);
        }
        let mut panels = BTreeMap::new();
        for (robot, panel) in self.panels {
            panels.insert(robot, Panel::from_json(&panel.0)?);
        }

        Ok(RecordedTick {
            frame: self.frame,
            events: self.events,
            reports,
            panels,
            wall: self.wall,
        })
    }
}

/// A JSON object, as it is in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Json(Vec<u8>);

impl Json {
    /// Bytes of a message that have not been checked yet.
    pub(crate) fn unchecked(bytes: &[u8]) -> Self {
        Self(bytes.to_vec())
    }

    /// Checks that it is a JSON object.
    pub(crate) fn check(&self) -> Result<(), serde_json::Error> {
        let IgnoredAny = serde_json::from_slice(&self.0)?;
        if self.0.trim_ascii().starts_with(b"{") {
            Ok(())
        } else {
            Err(serde_json::Error::custom("not a JSON object"))
        }
    }

    /// The fields of the object with the commas between them, without its braces.
    #[must_use]
    pub fn fields(&self) -> &[u8] {
        let text = self.0.trim_ascii();
        let end = text.len().saturating_sub(1);
        text.get(1..end).unwrap_or_default().trim_ascii()
    }

    /// The text.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }
}

/// What happened in a tick, without what the field and the robots were like.
#[derive(Debug, Clone, PartialEq)]
pub struct TickEvents {
    /// The tick.
    pub tick: Tick,
    /// The events of the tick, in the order of `events.jsonl`, without seals. The last tick of a run also has its end.
    pub events: Vec<Event>,
    /// Robots for which the clock was held. Not reproducible.
    pub awaited: Vec<Awaited>,
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
    /// Guests that are not content, by their index, by mood.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub guest_moods: BTreeMap<GuestMood, Vec<u32>>,
    /// The states of sites that are others than at the start, by name of the site.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sites: BTreeMap<String, StateVariables>,
    /// The layers that are others than at the start, whole, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerFrame>,
    /// Pairs of robots between which the medium lets nothing through.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cuts: Vec<Cut>,
    /// Robots that a robot could not query in the tick, by the robot that could not query them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unreachable: BTreeMap<RobotName, Vec<RobotName>>,
    /// How the expectations of the scenario stand, in its order. Those that are judged at the end of the run are open here: the
    /// last tick has events about them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expectations: Vec<Standing>,
    /// The numbers that the measures of the scenario have up to the tick, by name. One that has none yet is left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, f64>,
}

impl Frame {
    /// How the expectations of the scenario stand after the events of the tick, which may be the last one of the run.
    #[must_use]
    pub fn standings(&self, events: &[Event]) -> Vec<Standing> {
        let mut standings = self.expectations.clone();
        for event in events {
            if let Event::Judged {
                expectation,
                verdict,
                ..
            } = event
            {
                let mut named = standings.iter_mut();
                if let Some(standing) = named.find(|standing| standing.expectation == *expectation)
                {
                    standing.verdict = Some(*verdict);
                }
            }
        }

        standings
    }
}

/// A robot in a [`Frame`]. What it does and feels is in its report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlacedRobot {
    /// Name of the robot.
    pub name: RobotName,
    /// Its center.
    pub location: Point,
    /// Its heading, radians counter-clockwise from +x, if it drives like wheels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_rad: Option<f64>,
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
pub struct WallTimes {
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
    /// Lines of the log about that, which no event has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub late: Vec<LogRecord>,
}
