//! Sites of a scenario, checked: things at a place with a state, which robots sense and change. They are not solid.

use std::collections::BTreeMap;

use protocol::messages::{Point, StateVariables, Variable};
use serde::{Deserialize, Serialize};
use world::Region;

/// A site of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteSpec {
    /// A word for what it is, by which it is colored.
    pub kind: String,
    /// Its place, meters.
    pub at: Point,
    /// Where the place is drawn, if it follows from the seed.
    pub drawn: Option<Region>,
    /// Distance within which robots sense it and may act on it, meters.
    pub range_m: f64,
    /// Whether every robot knows of it from the start: its name, its kind and its place.
    pub is_known: bool,
    /// What happens where two robots change the same variable of it in a tick.
    pub on_conflict: OnConflict,
    /// The variables of its state, by name.
    pub state: BTreeMap<String, SiteVariable>,
}

/// A variable of the state of a site.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteVariable {
    /// Its value at the start. Its type never changes.
    pub start: Variable,
    /// Least value of a number.
    pub min: Option<f64>,
    /// Greatest value of a number.
    pub max: Option<f64>,
}

impl SiteSpec {
    /// Its state at the start.
    #[must_use]
    pub fn start(&self) -> StateVariables {
        let variables = self.state.iter();
        variables
            .map(|(key, variable)| (key, variable.start.clone()))
            .collect()
    }
}

/// The states of sites at the start, by name.
pub(super) fn start_states(sites: &BTreeMap<String, SiteSpec>) -> BTreeMap<String, StateVariables> {
    let sites = sites.iter();
    sites
        .map(|(name, spec)| (name.clone(), spec.start()))
        .collect()
}

/// What happens where two robots change the same variable of a site in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnConflict {
    /// Their actions are carried out in the order of their names, each on what the one before left.
    #[default]
    First,
    /// Both are refused.
    Refuse,
}
