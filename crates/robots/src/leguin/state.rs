//! What Leguin remembers from tick to tick besides emotion and behavior, and what she publishes of it.

use affect::akr::Appraisal;
use robot::{Cars, Point, StateVariables, Stream};
use serde::{Deserialize, Serialize};

use super::checks::LeguinChecks;
use super::parameters::LeguinParameters;
use super::tables::{Errand, LeguinBehavior, LeguinMeasures};
use crate::belief::{BeliefParameters, Beliefs};
use crate::chance::Chance;
use crate::checks;
use crate::closing::Closing;
use crate::commands::{HURRY, REFILL};
use crate::drive::Drive;
use crate::input::Inputs;
use crate::jokes::Jokes;
use crate::peer::Peer;
use crate::published::{count, flag, location, text};
use crate::recruitment::shame::Shame;

/// Leguin's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LeguinMemory {
    /// Her name.
    pub(super) name: String,
    /// Where she stands.
    pub(super) at: Point,
    /// Her place at the table.
    pub(super) home: Point,
    pub(super) drive: Drive,
    pub(super) hurried: bool,
    pub(super) sent_home: bool,
    pub(super) pending: Option<Errand>,
    /// The distance of her goal on this way.
    pub(super) way: Closing,
    /// Whether she made progress on it in this tick.
    pub(super) comes_nearer: bool,
    pub(super) inputs: Inputs,
    /// What she believes; she gives up errands.
    pub(super) beliefs: Beliefs,
    /// Time for which she has waited to be sent home.
    pub(super) waiting_s: f64,
    pub(super) trips: u32,
    /// How often she turned back FRUSTRATED.
    pub(super) given_up: u32,
    pub(super) waiter: Peer,
    /// Whether the waiter needed a refill in his last answer.
    pub(super) waiter_needs: bool,
    /// Whom he called for.
    pub(super) waiter_calls: Option<String>,
    /// Her shame at calls for help.
    pub(super) shame: Shame,
    pub(super) measures: LeguinMeasures,
    pub(super) appraisal: Appraisal,
    pub(super) checks: LeguinChecks,
    pub(super) turns: Chance,
    pub(super) jokes: Jokes,
}

impl LeguinMemory {
    pub(super) fn new(parameters: &LeguinParameters) -> Self {
        Self {
            name: String::new(),
            at: Point::default(),
            home: Point::default(),
            drive: Drive::default(),
            hurried: false,
            sent_home: false,
            pending: None,
            way: Closing::default(),
            comes_nearer: false,
            inputs: Inputs::default(),
            beliefs: Beliefs::default(),
            waiting_s: 0.0,
            trips: 0,
            given_up: 0,
            waiter: Peer::new(&parameters.waiter),
            waiter_needs: false,
            waiter_calls: None,
            shame: Shame::default(),
            measures: LeguinMeasures::default(),
            appraisal: checks::initial(),
            checks: LeguinChecks::default(),
            turns: Chance::new(0),
            jokes: Jokes::new(Chance::new(1), parameters.joke_mean_s),
        }
    }

    /// Sets what depends on the run: her name, her start, which is her home, and her random streams.
    pub(super) fn begin(&mut self, parameters: &LeguinParameters, cars: &mut Cars<'_>) {
        let start = cars.welcome().location;
        self.name = cars.name().to_string();
        self.at = start;
        self.home = start;

        self.turns = Chance::split(cars.random());
        self.jokes = Jokes::new(Chance::split(cars.random()), parameters.joke_mean_s);
    }

    /// Draws from other random streams from now on. The times that are drawn already stay.
    pub(super) fn reseed(&mut self, random: &mut Stream) {
        self.turns = Chance::split(random);
        self.jokes.reseed(Chance::split(random));
    }

    /// Advances the timers by one tick that she spent in this behavior.
    pub(super) fn advance(&mut self, behavior: LeguinBehavior, tick_s: f64) {
        self.jokes.advance(tick_s);
        self.waiting_s = if behavior == LeguinBehavior::AwaitGoHome {
            self.waiting_s + tick_s
        } else {
            0.0
        };
    }

    /// The state variables: what other robots may query, and what a later incarnation needs.
    pub(super) fn published(
        &self,
        behavior: LeguinBehavior,
        goal: Option<Point>,
    ) -> StateVariables {
        let distance_m = goal.map_or(0.0, |goal| self.at.distance_m(goal));
        let pending = match self.pending {
            Some(Errand::Refill) => REFILL,
            Some(Errand::Hurry) => HURRY,
            None => "",
        };

        let mut variables: StateVariables = [
            ("hurried", self.hurried.into()),
            ("blocked_s", self.way.stalled_s().into()),
            ("waiting_s", self.waiting_s.into()),
            ("distance_m", distance_m.into()),
            ("pending", pending.into()),
            ("trips", self.trips.into()),
            ("given_up", self.given_up.into()),
            ("waiter", self.waiter.name().into()),
            ("behavior", behavior.name().into()),
            ("home_x_m", self.home.x.into()),
            ("home_y_m", self.home.y.into()),
        ]
        .into();
        self.inputs.publish(&mut variables);
        self.beliefs.publish(&mut variables);

        variables
    }

    /// Continues from what a lost incarnation published.
    pub(super) fn take_over(&mut self, last: &StateVariables, beliefs: BeliefParameters) {
        self.hurried = flag(last, "hurried");
        self.pending = match text(last, "pending") {
            Some(REFILL) => Some(Errand::Refill),
            Some(HURRY) => Some(Errand::Hurry),
            _ => None,
        };
        self.trips = count(last, "trips");
        self.given_up = count(last, "given_up");
        self.beliefs.take_over(last, beliefs);
        self.home = location(last, "home_x_m", "home_y_m").unwrap_or(self.home);
    }
}
