//! `[drawn]` of a record: the regions in which places were drawn that the record has written out, so that another seed can draw them
//! anew.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use world::Region;

use super::super::checked::Scenario;
use super::place::StartPlace;

/// Regions by name, or by number from 1.
type Regions = BTreeMap<String, StartPlace>;

/// The table. The places themselves are where those of others are.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DrawnTable {
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    robot: Regions,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    site: Regions,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    obstacle: Regions,
    /// Of the peaks of each layer.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    layer: BTreeMap<String, Regions>,
}

impl DrawnTable {
    /// The table of a scenario; `None` if all of its places are given.
    pub(super) fn of(scenario: &Scenario) -> Option<Self> {
        let mut table = Self::default();
        for (name, robot) in &scenario.robots {
            add(&mut table.robot, name, robot.drawn);
        }
        for (name, site) in &scenario.sites {
            add(&mut table.site, name, site.drawn);
        }
        for (index, obstacle) in scenario.obstacles.iter().enumerate() {
            add(&mut table.obstacle, &(index + 1), obstacle.drawn);
        }
        for (name, layer) in &scenario.layers {
            let mut peaks = Regions::new();
            for (index, peak) in layer.peaks.iter().enumerate() {
                add(&mut peaks, &(index + 1), peak.drawn);
            }
            if !peaks.is_empty() {
                table.layer.insert(name.clone(), peaks);
            }
        }

        let is_empty = table.robot.is_empty()
            && table.site.is_empty()
            && table.obstacle.is_empty()
            && table.layer.is_empty();
        (!is_empty).then_some(table)
    }

    /// Notes the regions in a scenario whose places are known.
    ///
    /// # Errors
    /// In words, if the scenario has no such robot, site, obstacle or peak, or a place is no region.
    pub(super) fn note(&self, scenario: &mut Scenario) -> Result<(), String> {
        for (name, place) in &self.robot {
            let robot = scenario.robots.get_mut(name.as_str());
            note(robot.map(|robot| &mut robot.drawn), place, "robot", name)?;
        }
        for (name, place) in &self.site {
            let site = scenario.sites.get_mut(name);
            note(site.map(|site| &mut site.drawn), place, "site", name)?;
        }
        for (number, place) in &self.obstacle {
            let obstacle = numbered(&mut scenario.obstacles, number);
            let drawn = obstacle.map(|obstacle| &mut obstacle.drawn);
            note(drawn, place, "obstacle", number)?;
        }
        for (name, peaks) in &self.layer {
            let mut layer = scenario.layers.get_mut(name);
            for (number, place) in peaks {
                let peak = layer
                    .as_mut()
                    .and_then(|layer| numbered(&mut layer.peaks, number));
                note(peak.map(|peak| &mut peak.drawn), place, "peak", number)?;
            }
        }
        Ok(())
    }
}

fn add(regions: &mut Regions, name: &impl ToString, drawn: Option<Region>) {
    if let Some(region) = drawn {
        regions.insert(name.to_string(), StartPlace::anew(region));
    }
}

/// An element by its number from 1.
fn numbered<'a, T>(list: &'a mut [T], number: &str) -> Option<&'a mut T> {
    let number: usize = number.parse().ok()?;
    list.get_mut(number.checked_sub(1)?)
}

fn note(
    drawn: Option<&mut Option<Region>>,
    place: &StartPlace,
    what: &str,
    name: &str,
) -> Result<(), String> {
    let (_, region) = place.resolve();
    match (drawn, region) {
        (Some(drawn), Some(region)) => {
            *drawn = Some(region);
            Ok(())
        }
        (None, _) => Err(format!("there is no {what} {name}")),
        (_, None) => Err(format!("the place of {what} {name} is no region")),
    }
}
