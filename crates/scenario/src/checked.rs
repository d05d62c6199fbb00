//! A checked scenario: SI units, defaults filled in, all names and numbers valid.

use std::collections::BTreeMap;

use observe::{Expectation, RunSetting, ScenarioMeasure, TickCondition};
use protocol::messages::{DisplayUnit, Parameters, Point};
use protocol::{RobotName, Tick};
use serde::{Deserialize, Serialize};
use world::{
    CrowdGuests, Field, GuestWalk, Guests, Hall, Region, Shape, Shapes, Wall, Want, WantTarget,
    Wheels,
};

use super::change::{Change, Parent};
use super::fault::Fault;
use super::guests::{GuestMotion, GuestRules, GuestWant, WantGoal};
use super::lateness::Lateness;
use super::layers::LayerSpec;
use super::network::{Network, Radio};
use super::reseed::Reseed;
use super::sensing::Sensing;
use super::sites::{SiteSpec, start_states};

/// Seed if neither the file nor the command line gives one. It is fixed, so runs are reproducible by default.
pub const DEFAULT_SEED: u64 = 1;
/// Most guests of a scenario \[I\]: placing them takes seconds, and so does a tick.
pub const MAX_GUESTS: usize = 1_000_000;

/// Checks the number of guests.
///
/// # Errors
/// What is wrong with it.
pub(super) fn check_guests(count: usize) -> Result<(), String> {
    if count <= MAX_GUESTS {
        return Ok(());
    }
    Err(format!(
        "{count} guests, more than the {MAX_GUESTS} allowed"
    ))
}

/// A scenario, checked and complete.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Source of all random numbers of the run.
    pub seed: u64,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Number of ticks after tick 0.
    pub ticks: Tick,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body without a shape of its own, meters.
    pub body_m: f64,
    /// In what people are shown lengths and speeds.
    pub display_unit: DisplayUnit,
    /// Highest speed, m/s. A faster move is refused.
    pub max_speed_mps: f64,
    /// How robots sense.
    pub sensing: Sensing,
    /// The moving obstacles. The number of recorded ones is that of the record.
    pub guests: Guests,
    /// What moves them.
    pub guest_motion: GuestMotion,
    /// What they do beside walking.
    pub guest_rules: GuestRules,
    /// The fixed obstacles.
    pub obstacles: Vec<Obstacle>,
    /// The walls.
    pub walls: Vec<Wall>,
    /// The sites by name.
    pub sites: BTreeMap<String, SiteSpec>,
    /// The layers by name.
    pub layers: BTreeMap<String, LayerSpec>,
    /// The robots by name.
    pub robots: BTreeMap<RobotName, RobotSpec>,
    /// Rules for late robots.
    pub lateness: Lateness,
    /// The network between the robots.
    pub network: Network,
    /// Faults of the robots' processes in the order of their begins.
    pub faults: Vec<Fault>,
    /// Changes during the run, in the order of their ticks.
    pub changes: Vec<Change>,
    /// Where chance becomes another one, in the order of ticks.
    pub reseeds: Vec<Reseed>,
    /// What the run is expected to do.
    pub expectations: Vec<Expectation>,
    /// What is measured of the run while it goes on.
    pub measures: Vec<ScenarioMeasure>,
    /// The run ends after the first tick in which this holds; without it, after its last tick only.
    pub end_when: Option<TickCondition>,
    /// Contents of the record.
    pub record: RecordContents,
    /// The run from which this one was forked.
    pub parent: Option<Parent>,
}

/// Contents of the record beside events and summary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordContents {
    /// Whether the log is written.
    pub log: bool,
    /// Name of the log in the run's folder.
    pub log_name: String,
    /// Whether every tick is recorded in `run.mcap`, to be shown again and compared.
    pub frames: bool,
    /// Whether the recording has the robots' panels. Without effect where ticks are not recorded.
    pub panels: bool,
    /// When the record is on the disk for certain.
    pub sync: SyncPoint,
}

/// When the files of a record are synchronized with the disk: what was written before survives a crash of the machine. A crash
/// of the simulator alone loses nothing but the tick in progress, and of `run.mcap` about the last second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SyncPoint {
    /// At the end of every tick.
    Tick,
    /// At the end of a tick, when a second has passed since the last time.
    Second,
    /// At the end of the run.
    #[default]
    End,
}

impl RecordContents {
    /// Whether the robots' panels are recorded.
    #[must_use]
    pub fn has_panels(&self) -> bool {
        self.frames && self.panels
    }
}

impl Default for RecordContents {
    fn default() -> Self {
        Self {
            log: true,
            log_name: crate::files::LOG.to_owned(),
            frames: true,
            panels: true,
            sync: SyncPoint::default(),
        }
    }
}

/// A fixed obstacle.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Its center, meters.
    pub at: Point,
    /// Its shape; a square of the scenario's size if there is none.
    pub shape: Option<Shape>,
    /// Where its place was drawn, if it follows from the seed.
    pub drawn: Option<Region>,
}

impl Obstacle {
    /// A square of the scenario's size.
    #[must_use]
    pub fn square(at: Point) -> Self {
        Self {
            at,
            shape: None,
            drawn: None,
        }
    }
}

/// A robot of the scenario.
#[derive(Debug, Clone)]
pub struct RobotSpec {
    /// Class of the robot, by which `cars run` and rosters find its program.
    pub class: String,
    /// Initial location, meters.
    pub at: Point,
    /// Where the location was drawn, if it follows from the seed.
    pub drawn: Option<Region>,
    /// Shape of its body; a square of the scenario's size if there is none.
    pub shape: Option<Shape>,
    /// How it drives, if it drives like wheels.
    pub wheels: Option<Wheels>,
    /// Parameters of the robot; lengths, speeds and times are SI numbers.
    pub parameters: Parameters,
}

/// The radius of the largest disc within each robot that has a shape of its own.
pub(super) fn inradii_m(robots: &BTreeMap<RobotName, RobotSpec>) -> BTreeMap<RobotName, f64> {
    let mut radii_m = BTreeMap::new();
    for (name, robot) in robots {
        if let Some(shape) = robot.shape {
            radii_m.insert(name.clone(), shape.inradius_m());
        }
    }
    radii_m
}

impl Scenario {
    /// Simulated duration, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.ticks as f64 * self.tick_s
    }

    /// What conditions and measures depend on beside the ticks of the run.
    #[must_use]
    pub fn setting(&self) -> RunSetting {
        RunSetting {
            tick_s: self.tick_s,
            ticks: self.ticks,
            field_m: self.field_m,
            body_m: self.body_m,
            inradius_m: inradii_m(&self.robots),
            radio_range_m: self.network.radio.as_ref().and_then(Radio::reach_m),
            roster: self.roster(),
            sites: start_states(&self.sites),
            layers: self.layers.keys().cloned().collect(),
        }
    }

    /// The robots' names, in order.
    #[must_use]
    pub fn roster(&self) -> Vec<RobotName> {
        self.robots.keys().cloned().collect()
    }

    /// What moves the guests.
    #[must_use]
    pub fn guest_walk(&self) -> GuestWalk {
        match &self.guest_motion {
            GuestMotion::Random => GuestWalk::Random,
            GuestMotion::Recorded(recorded) => GuestWalk::Recorded(recorded.walk()),
            GuestMotion::Crowd(guests) => GuestWalk::Crowd(CrowdGuests {
                model: guests.model,
                wants: guests.wants.iter().map(|want| self.want(want)).collect(),
            }),
        }
    }

    /// What guests want, where it is in the environment.
    fn want(&self, want: &GuestWant) -> Want {
        let goal = match &want.goal {
            WantGoal::Site(name) => {
                let site = self.sites.get(name);
                WantTarget::Place(
                    self.inside(site.map_or_else(Default::default, |site| to_world(site.at))),
                )
            }
            WantGoal::Place(at) => WantTarget::Place(self.inside(*at)),
            WantGoal::Exit(at) => WantTarget::Exit(self.inside(*at)),
            WantGoal::Treat(name) => {
                let mut robots = self.robots.keys();
                WantTarget::Robot(robots.position(|robot| robot == name).unwrap_or_default())
            }
        };
        Want {
            goal,
            weight: want.weight,
            within_m: want.within_m,
            stay_s: want.stay_s,
            give_up: want.give_up,
        }
    }

    /// The closest place where a body is inside the field.
    fn inside(&self, at: world::Point) -> world::Point {
        let half_m = self.body_m / 2.0;
        let [width_m, height_m] = self.field_m;
        let within = |x: f64, side_m: f64| x.min(side_m - half_m).max(half_m);
        world::Point::new(within(at.x, width_m), within(at.y, height_m))
    }

    /// The initial environment; robots are in the order of their names. Recorded guests are no part of it.
    #[must_use]
    pub fn hall(&self) -> Hall {
        self.hall_of(
            &self.obstacles.iter().collect::<Vec<_>>(),
            self.robots.values(),
        )
    }

    /// The environment with these obstacles and robots only.
    pub(super) fn hall_of<'a>(
        &self,
        obstacles: &[&Obstacle],
        robots: impl Iterator<Item = &'a RobotSpec>,
    ) -> Hall {
        let mut guests = self.guests;
        if self.guest_motion.recorded().is_some() {
            guests.count = 0;
        }
        let mut hall = Hall {
            field: Field {
                size_m: (self.field_m[0], self.field_m[1]),
                body_m: self.body_m,
            },
            obstacles: Vec::new(),
            guests,
            robots: Vec::new(),
            shapes: Shapes {
                walls: self.walls.clone(),
                ..Shapes::default()
            },
            tick_s: self.tick_s,
            max_speed_mps: self.max_speed_mps,
        };

        for (index, obstacle) in obstacles.iter().enumerate() {
            hall.obstacles.push(to_world(obstacle.at));
            if let Some(shape) = obstacle.shape {
                hall.shapes.obstacles.insert(index, shape);
            }
        }
        for (index, robot) in robots.enumerate() {
            hall.robots.push(to_world(robot.at));
            if let Some(shape) = robot.shape {
                hall.shapes.robots.insert(index, shape);
            }
            if let Some(wheels) = robot.wheels {
                hall.shapes.wheels.insert(index, wheels);
            }
        }
        hall
    }
}

/// A point for the environment.
pub fn to_world(point: Point) -> world::Point {
    world::Point::new(point.x, point.y)
}

/// A point for messages.
pub fn to_wire(point: world::Point) -> Point {
    Point::new(point.x, point.y)
}
