//! The tables `[[change]]` and `[parent]` as written in the file.

use std::collections::BTreeMap;

use config::bulk;
use config::units::Time;
use config::{FileError, Override, Source};
use protocol::{RobotName, RunName, Tick};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::change::{Change, Parent};
use super::super::checked;
use super::super::fault::Fault;
use super::super::network::ticks;
use super::mood;
use super::times::Times;
use super::unplaced::unplaced;

/// Most changes of a scenario.
pub(crate) const MAX_CHANGES: usize = 1000;
/// Tables that a change cannot set.
const NOT_CHANGED: [&str; 2] = ["change", "parent"];
/// The key that ends a run early, which holds for all of it.
const END_WHEN: &str = "end_when";

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ChangeTable {
    at: Spanned<Time>,
    set: Vec<Spanned<String>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParentTable {
    run: RunName,
    tick: Tick,
    digest: String,
}

/// Checks the changes of a scenario that is complete but for them; returns them in the order of their ticks. What they set is
/// set in the text of the file, one change after the other, and `resolve` checks the text.
pub(super) fn check(
    raw: Vec<Spanned<ChangeTable>>,
    scenario: &checked::Scenario,
    source: &Source,
    resolve: impl Fn(&Source, Tick) -> Result<checked::Scenario, FileError>,
) -> Result<Vec<Change>, FileError> {
    if raw.is_empty() {
        return Ok(Vec::new());
    }
    if let Some(extra) = raw.get(MAX_CHANGES) {
        let span = Some(extra.span());
        return Err(FileError::at(source, span, "more than 1000 changes"));
    }

    let mut tables = raw;
    tables.sort_by_key(|table| ticks(table.get_ref().at.get_ref().0, scenario.tick_s));
    let mut content: toml::Table = source.parse()?;
    for table in NOT_CHANGED {
        content.remove(table);
    }
    // The record has each robot by itself, and the changes as they are: they name robots, or patterns.
    if let Some(robots) = content.get_mut("robot").and_then(toml::Value::as_array_mut) {
        bulk::separate_all(robots);
    }

    let mut changes = Vec::new();
    let mut before = scenario.clone();
    for entry in tables {
        let span = Some(entry.span());
        let table = entry.into_inner();
        let at = ticks(table.at.get_ref().0, scenario.tick_s);
        if at < 1 {
            let reason =
                "a change is in effect from the first tick on or later; before, it is the scenario";
            return Err(FileError::at(source, span, reason));
        }

        let mut set = Vec::new();
        for text in &table.set {
            let change = parse(text, source)?;
            content = change
                .apply(content)
                .map_err(|reason| FileError::at(source, Some(text.span()), &reason))?;
            set.push(change);
        }
        let after = resolve(&changed(&content, source, at)?, at)?;
        check_difference(&before, &after, at)
            .map_err(|reason| FileError::at(source, span, &reason))?;
        changes.push(change(at, set, &before, &after));
        before = after;
    }
    Ok(changes)
}

fn parse(text: &Spanned<String>, source: &Source) -> Result<Override, FileError> {
    let change: Override = text
        .get_ref()
        .parse()
        .map_err(|reason: String| FileError::at(source, Some(text.span()), &reason))?;
    if NOT_CHANGED.contains(&change.top()) {
        let reason = "a change of a change is a further [[change]]";
        return Err(FileError::at(source, Some(text.span()), reason));
    }
    if change.top() == END_WHEN {
        let reason = "`end_when` holds for the whole run: set it in the scenario";
        return Err(FileError::at(source, Some(text.span()), reason));
    }
    if change.sets(&mood::FROM) {
        // The record keeps changes as they are, and depends on no other run.
        let reason =
            "a robot has the mood of another run from the start on: set mood.from in the scenario";
        return Err(FileError::at(source, Some(text.span()), reason));
    }
    Ok(change)
}

/// The text of the scenario as it is changed.
fn changed(content: &toml::Table, source: &Source, at: Tick) -> Result<Source, FileError> {
    let text = toml::to_string(content).map_err(|error| FileError::new(error.to_string()))?;
    Ok(Source {
        name: format!("{} (with its change at tick {at})", source.name),
        text,
    })
}

/// Checks that a change concerns only what can change while the run goes on.
fn check_difference(
    before: &checked::Scenario,
    after: &checked::Scenario,
    at: Tick,
) -> Result<(), String> {
    let mut same = after.clone();
    same.network.clone_from(&before.network);
    same.lateness.on_late = before.lateness.on_late;
    same.lateness.own.clone_from(&before.lateness.own);
    same.faults.clone_from(&before.faults);
    same.parent.clone_from(&before.parent);
    for (name, robot) in &mut same.robots {
        if let Some(robot_before) = before.robots.get(name) {
            robot.parameters.clone_from(&robot_before.parameters);
        }
    }
    let is_same = same.to_toml().ok() == before.to_toml().ok();
    if !is_same {
        return Err(
            "only the network, faults, rules for late robots, and parameters of robots can change while a run goes on"
                .to_owned(),
        );
    }

    for (name, robot) in &after.robots {
        let start = mood::start(&robot.parameters);
        let start_before = before
            .robots
            .get(name)
            .map(|robot| mood::start(&robot.parameters));
        if start.is_some() && start_before != Some(start) {
            return Err(format!(
                "mood.start is {name}'s mood at the beginning of the run, and no change has an effect on it: set it in the scenario"
            ));
        }
    }

    let begun = |faults: &[Fault]| -> Vec<Fault> {
        let begun = faults.iter().filter(|fault| fault.at < at);
        begun.cloned().collect()
    };
    let (then, now) = (begun(&before.faults), begun(&after.faults));
    let mut pairs = then.iter().zip(&now);
    if then.len() != now.len() || !pairs.all(|(then, now)| then.may_become(now, at)) {
        return Err(format!(
            "what a fault did before the change, at tick {at}, cannot change"
        ));
    }
    Ok(())
}

fn change(
    at: Tick,
    set: Vec<Override>,
    before: &checked::Scenario,
    after: &checked::Scenario,
) -> Change {
    let mut parameters = BTreeMap::new();
    let mut restarted: Vec<RobotName> = Vec::new();
    for (name, robot) in &after.robots {
        let parameters_before = before.robots.get(name).map(|robot| &robot.parameters);
        if parameters_before != Some(&robot.parameters) {
            restarted.push(name.clone());
        }
        parameters.insert(name.clone(), robot.parameters.clone());
    }

    Change {
        at,
        set,
        is_by_hand: false,
        network: after.network.clone(),
        lateness: after.lateness.clone(),
        faults: after.faults.clone(),
        parameters,
        restarted,
    }
}

impl ChangeTable {
    /// Remarks about its time.
    pub(super) fn remark(&self, times: &mut Times<'_>) {
        times.begins("change", &self.at);
    }

    pub(super) fn of(change: &Change, tick_s: f64) -> Self {
        let mut set = Vec::new();
        for change in &change.set {
            set.push(unplaced(change.to_string()));
        }
        Self {
            at: unplaced(Time(change.at as f64 * tick_s)),
            set,
        }
    }
}

impl From<ParentTable> for Parent {
    fn from(table: ParentTable) -> Self {
        Self {
            run: table.run,
            tick: table.tick,
            digest: table.digest,
        }
    }
}

impl From<&Parent> for ParentTable {
    fn from(parent: &Parent) -> Self {
        Self {
            run: parent.run.clone(),
            tick: parent.tick,
            digest: parent.digest.clone(),
        }
    }
}
