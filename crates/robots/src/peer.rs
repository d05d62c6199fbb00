//! What a robot knows of another one: by querying it, which a cut network prevents, and by sensing it, which nothing
//! prevents.

use affect::StandardEmotion;
use std::sync::Arc;

use robot::{Cars, Point, PublicState};
use serde::{Deserialize, Serialize};

/// Another robot, as far as it is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    name: String,
    /// The first location at which it was known to be.
    first: Option<Point>,
    /// The last one.
    last: Option<Point>,
    /// Whether the last location was sensed in this tick.
    is_sensed: bool,
    /// Whether the last location was searched without finding it.
    is_missing: bool,
    /// Its behavior in its last answer.
    behavior: Option<String>,
    /// The emotion that it showed in its last answer, if it is a standard one.
    emotion: Option<StandardEmotion>,
    /// Time since its last answer, seconds.
    unanswered_s: f64,
    /// Time since its location was last known, seconds.
    unlocated_s: f64,
}

/// What one tick revealed of a peer.
#[derive(Debug, Clone)]
pub struct PeerObservation {
    /// Its answer; `None` if it is unreachable.
    pub state: Option<Arc<PublicState>>,
    /// Seconds since its location was known before, if it is known now.
    pub located_after_s: Option<f64>,
}

impl Peer {
    /// A peer of which nothing is known yet.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            first: None,
            last: None,
            is_sensed: false,
            is_missing: false,
            behavior: None,
            emotion: None,
            unanswered_s: 0.0,
            unlocated_s: 0.0,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Queries the peer and senses it: once a tick, one round trip. The sensed location takes precedence, because an
    /// answer is a tick old. Without an answer, a peer whose last location is within sensing range and which is not
    /// sensed is missing.
    pub fn observe(&mut self, cars: &mut Cars<'_>) -> PeerObservation {
        self.unanswered_s += cars.tick_s();
        self.unlocated_s += cars.tick_s();

        let state = cars.get_robot_state(&self.name).ok();
        if let Some(state) = &state {
            self.behavior = Some(state.behavior_state.clone());
            self.emotion = StandardEmotion::named(&state.emotion_state);
            self.unanswered_s = 0.0;
        }

        let sensed = cars
            .sensed_robots()
            .iter()
            .find(|robot| robot.name.as_str() == self.name)
            .map(|robot| robot.location);
        self.is_sensed = sensed.is_some();

        let location = sensed.or(state.as_ref().map(|state| state.location));
        let located_after_s = location.map(|_| std::mem::replace(&mut self.unlocated_s, 0.0));
        let range_m = cars.welcome().sensing_range_m;
        let is_in_view = self
            .last
            .is_some_and(|last| cars.location().distance_m(last) <= range_m);
        self.is_missing = location.is_none() && (self.is_missing || is_in_view);
        self.last = location.or(self.last);
        self.first = self.first.or(self.last);

        PeerObservation {
            state,
            located_after_s,
        }
    }

    /// The last location at which it was known to be.
    #[must_use]
    pub fn location(&self) -> Option<Point> {
        self.last
    }

    /// The first location at which it was known to be.
    #[must_use]
    pub fn first_location(&self) -> Option<Point> {
        self.first
    }

    /// Whether its last location was searched without finding it.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        self.is_missing
    }

    /// Whether it stands within `radius_m`, as far as is known. Sensing decides, being exact and of this tick; an
    /// answer decides only where sensing does not reach as far.
    #[must_use]
    pub fn is_within(&self, radius_m: f64, cars: &Cars<'_>) -> bool {
        let sensing_is_short = cars.welcome().sensing_range_m < radius_m;
        let is_certain = self.is_sensed || (sensing_is_short && self.unlocated_s == 0.0);
        is_certain
            && self
                .last
                .is_some_and(|last| cars.location().distance_m(last) <= radius_m)
    }

    /// Its behavior, unless its last answer is older than `stale_s`.
    #[must_use]
    pub fn behavior(&self, stale_s: f64) -> Option<&str> {
        self.behavior
            .as_deref()
            .filter(|_| !self.is_unknown(stale_s))
    }

    /// The emotion that it showed in its last answer, if that is not older than `stale_s` and a standard one.
    #[must_use]
    pub fn emotion(&self, stale_s: f64) -> Option<StandardEmotion> {
        self.emotion.filter(|_| !self.is_unknown(stale_s))
    }

    /// How recent its last answer is: from 1 (of this tick) to 0 (older than `stale_s`, or none).
    #[must_use]
    pub fn certainty(&self, stale_s: f64) -> f64 {
        match self.behavior {
            Some(_) => recency(self.unanswered_s, stale_s),
            None => 0.0,
        }
    }

    /// How recent its last known location is, on the same scale.
    #[must_use]
    pub fn location_certainty(&self, stale_s: f64) -> f64 {
        match self.last {
            Some(_) => recency(self.unlocated_s, stale_s),
            None => 0.0,
        }
    }

    /// Whether its behavior is unknown: it never answered, or not for longer than `stale_s`.
    #[must_use]
    pub fn is_unknown(&self, stale_s: f64) -> bool {
        self.behavior.is_none() || self.unanswered_s > stale_s
    }
}

/// From 1 for an age of 0 to 0 for `stale_s`.
fn recency(age_s: f64, stale_s: f64) -> f64 {
    if age_s == 0.0 {
        1.0
    } else {
        1.0 - (age_s / stale_s).min(1.0)
    }
}
