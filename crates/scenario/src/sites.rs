//! Sites of a scenario, checked: things at a place with a state, which robots sense and change. They are not solid.

use std::collections::BTreeMap;

use protocol::messages::{Point, Variable};
use serde::{Deserialize, Serialize};
use world::{Placer, Region};

use super::checked::{Scenario, to_wire};

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

/// Places the sites whose places are random, each by a stream of its own, where a body is inside the field and on no obstacle.
/// Sites are not solid: they hinder neither each other nor robots.
///
/// # Errors
/// The name of a site that has no place, and why.
pub(super) fn place_at_random(scenario: &mut Scenario) -> Result<(), (String, String)> {
    let is_any_random = scenario.sites.values().any(|site| site.drawn.is_some());
    if !is_any_random {
        return Ok(());
    }

    let mut hall = scenario.hall();
    hall.robots.clear();
    let placer = Placer::new(&hall);
    let seed = scenario.seed;
    for (name, site) in &mut scenario.sites {
        let Some(region) = site.drawn else {
            continue;
        };
        let refuse = |reason: String| (name.clone(), reason);
        // What is placed in a copy leaves no trace.
        let mut placer = placer.clone().map_err(|error| refuse(error.to_string()))?;
        let mut stream = protocol::random::stream(seed, &format!("at/{name}"));
        let at = placer.place(None, region, &mut stream).ok_or_else(|| {
            refuse(format!(
                "there is no free place for site {name} in {} draws: the field is too full",
                Placer::TRIES
            ))
        })?;
        site.at = to_wire(at);
    }
    Ok(())
}
