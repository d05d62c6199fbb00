//! What a scenario means: SI units, defaults filled in, every name and number legal.

use std::collections::BTreeMap;

use protocol::messages::{OnLate, Parameters, Point};
use protocol::{RobotName, Tick};
use world::{Field, Guests, Hall};

use super::fault::Fault;
use super::network::Network;

/// Seed where neither the file nor the command line gives one: a run is reproducible unless somebody asks for chance.
pub const DEFAULT_SEED: u64 = 1;

/// What is simulated, checked and complete.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Where all chance of the run comes from.
    pub seed: u64,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Number of ticks after tick 0.
    pub ticks: Tick,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// A robot that proposes to move faster is not advanced, m/s.
    pub max_speed_mps: f64,
    /// Distance within which robots sense other bodies, meters.
    pub sensing_range_m: f64,
    /// The moving obstacles.
    pub guests: Guests,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<Point>,
    /// The roster, by name.
    pub robots: BTreeMap<RobotName, RobotSpec>,
    /// What the clock does about robots that are late.
    pub lateness: Lateness,
    /// The network between the robots.
    pub network: Network,
    /// What befalls the robots' processes, in the order in which it begins.
    pub faults: Vec<Fault>,
    /// What is kept of the run.
    pub record: Record,
}

/// What is kept of a run, beside its events and its summary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// Whether the readable log is written.
    pub log: bool,
    /// Its name in the run's folder.
    pub log_name: String,
    /// Whether the field is recorded after every tick, for the console to play again.
    pub frames: bool,
}

impl Default for Record {
    fn default() -> Self {
        Self {
            log: true,
            log_name: crate::files::LOG.to_owned(),
            frames: true,
        }
    }
}

/// A robot of the scenario.
#[derive(Debug, Clone)]
pub struct RobotSpec {
    /// Which kind of robot it is; the launcher and `cars run` know how to make one.
    pub class: String,
    /// Where it starts, meters.
    pub at: Point,
    /// What it is told about itself; lengths, speeds and times are SI numbers.
    pub parameters: Parameters,
}

/// What the clock does about robots that are late.
#[derive(Debug, Clone, PartialEq)]
pub struct Lateness {
    /// For robots that have no rule of their own.
    pub on_late: OnLate,
    /// For single robots.
    pub own: BTreeMap<RobotName, OnLate>,
    /// After how long without a report a robot is late, seconds of wall clock.
    pub deadline_s: f64,
    /// After this many missed ticks in a row a robot is lost, where the clock goes on without it.
    pub lose_after: u32,
}

impl Lateness {
    /// What the clock does when this robot is late.
    #[must_use]
    pub fn of(&self, robot: &RobotName) -> OnLate {
        self.own.get(robot).copied().unwrap_or(self.on_late)
    }

    /// The same for the lock-step.
    #[must_use]
    pub fn to_lockstep(&self) -> lockstep::Lateness {
        let deadline = std::time::Duration::try_from_secs_f64(self.deadline_s);

        lockstep::Lateness {
            on_late: self.on_late,
            own: self.own.clone(),
            deadline: deadline.unwrap_or(std::time::Duration::MAX),
            lose_after: self.lose_after,
        }
    }
}

impl Scenario {
    /// How long it simulates, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.ticks as f64 * self.tick_s
    }

    /// The robots' names, in order.
    #[must_use]
    pub fn roster(&self) -> Vec<RobotName> {
        self.robots.keys().cloned().collect()
    }

    /// The environment that it starts from; robots in the order of their names.
    #[must_use]
    pub fn hall(&self) -> Hall {
        Hall {
            field: Field {
                size_m: (self.field_m[0], self.field_m[1]),
                body_m: self.body_m,
            },
            obstacles: self.obstacles.iter().copied().map(to_world).collect(),
            guests: self.guests,
            robots: self
                .robots
                .values()
                .map(|robot| to_world(robot.at))
                .collect(),
            tick_s: self.tick_s,
            max_speed_mps: self.max_speed_mps,
        }
    }
}

/// The same place for the environment.
fn to_world(point: Point) -> world::Point {
    world::Point::new(point.x, point.y)
}

/// The same place for the wire.
pub(crate) fn to_wire(point: world::Point) -> Point {
    Point::new(point.x, point.y)
}
