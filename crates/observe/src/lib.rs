//! What is asked of a run, tick by tick, while it is played or when it is read again. Pure: no simulator, no file, no clock.

mod combine;
mod comparison;
mod condition;
mod counter;
pub mod expect;
mod expression;
mod live;
pub mod measure;
mod pattern;
mod places;
mod probe;
mod quantity;
mod sites;

pub mod words;

use std::collections::BTreeMap;

use protocol::messages::{Point, StateVariables};
use protocol::{Event, RobotName, Tick};

pub use combine::By;
pub use comparison::{TestError, ValueBounds, ValueTest};
pub use condition::{Evaluation, TickCondition, TickConditionError};
pub use counter::{Counter, NoCounter};
pub use expect::{Expectation, Judgment, Monitor, Monitors};
pub use expression::{Expression, ExpressionError};
pub use live::{Measurements, ScenarioMeasure, WrongMeasure, check_measures};
pub use measure::{Measure, MeasureError, MeasureSource, Measured};
pub use pattern::{Pattern, PatternError};
pub use places::FieldRegion;
pub use probe::Probe;
pub use quantity::{Goal, OfRobot, OfValues, QuantityError, RunQuantity, StateNames, Team};
pub use sites::SiteStates;
pub use words::Words;

/// What conditions and measures depend on beside the ticks of a run.
#[derive(Debug, Clone)]
pub struct RunSetting {
    /// Length of a tick, seconds.
    pub tick_s: f64,
    /// The last tick that is planned.
    pub ticks: Tick,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body without a shape of its own, meters.
    pub body_m: f64,
    /// Radius of the largest disc within each robot that has a shape of its own, meters.
    pub inradius_m: BTreeMap<RobotName, f64>,
    /// Range of the radios at the start, meters; `None` where distance does not matter.
    pub radio_range_m: Option<f64>,
    /// The robots, in the order of their names.
    pub roster: Vec<RobotName>,
    /// The sites, with their states at the start: the types of their variables never change.
    pub sites: BTreeMap<String, StateVariables>,
    /// Names of the layers.
    pub layers: Vec<String>,
}

impl RunSetting {
    /// Whether a site has this name, or matches this pattern.
    pub(crate) fn has_site(&self, pattern: &str) -> bool {
        self.sites
            .keys()
            .any(|site| protocol::pattern::matches(pattern, site))
    }

    /// The sites that there are, for errors.
    pub(crate) fn sites_in_words(&self) -> String {
        comparison::in_words("it has", self.sites.keys().map(String::as_str))
    }
}

/// A complete tick of a run, or its end.
pub struct Observation<'a> {
    /// The tick; at the end of the run, the last one again.
    pub tick: Tick,
    /// Length of a tick, seconds.
    pub tick_s: f64,
    /// What happened in it.
    pub events: &'a [Event],
    /// What a robot reported last; `None` before its first report.
    pub state: &'a dyn Fn(&RobotName) -> Option<RobotState<'a>>,
    /// The state of a site after the tick.
    pub site: &'a dyn Fn(&str) -> Option<&'a StateVariables>,
    /// The numbers of the cells of a layer after the tick.
    pub layer: &'a dyn Fn(&str) -> Option<&'a [f64]>,
}

impl Observation<'_> {
    /// The simulated time of the tick, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        protocol::time::time_s(self.tick, self.tick_s)
    }
}

/// What a robot reported last. Borrowed, because a run is observed in every tick.
#[derive(Debug, Clone, Copy)]
pub struct RobotState<'a> {
    /// Where it stands, meters.
    pub location: Point,
    /// The variables it publishes.
    pub state_variables: &'a StateVariables,
    /// Its emotion state.
    pub emotion_state: &'a str,
    /// Its behavior state.
    pub behavior_state: &'a str,
}
