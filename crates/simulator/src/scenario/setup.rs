//! What a person can change between two epochs, checked field by field so that each mistake is shown where it was made.

use protocol::messages::{FieldError, LogFile, Range, Setup};
use protocol::random::MAX_SEED;
use world::{Guests, HallError, Triangular, World};

use super::Scenario;
use crate::recorder;

/// Longest epoch that a set-up may ask for, ticks.
const MAX_TICKS: f64 = 1e9;

impl Scenario {
    /// What a person can change of it.
    #[must_use]
    pub fn setup(&self) -> Setup {
        let range = |shape: &Triangular| Range {
            min: shape.min(),
            mode: shape.mode(),
            max: shape.max(),
        };
        Setup {
            seed: self.seed,
            duration_s: self.duration_s(),
            field_m: self.field_m,
            guests: u32::try_from(self.guests.count).unwrap_or(u32::MAX),
            guest_speed_mps: range(&self.guests.speed_mps),
            guest_duration_s: range(&self.guests.duration_s),
            obstacles: self.obstacles.clone(),
            robots: self
                .robots
                .iter()
                .map(|(name, robot)| (name.clone(), robot.at))
                .collect(),
            log_file: LogFile {
                enabled: self.record.log,
                name: self.record.log_name.clone(),
            },
        }
    }

    /// The same scenario with another set-up.
    ///
    /// # Errors
    /// All that is wrong, field by field.
    pub fn with_setup(&self, setup: &Setup) -> Result<Self, Vec<FieldError>> {
        let mut errors = Errors::default();
        let mut scenario = self.clone();
        scenario.seed = setup.seed;
        errors.unless(setup.seed <= MAX_SEED, "seed", || {
            format!("a seed is a whole number up to {MAX_SEED}")
        });
        let ticks = (setup.duration_s / self.tick_s).round();
        errors.unless((1.0..=MAX_TICKS).contains(&ticks), "duration_s", || {
            format!(
                "the duration must be at least one tick of {} s and at most a billion",
                self.tick_s
            )
        });
        scenario.ticks = ticks as u64;
        scenario.field_m = setup.field_m;
        let mut triangular = |range: &Range, field: &str| {
            let made = Triangular::new(range.min, range.mode, range.max);
            made.map_err(|error| errors.add(field, error.to_string()))
                .ok()
        };
        let speed_mps = triangular(&setup.guest_speed_mps, "guest_speed_mps");
        let duration_s = triangular(&setup.guest_duration_s, "guest_duration_s");
        scenario.guests = Guests {
            count: setup.guests as usize,
            speed_mps: speed_mps.unwrap_or(self.guests.speed_mps),
            duration_s: duration_s.unwrap_or(self.guests.duration_s),
        };
        scenario.obstacles.clone_from(&setup.obstacles);
        for (name, robot) in &mut scenario.robots {
            match setup.robots.get(name) {
                Some(at) => robot.at = *at,
                None => errors.add(
                    &format!("robots.{name}"),
                    "it must stand somewhere".to_owned(),
                ),
            }
        }
        for name in setup
            .robots
            .keys()
            .filter(|name| !self.robots.contains_key(*name))
        {
            errors.add(
                &format!("robots.{name}"),
                "no robot of this run has this name".to_owned(),
            );
        }
        scenario.record.log = setup.log_file.enabled;
        match recorder::check_log_name(&setup.log_file.name) {
            Ok(()) => scenario.record.log_name.clone_from(&setup.log_file.name),
            Err(reason) => errors.add("log_file.name", reason),
        }
        if errors.0.is_empty()
            && let Err(error) = World::new(
                &scenario.hall(),
                protocol::random::stream(scenario.seed, "guests"),
            )
        {
            errors.add(&scenario.blame(&error), scenario.name_robots(&error));
        }
        if errors.0.is_empty() {
            Ok(scenario)
        } else {
            Err(errors.0)
        }
    }

    /// The field of a set-up that a hall which cannot be placed is the fault of.
    fn blame(&self, error: &HallError) -> String {
        let robot = |index: usize| {
            self.robots
                .keys()
                .nth(index)
                .map_or("robots".to_owned(), |name| format!("robots.{name}"))
        };
        match *error {
            HallError::RobotOffField { index, .. }
            | HallError::RobotOnObstacle { index, .. }
            | HallError::RobotOnRobot { index, .. } => robot(index),
            HallError::ObstacleOffField { .. } => "obstacles".to_owned(),
            HallError::NoRoom { .. } | HallError::TooManyBodies { .. } => "guests".to_owned(),
            HallError::OutOfRange { name, .. } if name.contains("guest") => {
                "guest_speed_mps".to_owned()
            }
            _ => "field_m".to_owned(),
        }
    }

    /// The same scenario as another text describes it, for the same robots.
    ///
    /// # Errors
    /// What differs that a run cannot change: its roster, or a robot's class.
    pub fn with_roster_of(self, running: &Self) -> Result<Self, String> {
        let names = |scenario: &Self| {
            let robots = scenario
                .robots
                .iter()
                .map(|(name, robot)| format!("{name} ({})", robot.class));
            robots.collect::<Vec<_>>().join(", ")
        };
        let (own, other) = (names(&self), names(running));
        if own == other {
            return Ok(self);
        }
        Err(format!(
            "the robots of this run are {other}; those of the scenario are {own}. Start another launch for it"
        ))
    }
}

/// What is wrong so far.
#[derive(Default)]
struct Errors(Vec<FieldError>);

impl Errors {
    fn add(&mut self, field: &str, reason: String) {
        self.0.push(FieldError {
            field: field.to_owned(),
            reason,
        });
    }

    fn unless(&mut self, is_right: bool, field: &str, reason: impl Fn() -> String) {
        if !is_right {
            self.add(field, reason());
        }
    }
}
