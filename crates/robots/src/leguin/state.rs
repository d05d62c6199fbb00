//! What Leguin remembers from tick to tick besides emotion and behavior, and what of it she publishes.

use affect::Intensity;
use robot::{Cars, Point, StateVariables};
use serde::{Deserialize, Serialize};

use super::{Behavior, Errand, Measures, Parameters};
use crate::chance::Chance;
use crate::drive::Legs;
use crate::peer::Peer;

/// Leguin's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) at: Point,
    /// Where she stood before the last move.
    pub(super) before: Point,
    /// Where she was driving then, and how far she meant to get.
    pub(super) aim: Option<(Point, f64)>,
    /// Her place at the table.
    pub(super) home: Point,
    pub(super) legs: Legs,
    pub(super) hurried: bool,
    pub(super) sent_home: bool,
    pub(super) pending: Option<Errand>,
    /// How far she has come on this way, toward where it led at each moment.
    pub(super) way_m: f64,
    /// How far at best.
    pub(super) best_way_m: f64,
    /// How long ago that was.
    pub(super) blocked_s: f64,
    /// How long she has waited to be sent home.
    pub(super) waiting_s: f64,
    pub(super) trips: u32,
    /// How often she turned back FRUSTRATED.
    pub(super) given_up: u32,
    pub(super) until_joke_s: f64,
    pub(super) waiter: Peer,
    /// Whether the waiter needed a refill when he last answered, and of whom.
    pub(super) waiter_needs: bool,
    pub(super) waiter_calls: Option<String>,
    pub(super) measures: Measures,
    pub(super) turns: Chance,
    pub(super) jokes: Chance,
}

impl State {
    pub(super) fn new(parameters: &Parameters) -> Self {
        Self {
            at: Point::default(),
            before: Point::default(),
            aim: None,
            home: Point::default(),
            legs: Legs::default(),
            hurried: false,
            sent_home: false,
            pending: None,
            way_m: 0.0,
            best_way_m: 0.0,
            blocked_s: 0.0,
            waiting_s: 0.0,
            trips: 0,
            given_up: 0,
            until_joke_s: parameters.joke_mean_s,
            waiter: Peer::new(&parameters.waiter),
            waiter_needs: false,
            waiter_calls: None,
            measures: Measures::default(),
            turns: Chance::new(0),
            jokes: Chance::new(1),
        }
    }

    /// The first tick: home is where she starts, and her chance.
    pub(super) fn begin(&mut self, parameters: &Parameters, cars: &mut Cars<'_>) {
        self.at = cars.welcome().location;
        (self.before, self.home) = (self.at, self.at);
        self.turns = Chance::split(cars.random());
        self.jokes = Chance::split(cars.random());
        self.until_joke_s = self.jokes.exponential(parameters.joke_mean_s);
    }

    /// A tick went by in this behavior: was there progress, how long has she waited?
    pub(super) fn pass(&mut self, behavior: Behavior, progress_share: f64, tick_s: f64) {
        self.until_joke_s -= tick_s;
        self.waiting_s = if behavior == Behavior::AwaitGoHome {
            self.waiting_s + tick_s
        } else {
            0.0
        };
        if !matches!(behavior, Behavior::Refill | Behavior::GoHome) {
            self.begin_way();
        } else if let Some((goal, step_m)) = self.aim {
            // Her own share of what brings them together: the waiter's motion is not hers. To and fro is no progress.
            self.way_m += self.before.distance_m(goal) - self.at.distance_m(goal);
            let is_progress = self.way_m >= self.best_way_m + progress_share * step_m;
            self.best_way_m = self.best_way_m.max(self.way_m);
            self.blocked_s = if is_progress {
                0.0
            } else {
                self.blocked_s + tick_s
            };
        }
    }

    /// What she did before counts no more.
    pub(super) fn begin_way(&mut self) {
        (self.blocked_s, self.way_m, self.best_way_m) = (0.0, 0.0, 0.0);
    }

    /// What others may learn, and what a later incarnation will need.
    pub(super) fn published(
        &self,
        intensity: Intensity,
        behavior: Behavior,
        goal: Option<Point>,
    ) -> StateVariables {
        let distance_m = goal.map_or(0.0, |goal| self.at.distance_m(goal));
        let pending = match self.pending {
            Some(Errand::Refill) => crate::REFILL,
            Some(Errand::Hurry) => crate::HURRY,
            None => "",
        };
        [
            ("hurried", self.hurried.into()),
            ("blocked_s", self.blocked_s.into()),
            ("waiting_s", self.waiting_s.into()),
            ("distance_m", distance_m.into()),
            ("intensity", intensity.value().into()),
            ("pending", pending.into()),
            ("trips", self.trips.into()),
            ("given_up", self.given_up.into()),
            ("waiter", self.waiter.name().into()),
            ("behavior", behavior.name().into()),
            ("home_x_m", self.home.x.into()),
            ("home_y_m", self.home.y.into()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// What a lost incarnation knew.
    pub(super) fn take_over(&mut self, last: &StateVariables) {
        let number = |name: &str| last.get(name).and_then(robot::Variable::as_f64);
        let count = |name: &str| number(name).map_or(0, |value| value as u32);
        self.hurried = last
            .get("hurried")
            .and_then(robot::Variable::as_bool)
            .unwrap_or(false);
        self.pending = match last.get("pending").and_then(|value| value.as_str()) {
            Some(crate::REFILL) => Some(Errand::Refill),
            Some(crate::HURRY) => Some(Errand::Hurry),
            _ => None,
        };
        (self.trips, self.given_up) = (count("trips"), count("given_up"));
        if let (Some(x), Some(y)) = (number("home_x_m"), number("home_y_m")) {
            self.home = Point::new(x, y);
        }
    }
}
