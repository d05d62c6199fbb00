//! A case: a plan of faults, and what is left of the scenario that it is played on. It renders to changes of the scenario.

use std::collections::BTreeSet;

use config::Override;
use protocol::{RobotName, Tick};
use serde::Serialize;
use toml::{Table, Value};

use super::fault::{Effect, Messages, PlannedFault, chance, seconds};

use super::sent::Link;

/// A plan of faults on a scenario, which may be smaller than the one that is hunted in.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct FaultCase {
    /// The faults.
    pub faults: Vec<PlannedFault>,
    /// Duration, ticks; `None` for that of the scenario.
    pub ticks: Option<Tick>,
    /// Number of guests; `None` for that of the scenario.
    pub guests: Option<usize>,
    /// Robots of the scenario that do not take part.
    pub without: BTreeSet<RobotName>,
}

impl FaultCase {
    /// These faults on the whole scenario.
    #[must_use]
    pub fn of(faults: Vec<PlannedFault>) -> Self {
        Self {
            faults,
            ..Self::default()
        }
    }

    /// The same scenario with other faults.
    #[must_use]
    pub fn with_faults(&self, faults: Vec<PlannedFault>) -> Self {
        Self {
            faults,
            ..self.clone()
        }
    }

    /// Whether both are on the same part of the scenario.
    #[must_use]
    pub fn has_world_of(&self, other: &Self) -> bool {
        self.with_faults(Vec::new()) == other.with_faults(Vec::new())
    }

    /// The changes that make the case of a scenario, which is given as the content of its file.
    ///
    /// # Errors
    /// The text of a change that cannot be made.
    pub fn changes(&self, scenario: &Table, tick_s: f64) -> Result<Vec<Override>, String> {
        let mut changes = Vec::new();
        let mut set = |path: &str, value: Value| -> Result<(), String> {
            changes.push(format!("{path}={value}").parse()?);
            Ok(())
        };

        if !self.without.is_empty() {
            set("robot", self.robots(scenario))?;
        }
        if let Some(ticks) = self.ticks {
            set("duration", seconds(ticks, tick_s).into())?;
        }

        let mut guests = self.guests;
        let mut channels = Vec::new();
        let mut entries = Entries::default();
        for fault in &self.faults {
            match fault {
                PlannedFault::Channel { .. } => channels.push(fault),
                PlannedFault::Crowd { guests: count } => guests = Some(*count),
                PlannedFault::Absence { robot, .. } => {
                    set(&format!("robot.{robot}.on_late"), "continue".into())?;
                    entries.add(fault, tick_s);
                }
                _ => entries.add(fault, tick_s),
            }
        }

        if let Some(guests) = guests {
            set("guests.count", integer(guests as u64))?;
        }
        for (path, own) in [
            ("obstacle", entries.obstacles),
            ("fault", entries.faults),
            ("network.lose", entries.lost),
            ("network.delay", entries.late),
            ("network.duplicate", entries.doubled),
            ("reseed", entries.reseeds),
            ("network.partition", entries.partitions),
        ] {
            if !own.is_empty() {
                set(path, extended(scenario, path, own))?;
            }
        }
        for (path, value) in network_over_time(scenario, &channels, tick_s) {
            set(path, value)?;
        }
        Ok(changes)
    }

    /// The robots that take part, as in the file.
    fn robots(&self, scenario: &Table) -> Value {
        let mut robots = list(scenario, "robot");
        robots.retain(|robot| {
            let name = robot.get("name").and_then(Value::as_str);
            !self.without.iter().any(|gone| Some(gone.as_str()) == name)
        });
        Value::Array(robots)
    }
}

/// What faults add to lists of a scenario.
#[derive(Default)]
struct Entries {
    lost: Vec<Value>,
    late: Vec<Value>,
    doubled: Vec<Value>,
    reseeds: Vec<Value>,
    partitions: Vec<Value>,
    faults: Vec<Value>,
    obstacles: Vec<Value>,
}

impl Entries {
    /// Adds the entries of a fault; those of the others are not in lists.
    fn add(&mut self, fault: &PlannedFault, tick_s: f64) {
        match fault {
            PlannedFault::Lose { link, number } => {
                self.lost.push(Value::Table(command(link, *number)));
            }
            PlannedFault::Late { link, number, by } => {
                let mut late = command(link, *number);
                late.insert("by".to_owned(), seconds(*by, tick_s).into());
                self.late.push(Value::Table(late));
            }
            PlannedFault::Double { link, number } => {
                self.doubled.push(Value::Table(command(link, *number)));
            }
            PlannedFault::Reseed { at, seed, of } => self.reseeds.push(table([
                ("at", seconds(*at, tick_s).into()),
                ("seed", integer(*seed)),
                ("of", texts(of.iter().map(String::as_str))),
            ])),
            PlannedFault::Partition {
                one,
                other,
                one_way,
                cuts,
                span,
            } => self.partitions.push(table([
                ("groups", Value::Array(vec![group(one), group(other)])),
                ("from", seconds(span.from, tick_s).into()),
                ("until", seconds(span.until, tick_s).into()),
                ("one_way", (*one_way).into()),
                ("cuts", texts(cuts.iter().map(|of| of.name()))),
            ])),
            PlannedFault::Absence { robot, why, span } => self.faults.push(table([
                ("robot", robot.to_string().into()),
                ("do", why.name().into()),
                ("at", seconds(span.from, tick_s).into()),
                ("until", seconds(span.until, tick_s).into()),
            ])),
            PlannedFault::Wall { at } => {
                for at in at {
                    let place = [at.x, at.y].map(|m| Value::from(format!("{m} m")));
                    let place = Value::Array(place.to_vec());
                    self.obstacles.push(table([("at", place)]));
                }
            }
            PlannedFault::Channel { .. } | PlannedFault::Crowd { .. } => {}
        }
    }
}

/// The entry of a single command.
fn command(link: &Link, number: u64) -> Table {
    let mut entry = Table::new();
    entry.insert("from".to_owned(), link.from.to_string().into());
    entry.insert("to".to_owned(), link.to.to_string().into());
    entry.insert("number".to_owned(), integer(number));
    entry
}

/// A table of TOML.
fn table<const N: usize>(entries: [(&str, Value); N]) -> Value {
    let entries = entries.into_iter();
    Value::Table(
        entries
            .map(|(key, value)| (key.to_owned(), value))
            .collect(),
    )
}

/// A list of texts.
fn texts<T: Into<Value>>(texts: impl Iterator<Item = T>) -> Value {
    Value::Array(texts.map(Into::into).collect())
}

fn integer(number: u64) -> Value {
    Value::Integer(i64::try_from(number).unwrap_or(i64::MAX))
}

fn group(robots: &[RobotName]) -> Value {
    texts(robots.iter().map(RobotName::as_str))
}

/// The value at a path of the file.
fn at<'a>(scenario: &'a Table, path: &str) -> Option<&'a Value> {
    let mut parts = path.split('.');
    let mut value = scenario.get(parts.next()?)?;
    for part in parts {
        value = value.get(part)?;
    }
    Some(value)
}

/// The list at a path of the file; empty if it has none.
fn list(scenario: &Table, path: &str) -> Vec<Value> {
    let value = at(scenario, path).and_then(Value::as_array);
    value.cloned().unwrap_or_default()
}

/// The list at a path of the file, followed by these entries.
fn extended(scenario: &Table, path: &str, own: Vec<Value>) -> Value {
    let mut all = list(scenario, path);
    all.extend(own);
    Value::Array(all)
}

/// What a case sets of the network by chance: at the beginning, and by `[[change]]` where an effect begins or ends.
fn network_over_time(
    scenario: &Table,
    faults: &[&PlannedFault],
    tick_s: f64,
) -> Vec<(&'static str, Value)> {
    let mut moments = BTreeSet::new();
    for fault in faults {
        if let PlannedFault::Channel { span, .. } = fault {
            moments.insert(span.from);
            moments.insert(span.until);
        }
    }

    let mut before = network(scenario, &[]);
    let mut set = Vec::new();
    let mut changes = Vec::new();
    for tick in moments {
        let mut in_effect = Vec::new();
        for fault in faults {
            if let PlannedFault::Channel { span, .. } = fault
                && (span.from..span.until).contains(&tick)
            {
                in_effect.push(*fault);
            }
        }

        let now = network(scenario, &in_effect);
        let mut changed = Vec::new();
        for (own, other) in now.iter().zip(&before) {
            if own != other {
                changed.push(own.clone());
            }
        }
        if tick == 0 {
            set = changed;
        } else if !changed.is_empty() {
            let set_texts = changed
                .iter()
                .map(|(path, value)| format!("{path}={value}"));
            changes.push(table([
                ("at", seconds(tick, tick_s).into()),
                ("set", texts(set_texts)),
            ]));
        }
        before = now;
    }

    if !changes.is_empty() {
        set.push(("change", extended(scenario, "change", changes)));
    }
    set
}

/// The parts of the network that depend on chance, with these effects.
fn network(scenario: &Table, faults: &[&PlannedFault]) -> [(&'static str, Value); 3] {
    let empty = || Value::Table(Table::new());
    let channel = |path| at(scenario, path).cloned().unwrap_or_else(empty);
    let mut commands = channel("network.commands");
    let mut queries = channel("network.queries");
    for fault in faults {
        match fault {
            PlannedFault::Channel {
                link: None,
                of: Messages::Commands,
                effect,
                ..
            } => add(&mut commands, *effect),
            PlannedFault::Channel {
                link: None,
                of: Messages::Queries,
                effect,
                ..
            } => add(&mut queries, *effect),
            _ => {}
        }
    }

    let mut links = list(scenario, "network.link");
    for fault in faults {
        if let PlannedFault::Channel {
            link: Some(link),
            of,
            effect,
            ..
        } = fault
        {
            let general = match of {
                Messages::Commands => &commands,
                Messages::Queries => &queries,
            };
            links.push(link_rule(&links, general, link, *of, *effect));
        }
    }
    [
        ("network.commands", commands),
        ("network.queries", queries),
        ("network.link", Value::Array(links)),
    ]
}

/// The rule of a link: what holds on it so far, and the effect. Of two rules of a link, the later one holds.
fn link_rule(links: &[Value], general: &Value, link: &Link, of: Messages, effect: Effect) -> Value {
    let is_on = |rule: &&Value| {
        let name = |key| rule.get(key).and_then(Value::as_str);
        name("from") == Some(link.from.as_str()) && name("to") == Some(link.to.as_str())
    };
    let mut rules = links.iter().rev().filter(is_on);
    let so_far = rules.find_map(|rule| rule.get(of.name()));

    let mut channel = so_far.unwrap_or(general).clone();
    add(&mut channel, effect);
    table([
        ("from", link.from.to_string().into()),
        ("to", link.to.to_string().into()),
        (of.name(), channel),
    ])
}

/// Adds an effect to a channel; it replaces one of its kind.
fn add(channel: &mut Value, effect: Effect) {
    let Value::Table(channel) = channel else {
        return;
    };

    let (key, value) = match effect {
        Effect::Loss(loss) => ("loss", chance(loss).into()),
        Effect::Burst(enter, leave) => (
            "burst",
            table([
                ("enter", chance(enter).into()),
                ("leave", chance(leave).into()),
            ]),
        ),
        Effect::Duplication(copies) => ("duplication", chance(copies).into()),
        Effect::Delay(most_s) => (
            "delay",
            table([
                ("min", "0 s".into()),
                ("mode", format!("{most_s} s").into()),
                ("max", format!("{most_s} s").into()),
            ]),
        ),
    };
    channel.insert(key.to_owned(), value);
}
