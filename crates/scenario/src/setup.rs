//! The set-up: what an operator can change between two epochs, checked field by field.

use config::{FileError, Source};
use protocol::messages::{FieldError, LogFile, Range, Setup};
use world::{Guests, Triangular};

use super::checked::{Obstacle, Scenario, check_guests};
use super::placing;
use crate::files;

/// Longest epoch of a set-up, ticks.
const MAX_TICKS: f64 = 1e9;

impl Scenario {
    /// The set-up of the scenario.
    #[must_use]
    pub fn setup(&self) -> Setup {
        let robots = self.robots.iter();
        let robots = robots.map(|(name, robot)| (name.clone(), robot.at));

        Setup {
            seed: self.seed,
            duration_s: self.duration_s(),
            field_m: self.field_m,
            guests: u32::try_from(self.guests.count).unwrap_or(u32::MAX),
            guest_speed_mps: range(&self.guests.speed_mps),
            guest_duration_s: range(&self.guests.duration_s),
            obstacles: self.obstacles.iter().map(|obstacle| obstacle.at).collect(),
            robots: robots.collect(),
            log_file: LogFile {
                enabled: self.record.log,
                name: self.record.log_name.clone(),
            },
        }
    }

    /// The same scenario with another set-up.
    ///
    /// # Errors
    /// All errors, field by field.
    pub fn with_setup(&self, setup: &Setup) -> Result<Self, Vec<FieldError>> {
        let mut errors = Errors::default();
        let mut scenario = self.clone();

        scenario.parent = None; // It is no fork of that run any more.
        scenario.seed = setup.seed;
        if let Err(error) = config::seed::check(setup.seed) {
            errors.add("seed", &error);
        }

        let ticks = (setup.duration_s / self.tick_s).round();
        scenario.ticks = ticks as u64;
        if !(1.0..=MAX_TICKS).contains(&ticks) {
            let tick_s = self.tick_s;
            let reason = format!(
                "the duration must be at least one tick of {tick_s} s and at most a billion"
            );
            errors.add("duration_s", &reason);
        }

        scenario.field_m = setup.field_m;
        scenario.guests = self.guests_of(setup, &mut errors);
        scenario.obstacles = self.obstacles_of(setup);
        scenario.place_robots(setup, &mut errors);

        scenario.record.log = setup.log_file.enabled;
        match files::check_log_name(&setup.log_file.name) {
            Ok(()) => scenario.record.log_name.clone_from(&setup.log_file.name),
            Err(error) => errors.add("log_file.name", &error),
        }

        // Placing needs valid fields.
        if errors.0.is_empty()
            && let Err(error) = placing::check(&scenario)
        {
            errors.add(&error.field(), &error);
        }
        if errors.0.is_empty()
            && let Err(error) = scenario.fit_unnamed()
        {
            let is_resized = setup.field_m != self.field_m;
            let field = if is_resized { "field_m" } else { "duration_s" };
            errors.add(field, &error.reason());
        }

        if errors.0.is_empty() {
            Ok(scenario)
        } else {
            Err(errors.0)
        }
    }

    /// Fits what a set-up does not name to what it changes: sites and peaks at random places are placed anew, and layers cover the field.
    ///
    /// # Errors
    /// What would not be right any more in the record of the scenario, such as a site that is not on the field.
    fn fit_unnamed(&mut self) -> Result<(), FileError> {
        placing::place_sites_at_random(self)
            .and_then(|()| placing::place_peaks_at_random(self))
            .map_err(|(_, reason)| FileError::new(reason))?;

        let record = Source {
            name: "the set-up".to_owned(),
            text: self.to_toml()?,
        };
        let recorded = Self::parse_alone(&record)?;
        for (name, layer) in &mut self.layers {
            if let Some(of_field) = recorded.layers.get(name) {
                layer.columns = of_field.columns;
                layer.rows = of_field.rows;
            }
        }
        Ok(())
    }

    /// The obstacles of a set-up, which has places only: one at the place of another keeps its shape.
    fn obstacles_of(&self, setup: &Setup) -> Vec<Obstacle> {
        let obstacles = setup.obstacles.iter().map(|at| {
            let mut same = self.obstacles.iter().filter(|old| old.at == *at);
            same.next().map_or_else(
                || Obstacle::square(*at),
                |old| Obstacle {
                    drawn: None,
                    ..old.clone()
                },
            )
        });
        obstacles.collect()
    }

    fn guests_of(&self, setup: &Setup, errors: &mut Errors) -> Guests {
        let speed_mps = errors.triangular("guest_speed_mps", &setup.guest_speed_mps);
        let duration_s = errors.triangular("guest_duration_s", &setup.guest_duration_s);
        let count = setup.guests as usize;
        if let Err(reason) = check_guests(count) {
            errors.add("guests", &reason);
        } else if self.guest_motion.recorded().is_some() && count != self.guests.count {
            let recorded = self.guests.count;
            let reason =
                format!("the guests of this run are recorded: there are {recorded} of them");
            errors.add("guests", &reason);
        }

        Guests {
            count,
            speed_mps: speed_mps.unwrap_or(self.guests.speed_mps),
            duration_s: duration_s.unwrap_or(self.guests.duration_s),
        }
    }

    fn place_robots(&mut self, setup: &Setup, errors: &mut Errors) {
        for (name, robot) in &mut self.robots {
            match setup.robots.get(name) {
                Some(at) => {
                    robot.at = *at;
                    robot.drawn = None;
                }
                None => errors.add(&format!("robots.{name}"), &"its location is missing"),
            }
        }

        for name in setup.robots.keys() {
            if !self.robots.contains_key(name) {
                let reason = "no robot of this run has this name";
                errors.add(&format!("robots.{name}"), &reason);
            }
        }
    }

    /// Checks that a loaded scenario has the robots of the running one.
    ///
    /// # Errors
    /// A sentence with both rosters, if a name or a class differs.
    pub fn with_roster_of(self, running: &Self) -> Result<Self, String> {
        let own = self.names_and_classes();
        let other = running.names_and_classes();
        if own == other {
            return Ok(self);
        }

        Err(format!(
            "the robots of this run are {other}; those of the scenario are {own}. Start another launch for it"
        ))
    }

    fn names_and_classes(&self) -> String {
        let mut robots = Vec::new();
        for (name, robot) in &self.robots {
            robots.push(format!("{name} ({})", robot.class));
        }
        robots.join(", ")
    }
}

fn range(shape: &Triangular) -> Range {
    Range {
        min: shape.min(),
        mode: shape.mode(),
        max: shape.max(),
    }
}

/// The errors found so far.
#[derive(Default)]
struct Errors(Vec<FieldError>);

impl Errors {
    fn add(&mut self, field: &str, reason: &dyn std::fmt::Display) {
        self.0.push(FieldError {
            field: field.to_owned(),
            reason: reason.to_string(),
        });
    }

    /// A distribution; if it is not valid, an error is added.
    fn triangular(&mut self, field: &str, range: &Range) -> Option<Triangular> {
        match Triangular::new(range.min, range.mode, range.max) {
            Ok(distribution) => Some(distribution),
            Err(error) => {
                self.add(field, &error);
                None
            }
        }
    }
}
