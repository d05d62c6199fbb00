//! What the robot finds: the field, the parameters, the other robots.

use std::collections::BTreeMap;

use protocol::messages::{
    DriveLimits, KnownSite, NEWS_FLAGS, Parameters, Point, PublicState, Rays,
};
use protocol::{MAX_NAME_LEN, RobotName, Tick};

/// What a conformance check plays.
#[derive(Debug, Clone)]
pub struct CheckSetting {
    /// The name that the robot must ask for; without it any name is accepted.
    pub name: Option<RobotName>,
    /// The seed of the run.
    pub seed: u64,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// Distance within which the robot senses other bodies, meters.
    pub sensing_range_m: f64,
    /// The fan of rays, if there is one. Nothing is within their range.
    pub rays: Option<Rays>,
    /// The sites that every robot knows of. The robot is within the range of none.
    pub known_sites: Vec<KnownSite>,
    /// The layers that robots sense.
    pub layers: Vec<PlayedLayer>,
    /// The robots of the roster. Empty: the robot itself, without parameters, and one other.
    pub fake_peers: BTreeMap<RobotName, RosterRobot>,
    /// Texts of commands that the robot understands, if its [`RosterRobot::understands`] has none.
    pub commands: Vec<String>,
    /// Ticks of the longer checks.
    pub ticks: Tick,
}

/// A layer, of which the robot senses the cell in which it stands.
#[derive(Debug, Clone)]
pub struct PlayedLayer {
    /// Its name.
    pub name: String,
    /// Side of a cell, meters.
    pub cell_m: f64,
    /// The number of each cell.
    pub value: f64,
}

/// A robot of the roster.
#[derive(Debug, Clone, Default)]
pub struct RosterRobot {
    /// Where it starts, meters.
    pub location: Point,
    /// Its parameters, if it is the one that is checked.
    pub parameters: Parameters,
    /// Its limits, if it is the one that is checked and drives like wheels.
    pub drive: Option<DriveLimits>,
    /// Its heading at the start, if it drives, radians counter-clockwise from +x.
    pub heading_rad: f64,
    /// Its states by tick, if it is not; after the last one it stays as it is.
    pub states: Vec<PublicState>,
    /// Texts of the commands that it understands.
    pub understands: Vec<String>,
}

/// Ticks of the longer checks by default.
const TICKS: Tick = 100;
/// Where a robot without a scenario starts, and where the other one stands, meters.
const CENTER: Point = Point { x: 5.0, y: 5.0 };
const BESIDE: Point = Point { x: 7.0, y: 6.0 };
/// The other ones, and what they are called where a robot of the roster has that name.
const OTHERS: [&str; 4] = ["Echo", "Zoe", "Echo3", "Echo4"];
/// Robots of the part in a run, at least.
const RUN_ROBOTS: usize = 3;
/// Those of a crowd, of which the first ones sort before the second ones, byte by byte: an upper-case letter, the operator's name.
pub const IN_ORDER: [[&str; 2]; 2] = [["Zoe", "amy"], ["operator", "zed"]];
/// What their names have beside letters and digits.
const MARKS: &str = "-._";

impl Default for CheckSetting {
    /// A small field with one other robot, and no parameters.
    fn default() -> Self {
        Self {
            name: None,
            seed: 2002,
            tick_s: 0.5,
            field_m: [10.0, 10.0],
            body_m: 0.5,
            sensing_range_m: 2.0,
            rays: None,
            known_sites: Vec::new(),
            layers: Vec::new(),
            fake_peers: BTreeMap::new(),
            commands: Vec::new(),
            ticks: TICKS,
        }
    }
}

impl CheckSetting {
    /// The roster for a robot that asks to be `name`, or why it is not of the roster.
    pub fn cast_for(&self, name: &RobotName) -> Result<BTreeMap<RobotName, RosterRobot>, String> {
        if let Some(wanted) = self.name.as_ref().filter(|wanted| *wanted != name) {
            return Err(format!(
                "the robot asks to be {name}, and {wanted} is checked"
            ));
        }

        if self.fake_peers.is_empty() {
            return Ok(pair(name));
        }

        if !self.fake_peers.contains_key(name) {
            let roster: Vec<&str> = self.fake_peers.keys().map(RobotName::as_str).collect();
            return Err(format!(
                "no robot of the scenario is called {name}; its robots are {}",
                roster.join(", ")
            ));
        }

        Ok(self.fake_peers.clone())
    }

    /// A roster with at least two robots beside the one that is checked: those of `roster`, and others that stand still.
    pub fn with_others(
        &self,
        roster: &BTreeMap<RobotName, RosterRobot>,
    ) -> BTreeMap<RobotName, RosterRobot> {
        let mut roster = roster.clone();
        for name in OTHERS.iter().filter_map(|other| RobotName::new(other).ok()) {
            if roster.len() >= RUN_ROBOTS {
                break;
            }
            roster.entry(name).or_insert_with(|| self.standing_still(0));
        }
        roster
    }

    /// A large roster, in which this robot has the highest flag, if it is not of a larger one already: the robots of `roster`, others
    /// with names as long as they may be, and those of [`IN_ORDER`].
    pub fn with_crowd(
        &self,
        roster: &BTreeMap<RobotName, RosterRobot>,
        name: &RobotName,
    ) -> BTreeMap<RobotName, RosterRobot> {
        let mut roster = roster.clone();
        let before = roster.keys().filter(|other| *other < name).count();
        let missing = (NEWS_FLAGS - 1).saturating_sub(before);
        let long = (0..missing).map(|number| {
            let rest = MAX_NAME_LEN - 2 - MARKS.len();
            format!("{number:02}{MARKS}{}", "a".repeat(rest))
        });
        let short = IN_ORDER.iter().flatten().map(|name| (*name).to_owned());
        for (number, name) in long
            .chain(short)
            .filter_map(|name| RobotName::new(&name).ok())
            .enumerate()
        {
            roster
                .entry(name)
                .or_insert_with(|| self.standing_still(number));
        }
        roster
    }

    /// Each number has a place of its own.
    fn standing_still(&self, number: usize) -> RosterRobot {
        let [width_m, height_m] = self.field_m;
        let share = 0.25 + 0.01 * number as f64;
        RosterRobot {
            location: Point::new(width_m * share, height_m * 0.75),
            ..RosterRobot::default()
        }
    }
}

/// The robot and one other.
fn pair(name: &RobotName) -> BTreeMap<RobotName, RosterRobot> {
    let mut fake_peers = BTreeMap::new();
    let other = OTHERS
        .iter()
        .filter_map(|other| RobotName::new(other).ok())
        .find(|other| other != name);
    if let Some(other) = other {
        let role = RosterRobot {
            location: BESIDE,
            ..RosterRobot::default()
        };
        fake_peers.insert(other, role);
    }

    let own = RosterRobot {
        location: CENTER,
        ..RosterRobot::default()
    };
    fake_peers.insert(name.clone(), own);
    fake_peers
}
