//! What Butler remembers from tick to tick besides emotion and behavior, and what of it he publishes.

use std::collections::VecDeque;

use affect::progress::{ApproachEstimator, RateEstimator};
use affect::{Feeling, Intensity, ParameterError, StandardEmotion};
use robot::{Cars, Point, StateVariables};
use serde::{Deserialize, Serialize};

use super::{Behavior, Measures, Parameters};
use crate::chance::Chance;
use crate::drive::Legs;
use crate::panel::SPARKLINE_LEN;
use crate::peer::Peer;

/// Butler's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) at: Point,
    pub(super) start: Point,
    /// The refiller's table as an earlier incarnation knew it.
    pub(super) table: Option<Point>,
    pub(super) legs: Legs,
    pub(super) treats: u32,
    pub(super) need: bool,
    pub(super) called: bool,
    pub(super) hurried: bool,
    pub(super) served: u32,
    /// Times that a guest reached for an empty tray.
    pub(super) missed: u32,
    pub(super) exchanges: u32,
    pub(super) messages: u32,
    /// How long the tray was empty in all.
    pub(super) empty_s: f64,
    pub(super) since_call_s: f64,
    pub(super) since_go_home_s: f64,
    pub(super) until_tap_s: f64,
    pub(super) until_joke_s: f64,
    pub(super) rate: RateEstimator,
    pub(super) approach: ApproachEstimator,
    pub(super) refiller: Peer,
    /// Whether the refiller has set out on her present errand.
    pub(super) refiller_left: bool,
    pub(super) measures: Measures,
    pub(super) taps: Chance,
    pub(super) turns: Chance,
    pub(super) jokes: Chance,
    pub(super) intensities: VecDeque<f64>,
}

impl State {
    pub(super) fn new(parameters: &Parameters) -> Result<Self, ParameterError> {
        Ok(Self {
            at: Point::default(),
            start: Point::default(),
            table: None,
            legs: Legs::default(),
            treats: parameters.treat_capacity,
            need: false,
            called: false,
            hurried: false,
            served: 0,
            missed: 0,
            exchanges: 0,
            messages: 0,
            empty_s: 0.0,
            since_call_s: 0.0,
            since_go_home_s: 0.0,
            until_tap_s: parameters.treat_mean_s,
            until_joke_s: parameters.joke_mean_s,
            rate: RateEstimator::new(parameters.rate())?,
            approach: ApproachEstimator::new(parameters.approach())?,
            refiller: Peer::new(&parameters.refiller),
            refiller_left: false,
            measures: Measures::default(),
            taps: Chance::new(0),
            turns: Chance::new(1),
            jokes: Chance::new(2),
            intensities: VecDeque::new(),
        })
    }

    /// The first tick: where he starts, and his chance.
    pub(super) fn begin(&mut self, parameters: &Parameters, cars: &mut Cars<'_>) {
        self.at = cars.welcome().location;
        self.start = self.at;
        self.taps = Chance::split(cars.random());
        self.turns = Chance::split(cars.random());
        self.jokes = Chance::split(cars.random());
        self.until_tap_s = self.taps.exponential(parameters.treat_mean_s);
        self.until_joke_s = self.jokes.exponential(parameters.joke_mean_s);
    }

    /// Time goes on.
    pub(super) fn pass(&mut self, tick_s: f64) {
        self.since_call_s += tick_s;
        self.since_go_home_s += tick_s;
        self.until_joke_s -= tick_s;
        if self.treats == 0 {
            self.empty_s += tick_s;
        }
    }

    /// An exchange is completed.
    pub(super) fn replenish(&mut self, capacity: u32) {
        self.treats = capacity;
        self.exchanges += 1;
        (self.need, self.called, self.hurried) = (false, false, false);
        self.approach.expect_again();
    }

    pub(super) fn remember(&mut self, feeling: Feeling<StandardEmotion>) {
        if self.intensities.len() == SPARKLINE_LEN {
            self.intensities.pop_front();
        }
        self.intensities.push_back(feeling.intensity.value());
    }

    /// What others may learn, and what a later incarnation will need.
    pub(super) fn published(&self, intensity: Intensity, behavior: Behavior) -> StateVariables {
        let mut variables: StateVariables = [
            ("treats", self.treats.into()),
            ("rate_per_s", self.measures.rate_per_s.into()),
            ("time_to_empty_s", self.measures.time_to_empty_s.into()),
            ("time_to_refill_s", self.measures.time_to_refill_s.into()),
            ("need_ratio", self.measures.need_ratio.into()),
            ("intensity", intensity.value().into()),
            ("refiller", self.refiller.name().into()),
            ("need", self.need.into()),
            ("called", self.called.into()),
            ("hurried", self.hurried.into()),
            ("served", self.served.into()),
            ("missed", self.missed.into()),
            ("exchanges", self.exchanges.into()),
            ("messages", self.messages.into()),
            ("empty_s", self.empty_s.into()),
            ("behavior", behavior.name().into()),
            ("start_x_m", self.start.x.into()),
            ("start_y_m", self.start.y.into()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into();
        if let Some(table) = self.table.or(self.refiller.first_place()) {
            variables.insert("table_x_m".to_owned(), table.x.into());
            variables.insert("table_y_m".to_owned(), table.y.into());
        }
        variables
    }

    /// What a lost incarnation knew. Its estimates and feelings come back by themselves within seconds.
    pub(super) fn take_over(&mut self, last: &StateVariables, capacity: u32) {
        let number = |name: &str| last.get(name).and_then(robot::Variable::as_f64);
        let flag = |name: &str| {
            last.get(name)
                .and_then(robot::Variable::as_bool)
                .unwrap_or(false)
        };
        // Saturates, so that a number from outside cannot be out of range.
        let count = |name: &str| number(name).map_or(0, |value| value as u32);
        let place = |x: &str, y: &str| Some(Point::new(number(x)?, number(y)?));
        self.treats = number("treats")
            .map_or(capacity, |value| value as u32)
            .min(capacity);
        (self.need, self.called, self.hurried) = (flag("need"), flag("called"), flag("hurried"));
        (self.served, self.missed) = (count("served"), count("missed"));
        (self.exchanges, self.messages) = (count("exchanges"), count("messages"));
        self.empty_s = number("empty_s").unwrap_or(0.0);
        self.start = place("start_x_m", "start_y_m").unwrap_or(self.start);
        self.table = place("table_x_m", "table_y_m");
    }
}
