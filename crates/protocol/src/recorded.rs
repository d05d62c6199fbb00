//! What the recording of a run contains beside messages: the crate `recording` writes and reads it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::event::Event;
use crate::messages::{
    Awaited, Cut, DisplayUnit, Epoch, GuestMood, LayerFrame, LogRecord, Point, SiteFrame, Standing,
    StateVariables, StaticWorld, Tick,
};
use crate::name::{RobotName, RunName};

/// What does not change during the epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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

    /// The tick at a simulated time in nanoseconds.
    #[must_use]
    pub fn tick_at(&self, time_ns: u64) -> Tick {
        (time_ns as f64 / (self.tick_s * 1e9)).round() as Tick
    }
}

/// The field after a tick.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Frame {
    /// The tick.
    pub tick: Tick,
    /// The robots, by name.
    pub robots: Vec<PlacedRobot>,
    /// Centers of the guests in whole millimeters, x and y in turn.
    pub guests_mm: Vec<i64>,
    /// The number of each of them, which it keeps; left out where guests do not enter and leave: then they are counted from 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub guest_numbers: Vec<u32>,
    /// Guests that are not content, by their index in `guests_mm`, by mood.
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
    /// The guests on the field: the number of each, and its center in meters.
    pub fn guests(&self) -> impl Iterator<Item = (u32, [f64; 2])> + '_ {
        let places = self.guests_mm.chunks_exact(2);
        (0..).zip(places).map(|(index, place)| {
            let number = self.guest_numbers.get(index as usize);
            let number = number.copied().unwrap_or(index);
            (number, [place[0], place[1]].map(|mm| mm as f64 / 1000.0))
        })
    }

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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Missed {
    /// Tick of its last report; none if it has never reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_report: Option<Tick>,
}

/// Wall-clock times of a tick, in nanoseconds since the epoch began. They differ from run to run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
