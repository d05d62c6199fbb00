//! What a robot knows of another one: by asking (which a cut network prevents) and by sensing (which nothing prevents).

use std::sync::Arc;

use robot::{Cars, Point, PublicState};
use serde::{Deserialize, Serialize};

/// A peer, as far as it is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    name: String,
    /// The first place where it was ever known to be.
    first: Option<Point>,
    /// The last one.
    last: Option<Point>,
    /// Whether that one was sensed in this tick.
    is_sensed: bool,
    /// Whether the last place was searched in vain.
    is_missing: bool,
    /// Its behavior, when it last answered.
    behavior: Option<String>,
    /// How long ago it last answered, seconds.
    unheard_s: f64,
    /// How long ago its place was last known, seconds.
    unseen_s: f64,
}

/// What one tick told of a peer.
#[derive(Debug, Clone)]
pub struct News {
    /// Its answer; `None` if it is unreachable.
    pub state: Option<Arc<PublicState>>,
    /// Seconds since its place was known before, if it is known now.
    pub seen_after_s: Option<f64>,
}

impl Peer {
    /// A peer of whom nothing is known yet.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            first: None,
            last: None,
            is_sensed: false,
            is_missing: false,
            behavior: None,
            unheard_s: 0.0,
            unseen_s: 0.0,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Asks and looks around: once a tick, one round trip. Where it is sensed counts for more than where it says it was,
    /// because the answer is a tick old. Without an answer, a place within sensing range at which it is not sensed is
    /// one at which it is not.
    pub fn look(&mut self, cars: &mut Cars<'_>, own: Point) -> News {
        self.unheard_s += cars.tick_s();
        self.unseen_s += cars.tick_s();
        let state = cars.get_robot_state(&self.name).ok();
        if let Some(state) = &state {
            self.behavior = Some(state.behavior_state.clone());
            self.unheard_s = 0.0;
        }
        let sensed = cars
            .sensed_robots()
            .iter()
            .find(|robot| robot.name.as_str() == self.name);
        let sensed = sensed.map(|robot| robot.location);
        self.is_sensed = sensed.is_some();
        let place = sensed.or(state.as_ref().map(|state| state.location));
        let seen_after_s = place
            .is_some()
            .then(|| std::mem::replace(&mut self.unseen_s, 0.0));
        let range_m = cars.welcome().sensing_range_m;
        let was_searched = self
            .last
            .is_some_and(|last| own.distance_m(last) <= range_m);
        self.is_missing = place.is_none() && (self.is_missing || was_searched);
        self.last = place.or(self.last);
        self.first = self.first.or(self.last);
        News {
            state,
            seen_after_s,
        }
    }

    /// The last place where it was known to be.
    #[must_use]
    pub fn place(&self) -> Option<Point> {
        self.last
    }

    /// The first place where it was ever known to be.
    #[must_use]
    pub fn first_place(&self) -> Option<Point> {
        self.first
    }

    /// Whether it was looked for where it was last known to be, and not found.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        self.is_missing
    }

    /// Whether it stands within `radius_m`, as far as can be told. Sensing decides, being exact and of this tick; the
    /// answer to a question decides only where sensing does not reach so far.
    #[must_use]
    pub fn is_within(&self, radius_m: f64, own: Point, sensing_range_m: f64) -> bool {
        let is_certain = self.is_sensed || (sensing_range_m < radius_m && self.unseen_s == 0.0);
        is_certain
            && self
                .last
                .is_some_and(|place| own.distance_m(place) <= radius_m)
    }

    /// Its behavior, unless its last answer is older than `stale_s`.
    #[must_use]
    pub fn behavior(&self, stale_s: f64) -> Option<&str> {
        self.behavior
            .as_deref()
            .filter(|_| !self.is_unknown(stale_s))
    }

    /// Whether what goes on inside it cannot be known: it never answered, or not for longer than `stale_s`.
    #[must_use]
    pub fn is_unknown(&self, stale_s: f64) -> bool {
        self.behavior.is_none() || self.unheard_s > stale_s
    }
}
