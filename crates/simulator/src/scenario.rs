//! What is simulated. A file is read as it is written (module `raw`), then checked and turned into what it means
//! ([`Scenario`]): SI units, defaults filled in, every name and number legal.

pub mod fault;
pub mod network;
mod overrides;
mod raw;
mod setup;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use protocol::messages::{Parameters, Point};

pub use protocol::messages::OnLate;
use protocol::random::MAX_SEED;
use protocol::{RobotName, Tick};
use world::{Field, Guests, Hall, Triangular};

pub use fault::{Fault, FaultEnd};
pub use network::Network;
pub use overrides::Override;

use crate::diagnostic::{FileError, Source};

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
            log_name: crate::recorder::LOG.to_owned(),
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
        let deadline = Duration::try_from_secs_f64(self.deadline_s);

        lockstep::Lateness {
            on_late: self.on_late,
            own: self.own.clone(),
            deadline: deadline.unwrap_or(Duration::MAX),
            lose_after: self.lose_after,
        }
    }
}

/// What the command line changes of a scenario file.
#[derive(Debug, Clone, Default)]
pub struct Changes {
    /// Another seed.
    pub seed: Option<u64>,
    /// Another duration, simulated seconds.
    pub duration_s: Option<f64>,
    /// `path=value` pairs.
    pub set: Vec<Override>,
}

impl Scenario {
    /// Reads, changes and checks a scenario file.
    ///
    /// # Errors
    /// [`FileError`] with file, line and caret, or naming the change that cannot be made.
    pub fn load(path: &Path, changes: &Changes) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        // First as it is, so that its own errors are shown at their own lines.
        let raw: raw::Scenario = source.parse()?;
        if changes.seed.is_none() && changes.duration_s.is_none() && changes.set.is_empty() {
            return raw.check(&source, folder);
        }
        let source = overrides::apply(&source, changes)?;
        source.parse::<raw::Scenario>()?.check(&source, folder)
    }

    /// Reads and checks a scenario text; `folder` is where files that it names are looked for.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: &Source, folder: &Path) -> Result<Self, FileError> {
        source.parse::<raw::Scenario>()?.check(source, folder)
    }

    /// Reads and checks a scenario text that comes from outside: it may name no other file.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse_alone(source: &Source) -> Result<Self, FileError> {
        source
            .parse::<raw::Scenario>()?
            .refuse_files(source)?
            .check(source, Path::new("."))
    }

    /// The scenario as a file that says everything and gives the same run.
    ///
    /// # Errors
    /// [`FileError`] if a parameter cannot be written as TOML (a JSON `null`).
    pub fn to_toml(&self) -> Result<String, FileError> {
        toml::to_string(&raw::Scenario::from(self))
            .map_err(|error| FileError::new(error.to_string()))
    }

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
pub(crate) fn to_world(point: Point) -> world::Point {
    world::Point::new(point.x, point.y)
}

/// The same place for the wire.
pub(crate) fn to_wire(point: world::Point) -> Point {
    Point::new(point.x, point.y)
}

fn check_seed(seed: u64) -> Result<u64, String> {
    if seed <= MAX_SEED {
        return Ok(seed);
    }
    Err(format!(
        "a seed is at most {MAX_SEED} (2^53 - 1), so that every language can hold it"
    ))
}

fn triangular(raw: &raw::Triangle) -> Result<Triangular, String> {
    Triangular::new(raw.min, raw.mode, raw.max).map_err(|error| error.to_string())
}

/// Reads a speed of the clock: simulated seconds per second, or `max` (`None`) for as fast as the barrier goes.
///
/// # Errors
/// What a speed is.
pub fn parse_speed(text: &str) -> Result<Option<f64>, String> {
    if text == "max" {
        return Ok(None);
    }
    let factor = text.trim_end_matches('x').parse::<f64>().ok();
    let factor = factor.filter(|factor| *factor > 0.0 && factor.is_finite());
    factor
        .map(Some)
        .ok_or_else(|| format!("{text:?} is neither a number above zero nor `max`"))
}
