//! How guests walk if not at random, and what they do beside walking, if a scenario says so: they see the faces that robots show,
//! and ask robots for what these serve. Not documented in the paper \[I\].

use std::collections::BTreeSet;
use std::num::NonZeroU64;
use std::sync::Arc;

use protocol::{RobotName, Tick};
use world::{CrowdModel, Point, Recorded, Track, Triangular};

/// What moves the guests.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum GuestMotion {
    /// The random walk of the paper.
    #[default]
    Random,
    /// A record of people.
    Recorded(RecordedGuests),
    /// A model of how people walk.
    Crowd(ModeledGuests),
}

impl GuestMotion {
    /// The record, if there is one.
    #[must_use]
    pub fn recorded(&self) -> Option<&RecordedGuests> {
        match self {
            Self::Recorded(recorded) => Some(recorded),
            Self::Random | Self::Crowd(_) => None,
        }
    }
}

/// Guests who walk by a model of how people walk.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeledGuests {
    /// The model.
    pub model: CrowdModel,
    /// What they want, one thing after the other. Without any they want what the random walk has them do.
    pub wants: Vec<GuestWant>,
}

/// One of the things that guests want.
#[derive(Debug, Clone, PartialEq)]
pub struct GuestWant {
    /// What it is.
    pub goal: WantGoal,
    /// How often it is wanted, in proportion to the others.
    pub weight: f64,
    /// How near a guest goes to it, meters.
    pub within_m: f64,
    /// For how long a guest stays there, seconds; for an exit, outside: without it, for good.
    pub stay_s: Option<Triangular>,
    /// How long a guest tries, ticks.
    pub give_up: Tick,
}

/// What guests want.
#[derive(Debug, Clone, PartialEq)]
pub enum WantGoal {
    /// A site, by name.
    Site(String),
    /// A place, meters.
    Place(Point),
    /// To leave at a place, meters.
    Exit(Point),
    /// Something that a robot counts as served.
    Treat(RobotName),
}

/// Guests who walk as recorded people did.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedGuests {
    /// The file or the run as the scenario names it.
    pub from: String,
    /// Where each person was, in the hall. Times are from the first frame of the record on.
    pub tracks: Arc<Vec<Track>>,
    /// Length of the record, milliseconds.
    pub length_ms: NonZeroU64,
    /// Time of the record at tick 0, milliseconds; drawn from the guests' stream if there is none.
    pub start_ms: Option<u64>,
    /// Whether it begins again at its end.
    pub repeats: bool,
    /// How fast a person that had to wait goes back to where the record has it, m/s.
    pub catch_up_mps: f64,
}

impl RecordedGuests {
    /// The same for the environment.
    pub(crate) fn walk(&self) -> Recorded {
        let thousand = NonZeroU64::MIN.saturating_add(999);
        let period_us = self.length_ms.saturating_mul(thousand);
        Recorded {
            tracks: self.tracks.clone(),
            start_us: self.start_ms.map(|start_ms| start_ms.saturating_mul(1000)),
            period_us: self.repeats.then_some(period_us),
            catch_up_mps: self.catch_up_mps,
        }
    }
}

/// What guests do beside walking. By default nothing, as in the paper.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GuestRules {
    /// What they do at a robot's face.
    pub faces: Option<Faces>,
    /// What they ask of robots.
    pub requests: Option<Requests>,
}

/// What guests near a robot do at the face that it shows: its state variable `facial_expression`.
#[derive(Debug, Clone, PartialEq)]
pub struct Faces {
    /// How near, from center to center, meters.
    pub range_m: f64,
    /// Faces for which they make way.
    pub make_way: BTreeSet<String>,
    /// Faces to which they come.
    pub approach: BTreeSet<String>,
}

/// Guests ask a robot for something, as often as its state variables `served` and `missed` rise, and their mood is by what
/// they get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requests {
    /// How near the guests are who ask, from center to center, meters.
    pub range_m: f64,
    /// After how many ticks in which a guest has waited in vain it is annoyed.
    pub patience: Tick,
    /// For how many ticks a guest stops that has got something, while the robot is near; 0 if it walks on.
    pub stop: Tick,
    /// Whether a guest that waits comes to the robot that it asked in vain, while that is near.
    pub comes_closer: bool,
}
