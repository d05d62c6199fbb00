//! `--set path=value`: changes to a file from the command line.

use std::path::PathBuf;

use protocol::pattern::{is_pattern, overlap, path_parts, split_range};

use crate::bulk;
use crate::diagnostic::{FileError, Source};

/// The list of the robots in a scenario file.
const ROBOTS: &str = "robot";
/// The list of the sites.
const SITES: &str = "site";
/// How many robots or sites an element is.
const COUNT: &str = "count";

/// Changes of a scenario file by the command line.
#[derive(Debug, Clone, Default)]
pub struct Changes {
    /// Seed, instead of the file's.
    pub seed: Option<u64>,
    /// Duration, instead of the file's, simulated seconds.
    pub duration_s: Option<f64>,
    /// `path=value` pairs.
    pub set: Vec<Override>,
    /// Where the runs are that the file names, instead of `runs`.
    pub runs: Option<PathBuf>,
}

/// One change: a path in the file and its new value.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    path: Vec<String>,
    value: toml::Value,
}

impl std::str::FromStr for Override {
    type Err = String;

    /// Parses `path=value`. The parts of the path are joined by `.`; an element of a list is named by its `name` or its index
    /// from 0, as in `robot.Butler.params.refiller=Vonda`, and several by a pattern, as in `robot.S*.on_late=abort` or
    /// `robot.S{2..3}.on_late=abort`. A value that is not TOML is a text.
    fn from_str(text: &str) -> Result<Self, String> {
        let (path, value) = text
            .split_once('=')
            .ok_or_else(|| format!("{text:?} is not of the form path=value"))?;
        let path = path_parts(path.trim());

        if path.iter().any(|part| part.is_empty()) {
            return Err(format!("{text:?}: a part of the path is empty"));
        }

        for part in &path {
            check_part(part)
                .map_err(|reason| format!("{text:?} is not of the form path=value: {reason}"))?;
        }

        Ok(Self::new(&path, parse_value(value)))
    }
}

fn parse_value(text: &str) -> toml::Value {
    let parsed = toml::from_str::<toml::Table>(&format!("value = {text}"));
    let value = parsed.ok().and_then(|mut table| table.remove("value"));
    value.unwrap_or_else(|| toml::Value::String(text.trim().to_owned()))
}

/// Refuses a part of a path that is neither a bare key of TOML nor a pattern of such keys. All keys of our files and all names of
/// robots are.
fn check_part(part: &str) -> Result<(), String> {
    let base = split_range(part)?.map_or(part, |(base, _)| base);
    let is_key = base
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '*'));
    is_key
        .then_some(())
        .ok_or_else(|| format!("{part:?} is not a key"))
}

/// Whether a list has elements with a count.
fn is_bulk(list: &str) -> bool {
    list == ROBOTS || list == SITES
}

fn is_index(part: &str) -> bool {
    part.chars().all(|c| c.is_ascii_digit())
}

impl std::fmt::Display for Override {
    /// Formats the change so that another process can parse it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.path.join("."), self.value)
    }
}

impl Changes {
    /// Whether there are no changes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.seed.is_none() && self.duration_s.is_none() && self.set.is_empty()
    }

    /// The text of the file with the changes.
    ///
    /// # Errors
    /// [`FileError`] if the file is not TOML, or has no place for a change.
    pub fn apply(&self, source: &Source) -> Result<Source, FileError> {
        let mut root: toml::Table = source.parse()?;
        // First how many robots there are, and then what single ones of them are given.
        let (counts, others): (Vec<_>, Vec<_>) =
            self.set.iter().partition(|change| change.is_count());
        for change in counts.into_iter().chain(others) {
            root = change
                .apply(root)
                .map_err(|reason| FileError::new(format!("cannot set {reason}")))?;
        }

        if let Some(seed) = self.seed {
            let seed = i64::try_from(seed).unwrap_or(i64::MAX);
            root.insert("seed".to_owned(), toml::Value::Integer(seed));
        }
        if let Some(duration_s) = self.duration_s {
            let duration = toml::Value::String(format!("{duration_s} s"));
            root.insert("duration".to_owned(), duration);
        }

        let text = toml::to_string(&root).map_err(|error| FileError::new(error.to_string()))?;
        Ok(Source {
            name: format!("{} (with the command line's changes)", source.name),
            text,
        })
    }
}

impl Override {
    /// A change of the value at a path.
    #[must_use]
    pub fn new(path: &[&str], value: toml::Value) -> Self {
        Self {
            path: path.iter().map(|part| (*part).to_owned()).collect(),
            value,
        }
    }

    /// Whether both set the value at the same path.
    #[must_use]
    pub fn has_path_of(&self, other: &Self) -> bool {
        self.path == other.path
    }

    /// First part of the path: the key at the top of the file.
    #[must_use]
    pub fn top(&self) -> &str {
        self.path.first().map_or("", String::as_str)
    }

    /// Whether both set the same value, or one sets a part of what the other sets. A list's element that one names and the
    /// other numbers counts as the same, because only the file decides that, and so do patterns that can match the same name.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        let mut parts = self.path.iter().zip(&other.path);
        parts.all(|(own, others)| overlap(own, others) || is_index(own) != is_index(others))
    }

    /// Whether its value is a table that replaces single keys of the one that is there: so it is among the parameters of robots, which
    /// a scenario may have from a file.
    #[must_use]
    pub fn merges(&self) -> bool {
        let is_among_parameters =
            self.top() == ROBOTS && self.path.get(2).is_some_and(|part| part == "params");
        is_among_parameters && self.value.is_table()
    }

    /// Whether it sets the value at a path that ends with these keys, by itself or with the table around it.
    #[must_use]
    pub fn sets(&self, keys: &[&str]) -> bool {
        (0..=keys.len()).any(|known| {
            let (above, within) = keys.split_at(known);
            let is_there =
                self.path.len() >= known && self.path[self.path.len() - known..] == *above;
            let value = within
                .iter()
                .try_fold(&self.value, |value, key| value.get(key));
            is_there && value.is_some()
        })
    }

    /// Whether it sets how many robots or sites there are of a kind.
    fn is_count(&self) -> bool {
        matches!(&self.path[..], [list, _, count] if is_bulk(list) && count == COUNT)
    }

    /// The content of a file with the change.
    ///
    /// # Errors
    /// The path, and why there is no place for it.
    pub fn apply(&self, table: toml::Table) -> Result<toml::Table, String> {
        let mut root = toml::Value::Table(table);
        if let [list, names, ..] = &self.path[..]
            && is_bulk(list)
            && let Some(elements) = root.get_mut(list).and_then(toml::Value::as_array_mut)
        {
            if self.is_count() {
                bulk::count_ranges(elements, names)
                    .map_err(|reason| format!("{}: {reason}", self.path.join(".")))?;
            } else {
                bulk::separate(elements, list == ROBOTS, names);
            }
        }
        set(&mut root, &self.path, &self.value, self.merges())
            .map_err(|reason| format!("{}: {reason}", self.path.join(".")))?;
        match root {
            toml::Value::Table(table) => Ok(table),
            _ => unreachable!("a path has at least one part, so the root stays a table"),
        }
    }
}

/// Replaces the values of a table that another one has, key by key, also within tables.
pub fn merge(table: &mut toml::Table, by: &toml::Table) {
    for (key, value) in by {
        match (table.get_mut(key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(by)) => merge(inner, by),
            _ => drop(table.insert(key.clone(), value.clone())),
        }
    }
}

fn set(
    at: &mut toml::Value,
    path: &[String],
    value: &toml::Value,
    merges: bool,
) -> Result<(), String> {
    let Some((first, rest)) = path.split_first() else {
        *at = value.clone();
        return Ok(());
    };

    let next = match at {
        toml::Value::Table(_) if is_pattern(first) => {
            return Err(format!(
                "{first:?} is a pattern, which stands for elements of a list"
            ));
        }
        toml::Value::Table(table) if rest.is_empty() => {
            match (table.get_mut(first), value) {
                (Some(toml::Value::Table(inner)), toml::Value::Table(by)) if merges => {
                    merge(inner, by);
                }
                _ => drop(table.insert(first.clone(), value.clone())),
            }
            return Ok(());
        }
        toml::Value::Table(table) => table
            .entry(first.clone())
            .or_insert_with(|| toml::Value::Table(toml::Table::new())),
        toml::Value::Array(list) if is_pattern(first) => {
            for element in matching(list, first)? {
                set(element, rest, value, merges)?;
            }
            return Ok(());
        }
        toml::Value::Array(list) => element(list, first)?,
        _ => {
            return Err(format!(
                "there is nothing below {first:?}: it is a single value"
            ));
        }
    };

    set(next, rest, value, merges)
}

/// The elements of a list whose names match a pattern.
fn matching<'a>(
    list: &'a mut [toml::Value],
    pattern: &str,
) -> Result<Vec<&'a mut toml::Value>, String> {
    let len = list.len();
    let found: Vec<_> = list
        .iter_mut()
        .filter(|element| bulk::matches(element, pattern))
        .collect();
    if found.is_empty() {
        return Err(format!(
            "none of the {len} elements has a name that matches {pattern:?}"
        ));
    }
    Ok(found)
}

fn element<'a>(list: &'a mut [toml::Value], which: &str) -> Result<&'a mut toml::Value, String> {
    let named = list
        .iter()
        .position(|value| bulk::name(value) == Some(which));
    let index = named.or_else(|| which.parse().ok());

    let len = list.len();
    let found = index.and_then(|index| list.get_mut(index));
    found.ok_or_else(|| format!("none of the {len} elements is called or numbered {which:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_replaces_single_keys_of_parameters_and_all_of_other_tables() {
        let file = "[network]\ncommands = { loss = 0.1 }\n[[robot]]\nname = \"A\"\nparams = { a = 1, b = { c = 2, d = 3 } }\n";
        for (change, expected) in [
            (
                "robot.A.params.b={c=9}",
                "params = { a = 1, b = { c = 9, d = 3 } }",
            ),
            (
                "robot.A.params={b={d=9}, e=4}",
                "params = { a = 1, b = { c = 2, d = 9 }, e = 4 }",
            ),
            (
                "robot.0.params.b.c=9",
                "params = { a = 1, b = { c = 9, d = 3 } }",
            ),
            ("robot.A.params.b=9", "params = { a = 1, b = 9 }"),
        ] {
            let change: Override = change.parse().unwrap();
            let changed = change.apply(file.parse().unwrap()).unwrap();
            let expected: toml::Table = expected.parse().unwrap();
            assert_eq!(
                changed["robot"][0]["params"], expected["params"],
                "{change}"
            );
        }

        let change: Override = "network.commands={ delay = 1 }".parse().unwrap();
        let changed = change.apply(file.parse().unwrap()).unwrap();
        assert_eq!(changed["network"]["commands"].as_table().unwrap().len(), 1);
    }

    #[test]
    fn a_pattern_sets_the_value_of_each_element_that_it_matches() {
        let file = "[guests]\ncount = 1\n[[robot]]\nname = \"S1\"\n[[robot]]\nname = \"S2\"\n[[robot]]\nname = \"T\"\n";
        let change: Override = "robot.S*.params.k=2".parse().unwrap();
        let changed = change.apply(file.parse().unwrap()).unwrap();
        let given = |index: usize| changed["robot"][index].get("params").is_some();
        assert_eq!([given(0), given(1), given(2)], [true, true, false]);

        let change: Override = "robot.S{2..3}.params.k=2".parse().unwrap();
        assert_eq!(change.to_string().parse(), Ok(change.clone()));
        let changed = change.apply(file.parse().unwrap()).unwrap();
        let given = |index: usize| changed["robot"][index].get("params").is_some();
        assert_eq!([given(0), given(1), given(2)], [false, true, false]);
        for wrong in [
            "robot.S{3..2}.k=1",
            "robot.S{2..3.k=1",
            "robot.S{2..3}x.k=1",
        ] {
            let error = wrong.parse::<Override>().unwrap_err();
            assert!(error.contains("range"), "{error}");
        }

        for (change, reason) in [
            (
                "robot.X*.params.k=2",
                "none of the 3 elements has a name that matches \"X*\"",
            ),
            ("guests.c*=2", "\"c*\" is a pattern"),
            ("g*.count=2", "\"g*\" is a pattern"),
        ] {
            let change: Override = change.parse().unwrap();
            let error = change.apply(file.parse().unwrap()).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn changes_overlap_where_one_may_set_what_the_other_sets() {
        for (one, other, overlaps) in [
            ("guests.count=1", "guests.count=2", true),
            ("guests={}", "guests.count=2", true),
            ("guests.count=1", "guests.speed=2", false),
            ("robot.Butler.params.x=1", "robot.0.params.x=1", true),
            ("robot.Butler.params.x=1", "robot.Leguin.params.x=1", false),
            ("robot.1.params.x=1", "robot.0.params.x=1", false),
            ("robot.S*.params.x=1", "robot.S1.params.x=1", true),
            ("robot.S*.params.x=1", "robot.0.params.x=1", true),
            ("robot.S*.params.x=1", "robot.*1.params.x=1", true),
            ("robot.S*.params.x=1", "robot.Butler.params.x=1", false),
            ("robot.S*.params.x=1", "robot.S.count=1", false),
            ("robot.S{2..3}.params.x=1", "robot.S3.params.x=1", true),
            ("robot.S{2..3}.params.x=1", "robot.S4.params.x=1", false),
        ] {
            let one: Override = one.parse().unwrap();
            let other: Override = other.parse().unwrap();
            assert_eq!(one.overlaps(&other), overlaps, "{one} and {other}");
            assert_eq!(other.overlaps(&one), overlaps, "{other} and {one}");
        }
    }
}
