//! What a change of the scenario is called on the picture: what begins and what ends with it, and not all that it sets. The words
//! are those of `cars ctl`.

use std::collections::{BTreeMap, BTreeSet};

use protocol::Tick;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use timeline::ChangeSpan;
use toml::Table;

/// Most letters of a label; the title has everything.
const MAX_LETTERS: usize = 48;
/// Most letters of a value that is shown as it is set.
const SETTING_LETTERS: usize = 40;
/// Letters of such a value that are kept at its beginning, so that its end, which differs, is shown.
const BEGINNING_LETTERS: usize = 14;
/// Most links that a label names.
const MAX_LINKS: usize = 2;

/// A link, in the direction of its messages.
type Link = (String, String);

/// An entry of `fault` of a scenario.
#[derive(Deserialize, PartialEq)]
struct FaultEntry {
    #[serde(rename = "do")]
    kind: String,
    robot: String,
    at: Option<String>,
    until: Option<String>,
    #[serde(flatten)]
    rest: Table,
}

/// An entry of `network.partition`.
#[derive(Deserialize, PartialEq)]
struct PartitionEntry {
    groups: Vec<Vec<String>>,
    #[serde(default)]
    one_way: bool,
    from: Option<String>,
    until: Option<String>,
}

/// An entry of `network.lose`, `network.delay` or `network.duplicate`.
#[derive(Deserialize, PartialEq)]
struct CommandEntry {
    from: String,
    to: String,
    #[serde(flatten)]
    rest: Table,
}

/// The changes of a tick in few words.
pub(crate) fn in_words(changes: &[ChangeSpan], tick_s: f64) -> String {
    let mut words = Vec::new();
    for change in changes {
        let known = known(change, tick_s);
        words.extend(known.unwrap_or_else(|| vec![elided(&change.set)]));
    }

    let count = words.len();
    let mut label = String::new();
    for (index, word) in words.into_iter().enumerate() {
        let letters = label.chars().count() + word.chars().count();
        if index > 0 && letters > MAX_LETTERS {
            label += &format!(", +{}", count - index);
            break;
        }
        label += if index > 0 { ", " } else { "" };
        label += &word;
    }
    label
}

/// What a change of one of the lists of a scenario does; `None` if it is of something else.
fn known(change: &ChangeSpan, tick_s: f64) -> Option<Vec<String>> {
    let (path, _) = change.set.split_once('=')?;
    let (what, words, is_empty) = match path.trim() {
        "fault" => {
            let changed = Changed::<FaultEntry>::read(change, tick_s)?;
            ("faults", changed.words()?, changed.list.is_empty())
        }
        "network.partition" => {
            let changed = Changed::<PartitionEntry>::read(change, tick_s)?;
            ("partitions", changed.words()?, changed.list.is_empty())
        }
        "network.lose" => named("lose", "losses", change, tick_s)?,
        "network.delay" => named("delay", "delays", change, tick_s)?,
        "network.duplicate" => named("duplicate", "duplicates", change, tick_s)?,
        _ => return None,
    };

    Some(match (words.is_empty(), is_empty) {
        (false, _) => words,
        (true, true) => vec![format!("no {what}")],
        (true, false) => vec![format!("{what} as before")],
    })
}

/// A list of a scenario that is set.
struct Changed<T> {
    list: Vec<T>,
    /// The list that was set before, as far as a change has set it.
    before: Option<Vec<T>>,
    /// The tick from which on it is set.
    now: Tick,
    tick_s: f64,
}

impl<T: DeserializeOwned + PartialEq> Changed<T> {
    /// `None` if what is set is not such a list.
    fn read(change: &ChangeSpan, tick_s: f64) -> Option<Self> {
        let parse = |set: &str| {
            let (_, value) = set.split_once('=')?;
            let mut parsed: BTreeMap<String, Vec<T>> =
                toml::from_str(&format!("list = {value}")).ok()?;
            parsed.remove("list")
        };
        Some(Self {
            list: parse(&change.set)?,
            before: change.before.as_deref().and_then(parse),
            now: change.tick,
            tick_s,
        })
    }

    /// The elements that were not in the list before.
    fn added(&self) -> impl Iterator<Item = &T> {
        let before = self.before.as_deref().unwrap_or_default();
        self.list.iter().filter(|one| !before.contains(one))
    }

    /// A time as a tick, none for none; `None` if it cannot be read.
    fn tick(&self, time: Option<&String>) -> Option<Option<Tick>> {
        let Some(time) = time else {
            return Some(None);
        };

        let (number, unit) = time.trim().split_once(' ')?;
        let unit_s = match unit.trim() {
            "ms" => 0.001,
            "s" => 1.0,
            "min" => 60.0,
            "h" => 3600.0,
            _ => return None,
        };
        let time_s = number.parse::<f64>().ok()? * unit_s;
        Some(Some((time_s / self.tick_s).round() as Tick))
    }
}

impl Changed<FaultEntry> {
    /// What happens to processes now; if nothing does, what was added, or else removed.
    fn words(&self) -> Option<Vec<String>> {
        let mut words = Vec::new();
        for fault in &self.list {
            let FaultEntry { kind, robot, .. } = fault;
            if self.tick(fault.at.as_ref())? == Some(self.now) {
                words.push(format!("{kind} {robot}"));
            } else if self.tick(fault.until.as_ref())? == Some(self.now) {
                words.push(format!("recover {robot}"));
            }
        }
        if !words.is_empty() {
            return Some(words);
        }

        for fault in self.added() {
            let at = fault.at.as_ref()?;
            words.push(format!("{} {} at {at}", fault.kind, fault.robot));
        }
        if words.is_empty() {
            let mut before = self.before.iter().flatten();
            let removed = before.find(|fault| !self.list.contains(fault));
            words.extend(removed.map(|fault| format!("no {} {}", fault.kind, fault.robot)));
        }
        Some(words)
    }
}

impl Changed<PartitionEntry> {
    /// The links that are cut and healed now; if none is, the partitions that were added.
    fn words(&self) -> Option<Vec<String>> {
        let before = self.before.as_ref().unwrap_or(&self.list);
        let before = self.cut_at(before, self.now.saturating_sub(1))?;
        let after = self.cut_at(&self.list, self.now)?;

        let mut words = Vec::new();
        words.extend(links("cut", after.difference(&before).cloned()));
        words.extend(links("heal", before.difference(&after).cloned()));
        if !words.is_empty() {
            return Some(words);
        }

        for partition in self.added() {
            let until = partition.until.as_ref();
            let until = until.map_or(String::new(), |until| format!(" until {until}"));
            let cut = links("cut", separated(partition));
            words.extend(cut.map(|cut| format!("{cut}{until}")));
        }
        Some(words)
    }

    /// The links that are cut in a tick.
    fn cut_at(&self, partitions: &[PartitionEntry], tick: Tick) -> Option<BTreeSet<Link>> {
        let mut cut = BTreeSet::new();
        for partition in partitions {
            let from = self.tick(partition.from.as_ref())?;
            let until = self.tick(partition.until.as_ref())?;
            let has_begun = from.is_some_and(|from| from <= tick);
            let is_over = until.is_some_and(|until| until <= tick);
            if has_begun && !is_over {
                cut.extend(separated(partition));
            }
        }
        Some(cut)
    }
}

/// What a list of single commands does: what it is called, the links of further commands in words, and whether it is empty.
fn named(
    verb: &str,
    what: &'static str,
    change: &ChangeSpan,
    tick_s: f64,
) -> Option<(&'static str, Vec<String>, bool)> {
    let changed = Changed::<CommandEntry>::read(change, tick_s)?;
    let added = changed.added();
    let further: BTreeSet<Link> = added
        .map(|command| (command.from.clone(), command.to.clone()))
        .collect();
    let words = links(verb, further).into_iter().collect();
    Some((what, words, changed.list.is_empty()))
}

/// The links between the groups of a partition.
fn separated(partition: &PartitionEntry) -> BTreeSet<Link> {
    let mut links = BTreeSet::new();
    for (own, group) in partition.groups.iter().enumerate() {
        for (other, others) in partition.groups.iter().enumerate() {
            if own == other || (partition.one_way && own > other) {
                continue;
            }
            for from in group {
                links.extend(others.iter().map(|to| (from.clone(), to.clone())));
            }
        }
    }
    links
}

/// What is done to links, each named once, in few words; `None` without links.
fn links(verb: &str, links: impl IntoIterator<Item = Link>) -> Option<String> {
    let mut count = 0;
    let mut pairs: BTreeMap<Link, &str> = BTreeMap::new();
    for (from, to) in links {
        count += 1;
        match pairs.get_mut(&(to.clone(), from.clone())) {
            Some(arrow) => *arrow = "↔",
            None => {
                pairs.insert((from, to), "→");
            }
        }
    }

    let named = pairs.iter();
    let named = named.map(|((from, to), arrow)| format!("{from} {arrow} {to}"));
    match pairs.len() {
        0 => None,
        1..=MAX_LINKS => Some(format!("{verb} {}", named.collect::<Vec<_>>().join(", "))),
        _ => Some(format!("{verb} {count} links")),
    }
}

/// A setting as it is; of one that is long, the beginning and the end.
fn elided(set: &str) -> String {
    let count = set.chars().count();
    if count <= SETTING_LETTERS {
        return set.to_owned();
    }

    let end_letters = SETTING_LETTERS - BEGINNING_LETTERS;
    let beginning = set.chars().take(BEGINNING_LETTERS);
    let end = set.chars().skip(count - end_letters);
    beginning.chain(['…']).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 0.5;

    fn label(tick: Tick, set: &str, before: Option<&str>) -> String {
        let change = ChangeSpan {
            tick,
            set: set.to_owned(),
            before: before.map(str::to_owned),
        };
        in_words(&[change], TICK_S)
    }

    #[test]
    fn a_fault_is_named_by_what_happens_now() {
        let restart = r#"{ at = "0.5 s", do = "restart", robot = "Leguin" }"#;
        let hang = r#"{ at = "15.5 s", do = "hang", robot = "Leguin" }"#;
        let over = r#"{ at = "15.5 s", do = "hang", robot = "Leguin", until = "25.5 s" }"#;
        let crash = r#"{ at = "25500 ms", do = "crash", robot = "Butler" }"#;

        let first = format!("fault=[{restart}, {hang}]");
        assert_eq!(label(31, &first, None), "hang Leguin");
        let second = format!("fault=[{restart}, {over}, {crash}]");
        let said = label(51, &second, Some(&first));
        assert_eq!(said, "recover Leguin, crash Butler");
        let said = label(60, &second, Some(&first));
        assert_eq!(said, "hang Leguin at 15.5 s, crash Butler at 25500 ms");
        assert_eq!(label(60, &first, Some(&second)), "hang Leguin at 15.5 s");
        assert_eq!(label(60, &second, Some(&second)), "faults as before");
        assert_eq!(label(60, "fault=[]", Some("fault=[]")), "no faults");
        let only = format!("fault=[{restart}]");
        assert_eq!(label(60, "fault=[]", Some(&only)), "no restart Leguin");
    }

    #[test]
    fn a_partition_is_named_by_the_links_that_change() {
        let both = r#"{ from = "3 s", groups = [["Butler"], ["Leguin"]] }"#;
        let both_over = r#"{ from = "3 s", groups = [["Butler"], ["Leguin"]], until = "8 s" }"#;
        let one = r#"{ from = "8 s", groups = [["Butler"], ["Leguin"]], one_way = true }"#;

        let first = format!("network.partition=[{both}]");
        assert_eq!(label(6, &first, None), "cut Butler ↔ Leguin");
        let second = format!("network.partition=[{one}, {both_over}]");
        assert_eq!(label(16, &second, Some(&first)), "heal Leguin → Butler");
        assert_eq!(label(16, &second, None), "heal Leguin → Butler");
        let none = "network.partition=[]";
        assert_eq!(label(20, none, Some(&second)), "heal Butler → Leguin");
        assert_eq!(label(20, none, None), "no partitions");
        // It lasts already when a scenario sets it.
        let said = label(10, &format!("network.partition=[{both_over}]"), None);
        assert_eq!(said, "cut Butler ↔ Leguin until 8 s");
        let many = r#"network.partition=[{ from = "3 s", groups = [["A", "B"], ["C", "D"]] }]"#;
        assert_eq!(label(6, many, None), "cut 8 links");
    }

    #[test]
    fn a_lost_command_is_named_by_its_link() {
        let first = r#"network.lose=[{ from = "Butler", number = 3, to = "Leguin" }]"#;
        assert_eq!(label(21, first, None), "lose Butler → Leguin");
        let second = r#"network.lose=[{ from = "Butler", number = 3, to = "Leguin" }, { from = "Leguin", number = 1, to = "Butler" }]"#;
        assert_eq!(label(22, second, Some(first)), "lose Leguin → Butler");
        let late = r#"network.delay=[{ by = "5 s", from = "A", number = 3, to = "B" }]"#;
        assert_eq!(label(21, late, None), "delay A → B");
        let double = r#"network.duplicate=[{ from = "A", number = 3, to = "B" }]"#;
        assert_eq!(label(21, double, None), "duplicate A → B");
        assert_eq!(label(21, double, Some(double)), "duplicates as before");
        assert_eq!(label(21, "network.delay=[]", None), "no delays");
    }

    #[test]
    fn what_else_is_set_is_shown_with_its_end() {
        let short = r#"robot.Butler.params.policy="rules""#;
        assert_eq!(label(5, short, None), short);
        let long = r#"robot.Butler.params.some_very_long_name.policy="rules""#;
        assert_eq!(
            label(5, long, None),
            r#"robot.Butler.p…y_long_name.policy="rules""#
        );
        // What cannot be read is shown as it is.
        let strange = r#"fault=[{ at = "soon" }]"#;
        assert_eq!(label(5, strange, None), strange);
    }

    #[test]
    fn all_changes_of_a_tick_have_one_label() {
        let change = |robot: &str| ChangeSpan {
            tick: 8,
            set: format!(r#"robot.{robot}.on_late="continue""#),
            before: None,
        };
        let changes = ["Butler", "Leguin", "Vonda"].map(change);
        let expected = r#"robot.Butler.on_late="continue", +2"#;
        assert_eq!(in_words(&changes, TICK_S), expected);
    }
}
