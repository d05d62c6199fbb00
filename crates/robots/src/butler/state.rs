//! What Butler remembers from tick to tick besides emotion and behavior, and what he publishes of it.

use std::collections::VecDeque;

use affect::akr::Appraisal;
use affect::progress::{ApproachEstimator, RateEstimator};
use affect::{Feeling, ParameterError, StandardEmotion};
use robot::{Cars, Point, StateVariables, Stream};
use serde::{Deserialize, Serialize};

use super::checks::ButlerChecks;
use super::deliberation::Mind;
use super::parameters::ButlerParameters;
use super::tables::{ButlerBehavior, ButlerMeasures};
use crate::belief::BeliefParameters;
use crate::chance::Chance;
use crate::checks;
use crate::closing::Closing;
use crate::drive::Drive;
use crate::input::{Input, Inputs};
use crate::jokes::Jokes;
use crate::panel::SPARKLINE_LEN;
use crate::peer::Peer;
use crate::published::{count, flag, location, number, saturated};
use crate::recruitment::Recruitment;
use crate::recruitment::recruiter::Recruiter;

/// The name of a refiller before one has been recruited: no robot has it.
const NOBODY: &str = "";

/// Butler's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ButlerMemory {
    /// His name.
    pub(super) name: String,
    /// Where he stands.
    pub(super) at: Point,
    pub(super) start: Point,
    /// The location of the refiller's table, from an earlier incarnation.
    pub(super) table: Option<Point>,
    pub(super) drive: Drive,
    pub(super) treats: u32,
    pub(super) need: bool,
    pub(super) called: bool,
    pub(super) hurried: bool,
    pub(super) served: u32,
    /// How often a guest reached for an empty tray.
    pub(super) missed: u32,
    pub(super) exchanges: u32,
    pub(super) messages: u32,
    /// Total time for which the tray was empty.
    pub(super) empty_s: f64,
    /// How often he gave up an INTERCEPT.
    pub(super) gave_up: u32,
    pub(super) since_call_s: f64,
    pub(super) since_go_home_s: f64,
    /// Time since the need arose.
    pub(super) needed_s: f64,
    /// Time for which he does not intercept.
    pub(super) rest_s: f64,
    /// How far the refiller has come by herself since the need arose, m.
    pub(super) come_m: f64,
    /// Whether she comes nearer by herself.
    pub(super) errand: Closing,
    /// The distance of the refiller since he began to intercept.
    pub(super) chase: Closing,
    /// Whether one of the two made progress in this tick.
    pub(super) comes_nearer: bool,
    pub(super) inputs: Inputs,
    /// The distance of his start on the way back.
    pub(super) way_back: Closing,
    pub(super) until_tap_s: f64,
    pub(super) rate: RateEstimator,
    pub(super) approach: ApproachEstimator,
    pub(super) refiller: Peer,
    /// His call for any refiller, where he commands none by name.
    pub(super) recruiter: Recruiter,
    /// Whether the refiller has left her table on her present errand.
    pub(super) refiller_left: bool,
    /// Whether the refiller has been seen on her way since he called.
    pub(super) refiller_came: bool,
    /// Whether the refiller has an errand that she has not begun yet, by her last answer.
    pub(super) refiller_is_called: bool,
    pub(super) measures: ButlerMeasures,
    pub(super) taps: Chance,
    pub(super) turns: Chance,
    pub(super) jokes: Jokes,
    pub(super) appraisal: Appraisal,
    pub(super) checks: ButlerChecks,
    pub(super) mind: Mind,
    /// The curve of the panel.
    pub(super) valences: VecDeque<f64>,
}

impl ButlerMemory {
    pub(super) fn new(parameters: &ButlerParameters) -> Result<Self, ParameterError> {
        Ok(Self {
            name: String::new(),
            at: Point::default(),
            start: Point::default(),
            table: None,
            drive: Drive::default(),
            treats: parameters.treat_capacity,
            need: false,
            called: false,
            hurried: false,
            served: 0,
            missed: 0,
            exchanges: 0,
            messages: 0,
            empty_s: 0.0,
            gave_up: 0,
            since_call_s: 0.0,
            since_go_home_s: 0.0,
            needed_s: 0.0,
            rest_s: 0.0,
            come_m: 0.0,
            errand: Closing::default(),
            chase: Closing::default(),
            comes_nearer: false,
            inputs: Inputs::default(),
            way_back: Closing::default(),
            until_tap_s: parameters.treat_mean_s,
            rate: RateEstimator::new(parameters.rate())?,
            approach: ApproachEstimator::new(parameters.approach())?,
            refiller: Peer::new(match parameters.recruitment.by {
                Recruitment::Off => &parameters.refiller,
                _ => NOBODY,
            }),
            recruiter: Recruiter::new(Chance::new(3)),
            refiller_left: false,
            refiller_came: false,
            refiller_is_called: false,
            measures: ButlerMeasures::default(),
            taps: Chance::new(0),
            turns: Chance::new(1),
            jokes: Jokes::new(Chance::new(2), parameters.joke_mean_s),
            appraisal: checks::initial(),
            checks: ButlerChecks::default(),
            mind: Mind::default(),
            valences: VecDeque::new(),
        })
    }

    /// Sets what depends on the run: his name, his start, and his random streams.
    pub(super) fn begin(&mut self, parameters: &ButlerParameters, cars: &mut Cars<'_>) {
        self.name = cars.name().to_string();
        self.at = cars.location();
        self.start = cars.welcome().location;

        self.taps = Chance::split(cars.random());
        self.turns = Chance::split(cars.random());
        self.jokes = Jokes::new(Chance::split(cars.random()), parameters.joke_mean_s);
        self.until_tap_s = self.taps.exponential(parameters.treat_mean_s);
        if parameters.recruitment.by.is_on() {
            self.recruiter = Recruiter::new(Chance::split(cars.random()));
        }
    }

    /// Draws from other random streams from now on. The times that are drawn already stay.
    pub(super) fn reseed(&mut self, random: &mut Stream) {
        self.taps = Chance::split(random);
        self.turns = Chance::split(random);
        self.jokes.reseed(Chance::split(random));
        self.recruiter.reseed(Chance::split(random));
    }

    /// From now on this is the refiller who is to come.
    pub(super) fn engage(&mut self, refiller: &str) {
        self.refiller = Peer::new(refiller);
        self.table = None;
        self.refiller_left = false;
        self.refiller_came = false;
        self.refiller_is_called = false;
        self.errand = Closing::default();
        self.chase = Closing::default();
        self.come_m = 0.0;
        self.approach.expect_again();
    }

    /// Advances the timers by one tick.
    pub(super) fn advance(&mut self, tick_s: f64) {
        self.since_call_s += tick_s;
        self.since_go_home_s += tick_s;
        self.rest_s = (self.rest_s - tick_s).max(0.0);
        if self.need {
            self.needed_s += tick_s;
        }
        self.jokes.advance(tick_s);
        if self.treats == 0 {
            self.empty_s += tick_s;
        }
    }

    /// From now on he needs the refiller.
    pub(super) fn raise_need(&mut self) {
        self.need = true;
        self.needed_s = 0.0;
    }

    /// His calls have come to nothing: he may call again.
    pub(super) fn forget_calls(&mut self) {
        self.called = false;
        self.hurried = false;
        self.refiller_came = false;
    }

    /// Completes an exchange.
    pub(super) fn replenish(&mut self, capacity: u32) {
        self.treats = capacity;
        self.exchanges += 1;
        self.need = false;
        if self.mind.beliefs.succeed() {
            self.inputs.note(Input::Encouraged);
        }
        self.rest_s = 0.0;
        self.forget_calls();
        self.approach.expect_again();
    }

    /// Appends the signed valence to the curve of the panel.
    pub(super) fn record(&mut self, feeling: Feeling<StandardEmotion>) {
        if self.valences.len() == SPARKLINE_LEN {
            self.valences.pop_front();
        }
        // The curve is some tens of pixels high, and panels are recorded.
        let valence = feeling.affect().signed();
        self.valences.push_back((valence * 100.0).round() / 100.0);
    }

    /// The state variables: what other robots may query, and what a later incarnation needs.
    pub(super) fn published(&self, behavior: ButlerBehavior) -> StateVariables {
        let mut variables: StateVariables = [
            ("treats", self.treats.into()),
            ("rate_per_s", self.measures.rate_per_s.into()),
            ("time_to_empty_s", self.measures.time_to_empty_s.into()),
            ("time_to_refill_s", self.measures.time_to_refill_s.into()),
            ("need_ratio", self.measures.need_ratio.into()),
            ("refiller", self.refiller.name().into()),
            ("need", self.need.into()),
            ("called", self.called.into()),
            ("hurried", self.hurried.into()),
            ("served", self.served.into()),
            ("missed", self.missed.into()),
            ("exchanges", self.exchanges.into()),
            ("messages", self.messages.into()),
            ("gave_up", self.gave_up.into()),
            ("empty_s", self.empty_s.into()),
            ("behavior", behavior.name().into()),
            ("start_x_m", self.start.x.into()),
            ("start_y_m", self.start.y.into()),
        ]
        .into();

        if let Some(table) = self.table.or(self.refiller.first_location()) {
            variables.insert("table_x_m", table.x.into());
            variables.insert("table_y_m", table.y.into());
        }
        self.inputs.publish(&mut variables);
        self.mind.beliefs.publish(&mut variables);
        if let Some(plan) = self.mind.plan() {
            variables.insert("plan", plan.name().into());
        }

        variables
    }

    /// Continues from what a lost incarnation published. Estimates recover by themselves within seconds.
    pub(super) fn take_over(
        &mut self,
        last: &StateVariables,
        capacity: u32,
        beliefs: BeliefParameters,
    ) {
        self.treats = number(last, "treats")
            .map_or(capacity, saturated)
            .min(capacity);
        self.need = flag(last, "need");
        self.called = flag(last, "called");
        self.hurried = flag(last, "hurried");

        self.served = count(last, "served");
        self.missed = count(last, "missed");
        self.exchanges = count(last, "exchanges");
        self.messages = count(last, "messages");
        self.gave_up = count(last, "gave_up");
        self.empty_s = number(last, "empty_s").unwrap_or(0.0);

        self.start = location(last, "start_x_m", "start_y_m").unwrap_or(self.start);
        self.table = location(last, "table_x_m", "table_y_m");
        self.mind.beliefs.take_over(last, beliefs);
    }
}
