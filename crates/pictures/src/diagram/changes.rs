//! What a change of the scenario is called on the picture: what begins and what ends with it, and not all that it sets. The words
//! are those of `cars ctl`.

use std::collections::{BTreeMap, BTreeSet};

use protocol::Tick;
use toml::{Table, Value};

use crate::diagram::items::Change;

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

/// The changes of a tick in few words.
pub(crate) fn in_words(changes: &[Change], tick_s: f64) -> String {
    let mut words = Vec::new();
    for change in changes {
        match known(change, tick_s) {
            Some(mut known) => words.append(&mut known),
            None => words.push(elided(&change.set)),
        }
    }

    let count = words.len();
    let mut label = String::new();
    for (index, word) in words.into_iter().enumerate() {
        let letters = label.chars().count() + word.chars().count();
        if index > 0 && letters > MAX_LETTERS {
            label += &format!(", +{}", count - index);
            break;
        }
        if index > 0 {
            label += ", ";
        }
        label += &word;
    }
    label
}

/// What a change of one of the lists of a scenario does; `None` if it is of something else.
fn known(change: &Change, tick_s: f64) -> Option<Vec<String>> {
    let (path, list) = parse(&change.set)?;
    let before = change.before.as_deref().and_then(parse);
    let changed = Changed {
        list,
        before: before.map(|(_, list)| list),
        now: change.tick,
        tick_s,
    };

    let words = match path {
        "fault" => changed.faults()?,
        "network.partition" => changed.partitions()?,
        "network.lose" => changed.losses()?,
        _ => return None,
    };
    if !words.is_empty() {
        return Some(words);
    }
    let what = match path {
        "fault" => "faults",
        "network.partition" => "partitions",
        _ => "losses",
    };
    let how = if changed.list.is_empty() {
        format!("no {what}")
    } else {
        format!("{what} as before")
    };
    Some(vec![how])
}

/// Path and elements of a list of tables that is set; `None` if it is none.
fn parse(set: &str) -> Option<(&str, Vec<Table>)> {
    let (path, value) = set.split_once('=')?;
    let mut parsed: Table = toml::from_str(&format!("value = {value}")).ok()?;
    let Value::Array(values) = parsed.remove("value")? else {
        return None;
    };

    let mut list = Vec::new();
    for value in values {
        let Value::Table(table) = value else {
            return None;
        };
        list.push(table);
    }
    Some((path.trim(), list))
}

/// A list of a scenario that is set.
struct Changed {
    list: Vec<Table>,
    /// The list that was set before, as far as a change has set it.
    before: Option<Vec<Table>>,
    /// The tick from which on it is set.
    now: Tick,
    tick_s: f64,
}

impl Changed {
    /// What happens to processes now; if nothing does, what was added, or else removed.
    fn faults(&self) -> Option<Vec<String>> {
        let mut words = Vec::new();
        for fault in &self.list {
            let kind = text(fault, "do")?;
            let robot = text(fault, "robot")?;
            if self.tick(fault, "at")? == Some(self.now) {
                words.push(format!("{kind} {robot}"));
            } else if self.tick(fault, "until")? == Some(self.now) {
                words.push(format!("recover {robot}"));
            }
        }
        if !words.is_empty() {
            return Some(words);
        }

        for fault in self.added() {
            let kind = text(fault, "do")?;
            let robot = text(fault, "robot")?;
            words.push(format!("{kind} {robot} at {}", text(fault, "at")?));
        }
        for fault in self.before.iter().flatten() {
            if !self.list.contains(fault) && words.is_empty() {
                words.push(format!(
                    "no {} {}",
                    text(fault, "do")?,
                    text(fault, "robot")?
                ));
            }
        }
        Some(words)
    }

    /// The links that are cut and healed now; if none is, the partitions that were added.
    fn partitions(&self) -> Option<Vec<String>> {
        let before = self.before.as_ref().unwrap_or(&self.list);
        let before = self.cut_at(before, self.now.saturating_sub(1))?;
        let after = self.cut_at(&self.list, self.now)?;

        let mut words = Vec::new();
        words.extend(links("cut", after.difference(&before).cloned().collect()));
        words.extend(links("heal", before.difference(&after).cloned().collect()));
        if !words.is_empty() {
            return Some(words);
        }

        for partition in self.added() {
            let cut = links("cut", separated(partition)?);
            let until = text(partition, "until");
            let until = until.map_or(String::new(), |until| format!(" until {until}"));
            words.extend(cut.map(|cut| format!("{cut}{until}")));
        }
        Some(words)
    }

    /// The links on which further commands are lost.
    fn losses(&self) -> Option<Vec<String>> {
        let mut losing = BTreeSet::new();
        for lost in self.added() {
            losing.insert((text(lost, "from")?.to_owned(), text(lost, "to")?.to_owned()));
        }
        Some(links("lose", losing).into_iter().collect())
    }

    /// The elements that were not in the list before.
    fn added(&self) -> impl Iterator<Item = &Table> {
        let before = self.before.as_deref().unwrap_or_default();
        self.list.iter().filter(|one| !before.contains(one))
    }

    /// The links that are cut in a tick.
    fn cut_at(&self, partitions: &[Table], tick: Tick) -> Option<BTreeSet<Link>> {
        let mut cut = BTreeSet::new();
        for partition in partitions {
            let has_begun = self
                .tick(partition, "from")?
                .is_some_and(|from| from <= tick);
            let is_over = self
                .tick(partition, "until")?
                .is_some_and(|until| until <= tick);

            if has_begun && !is_over {
                cut.extend(separated(partition)?);
            }
        }

        Some(cut)
    }

    /// A time as a tick; `Some(None)` if the table does not have it.
    fn tick(&self, table: &Table, key: &str) -> Option<Option<Tick>> {
        let Some(value) = table.get(key) else {
            return Some(None);
        };

        let (number, unit) = value.as_str()?.trim().split_once(' ')?;
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

/// The links between the groups of a partition.
fn separated(partition: &Table) -> Option<BTreeSet<Link>> {
    let mut groups = Vec::new();
    for group in partition.get("groups")?.as_array()? {
        let mut names = Vec::new();
        for name in group.as_array()? {
            names.push(name.as_str()?.to_owned());
        }
        groups.push(names);
    }
    let is_one_way = partition.get("one_way").and_then(Value::as_bool);
    let is_one_way = is_one_way.unwrap_or_default();

    let mut links = BTreeSet::new();
    for (own, group) in groups.iter().enumerate() {
        for (other, others) in groups.iter().enumerate() {
            if own == other || (is_one_way && own > other) {
                continue;
            }
            for from in group {
                links.extend(others.iter().map(|to| (from.clone(), to.clone())));
            }
        }
    }
    Some(links)
}

/// What is done to links, in few words; `None` without links.
fn links(verb: &str, links: BTreeSet<Link>) -> Option<String> {
    let count = links.len();
    let mut pairs: BTreeMap<Link, &str> = BTreeMap::new();
    for (from, to) in links {
        let back = (to.clone(), from.clone());
        match pairs.get_mut(&back) {
            Some(arrow) => *arrow = "↔",
            None => {
                pairs.insert((from, to), "→");
            }
        }
    }

    match pairs.len() {
        0 => None,
        1..=MAX_LINKS => {
            let pairs = pairs.into_iter();
            let named = pairs.map(|((from, to), arrow)| format!("{from} {arrow} {to}"));
            let named: Vec<String> = named.collect();
            Some(format!("{verb} {}", named.join(", ")))
        }
        _ => Some(format!("{verb} {count} links")),
    }
}

fn text<'a>(table: &'a Table, key: &str) -> Option<&'a str> {
    table.get(key)?.as_str()
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
        let change = Change {
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
        let change = |robot: &str| Change {
            tick: 8,
            set: format!(r#"robot.{robot}.on_late="continue""#),
            before: None,
        };
        let changes = ["Butler", "Leguin", "Vonda"].map(change);
        let expected = r#"robot.Butler.on_late="continue", +2"#;
        assert_eq!(in_words(&changes, TICK_S), expected);
    }
}
