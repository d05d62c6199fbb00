//! What a person can change between two epochs, checked field by field so that each mistake is shown where it was made.

use protocol::messages::{FieldError, LogFile, Range, Setup};
use world::{Guests, Triangular};

use super::checked::Scenario;
use super::placing;
use crate::files;

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

        if let Err(error) = config::seed::check(setup.seed) {
            errors.add("seed", error.to_string());
        }

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

        match files::check_log_name(&setup.log_file.name) {
            Ok(()) => scenario.record.log_name.clone_from(&setup.log_file.name),
            Err(error) => errors.add("log_file.name", error.to_string()),
        }

        if errors.0.is_empty()
            && let Err(error) = placing::check(&scenario)
        {
            errors.add(&error.field(), error.to_string());
        }

        if errors.0.is_empty() {
            Ok(scenario)
        } else {
            Err(errors.0)
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
