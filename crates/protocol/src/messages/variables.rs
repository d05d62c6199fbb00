//! The variables that a robot publishes about itself.

use std::fmt;
use std::ops::Index;
use std::sync::Arc;

#[cfg(test)]
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use smol_str::SmolStr;

use super::limits::{MAX_TEXT_BYTES, few, finite, short};
use crate::codec::FieldError;

/// A value that a robot publishes about itself. Numbers are one kind: 7 and 7.0 are the same value, so that robots in
/// languages that do not tell them apart give the same run.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Variable {
    /// Yes or no.
    Flag(bool),
    /// A finite number, in SI units where it has one.
    Number(f64),
    /// Text. A short one needs no memory of its own, and copies of a long one share it.
    Text(#[cfg_attr(test, schemars(with = "String"))] SmolStr),
}

/// Derived, it would be tried as one kind after the other, and an error would be written for each that it is not: this runs
/// for every variable of every robot in every tick.
impl<'de> Deserialize<'de> for Variable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(VariableVisitor)
    }
}

struct VariableVisitor;

impl Visitor<'_> for VariableVisitor {
    type Value = Variable;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a text, true or false")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Variable, E> {
        Ok(Variable::Flag(value))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Variable, E> {
        Ok(Variable::Number(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Variable, E> {
        Ok(Variable::Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Variable, E> {
        Ok(Variable::Number(value as f64))
    }

    fn visit_str<E>(self, value: &str) -> Result<Variable, E> {
        Ok(Variable::Text(SmolStr::new(value)))
    }

    fn visit_string<E>(self, value: String) -> Result<Variable, E> {
        Ok(Variable::Text(SmolStr::new(value)))
    }
}

impl From<f64> for Variable {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}
impl From<u32> for Variable {
    fn from(value: u32) -> Self {
        Self::Number(f64::from(value))
    }
}
impl From<bool> for Variable {
    fn from(value: bool) -> Self {
        Self::Flag(value)
    }
}
impl From<&str> for Variable {
    fn from(value: &str) -> Self {
        Self::Text(SmolStr::new(value))
    }
}
impl From<String> for Variable {
    fn from(value: String) -> Self {
        Self::Text(SmolStr::new(value))
    }
}

impl Variable {
    /// The number, if it is one.
    #[must_use]
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            _ => None,
        }
    }

    /// The flag, if it is one.
    #[must_use]
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Flag(value) => Some(*value),
            _ => None,
        }
    }

    /// The text, if it is one.
    #[must_use]
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::Text(value) => Some(value),
            _ => None,
        }
    }
}

impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Text(value) => f.write_str(value),
        }
    }
}

/// All that a robot chooses to publish about its inner workings, by name: the paper's hashtable.
///
/// It is decoded, copied and encoded for every robot in every tick. So it is a sorted list that copies share until one of them
/// is changed, and names of up to 23 bytes need no memory of their own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StateVariables(Arc<Vec<Entry>>);

type Entry = (SmolStr, Variable);

impl StateVariables {
    /// No variables.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The variables of entries in any order. Of several with the same name the last one counts.
    fn from_entries(mut entries: Vec<Entry>) -> Self {
        let is_sorted = entries.is_sorted_by(|(one, _), (next, _)| one.as_str() < next.as_str());
        if !is_sorted {
            entries.reverse();
            entries.sort_by(|(one, _), (other, _)| one.cmp(other));
            entries.dedup_by(|(later, _), (first, _)| later == first);
        }
        Self(Arc::new(entries))
    }

    fn position(&self, name: &str) -> Result<usize, usize> {
        self.0
            .binary_search_by(|(entry, _)| entry.as_str().cmp(name))
    }

    /// The value of a variable.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Variable> {
        let position = self.position(name).ok()?;
        Some(&self.0[position].1)
    }

    /// Sets a variable. Returns the value that it had.
    pub fn insert(&mut self, name: impl AsRef<str>, value: Variable) -> Option<Variable> {
        let name = name.as_ref();
        let position = self.position(name);
        let entries = Arc::make_mut(&mut self.0);
        match position {
            Ok(position) => Some(std::mem::replace(&mut entries[position].1, value)),
            Err(position) => {
                entries.insert(position, (SmolStr::new(name), value));
                None
            }
        }
    }

    /// Adds variables whose names are in alphabetical order, as fast as copying both. Of two with the same name the added one
    /// counts.
    #[must_use]
    pub fn with(self, added: impl IntoIterator<Item = (&'static str, Variable)>) -> Self {
        let added = added.into_iter();
        let mut entries = Vec::with_capacity(self.len() + added.size_hint().1.unwrap_or(USUAL));
        let mut own = Arc::unwrap_or_clone(self.0).into_iter().peekable();

        let mut is_sorted = true;
        let mut before = None;
        for (name, value) in added {
            is_sorted &= before < Some(name);
            before = Some(name);
            while let Some(entry) = own.next_if(|(entry, _)| entry.as_str() < name) {
                entries.push(entry);
            }
            let _replaced = own.next_if(|(entry, _)| entry.as_str() == name);
            entries.push((SmolStr::new_static(name), value));
        }
        entries.extend(own);

        if is_sorted {
            Self(Arc::new(entries))
        } else {
            Self::from_entries(entries)
        }
    }

    /// Keeps the variables for which `is_kept` returns true. It is called once for each, in the order of the names.
    pub fn retain(&mut self, mut is_kept: impl FnMut(&str, &Variable) -> bool) {
        // Where all are kept, nothing is copied.
        let dropped = self.iter().position(|(name, value)| !is_kept(name, value));
        let Some(first) = dropped else { return };

        let mut index = 0;
        Arc::make_mut(&mut self.0).retain(|(name, value)| {
            let at = index;
            index += 1;
            at < first || (at > first && is_kept(name, value))
        });
    }

    /// Names and values, in the order of the names.
    pub fn iter(&self) -> Iter<'_> {
        self.into_iter()
    }

    /// How many variables there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Index<&str> for StateVariables {
    type Output = Variable;

    /// The value of a variable that is known to be published.
    fn index(&self, name: &str) -> &Variable {
        let value = self.get(name);
        value.unwrap_or_else(|| panic!("no state variable is called {name}"))
    }
}

/// Names and values, in the order of the names.
#[derive(Debug, Clone)]
pub struct Iter<'a>(std::slice::Iter<'a, Entry>);

impl<'a> Iterator for Iter<'a> {
    type Item = (&'a str, &'a Variable);

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next().map(|(name, value)| (name.as_str(), value))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.0.size_hint()
    }
}

impl<'a> IntoIterator for &'a StateVariables {
    type Item = (&'a str, &'a Variable);
    type IntoIter = Iter<'a>;

    fn into_iter(self) -> Iter<'a> {
        Iter(self.0.iter())
    }
}

impl<N: AsRef<str>> FromIterator<(N, Variable)> for StateVariables {
    fn from_iter<I: IntoIterator<Item = (N, Variable)>>(entries: I) -> Self {
        let entries = entries.into_iter();
        Self::from_entries(
            entries
                .map(|(name, value)| (SmolStr::new(name), value))
                .collect(),
        )
    }
}

impl<N: AsRef<str>, const COUNT: usize> From<[(N, Variable); COUNT]> for StateVariables {
    fn from(entries: [(N, Variable); COUNT]) -> Self {
        entries.into_iter().collect()
    }
}

impl Serialize for StateVariables {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self)
    }
}

impl<'de> Deserialize<'de> for StateVariables {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(EntriesVisitor)
    }
}

struct EntriesVisitor;

impl<'de> Visitor<'de> for EntriesVisitor {
    type Value = StateVariables;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<StateVariables, A::Error> {
        let mut entries = Vec::with_capacity(USUAL);
        while let Some(entry) = map.next_entry::<SmolStr, Variable>()? {
            entries.push(entry);
        }
        Ok(StateVariables::from_entries(entries))
    }
}

/// Room for what robots usually publish.
const USUAL: usize = 32;

#[cfg(test)]
impl JsonSchema for StateVariables {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "StateVariables".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        std::collections::BTreeMap::<String, Variable>::json_schema(generator)
    }
}

pub(super) fn check_variables(variables: &StateVariables) -> Result<(), FieldError> {
    few(variables.len(), "state_variables")?;

    for (name, value) in variables {
        short(name, "state_variables")?;
        match value {
            // The path is formatted only for a value that is wrong: this runs for every report.
            Variable::Number(number) if !number.is_finite() => {
                finite(*number, &format!("state_variables.{name}"))?;
            }
            Variable::Text(text) if text.len() > MAX_TEXT_BYTES => {
                short(text, &format!("state_variables.{name}"))?;
            }
            _ => {}
        }
    }

    Ok(())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    fn variables(entries: &[(&str, f64)]) -> StateVariables {
        let entries = entries.iter();
        entries
            .map(|(name, value)| (*name, Variable::Number(*value)))
            .collect()
    }

    #[test]
    fn retain_asks_once_for_each() {
        for dropped in [
            &[][..],
            &["a"],
            &["c"],
            &["a", "b"],
            &["b", "d"],
            &["a", "b", "c", "d"],
        ] {
            let mut kept = variables(&[("a", 1.0), ("b", 2.0), ("c", 3.0), ("d", 4.0)]);
            let mut asked = String::new();
            kept.retain(|name, _| {
                asked += name;
                !dropped.contains(&name)
            });
            assert_eq!(asked, "abcd", "{dropped:?}");
            let names: Vec<&str> = kept.iter().map(|(name, _)| name).collect();
            let mut expected = vec!["a", "b", "c", "d"];
            expected.retain(|name| !dropped.contains(name));
            assert_eq!(names, expected);
        }
    }

    #[test]
    fn added_variables_are_merged() {
        let own = variables(&[("b", 2.0), ("d", 4.0)]);
        let copy = own.clone();
        let number = Variable::Number;

        let added = [("a", number(1.0)), ("b", number(9.0)), ("e", number(5.0))];
        let expected = variables(&[("a", 1.0), ("b", 9.0), ("d", 4.0), ("e", 5.0)]);
        assert_eq!(own.with(added), expected);
        assert_eq!(copy, variables(&[("b", 2.0), ("d", 4.0)]));

        // Another order is slower, and gives the same.
        let added = [("e", number(5.0)), ("b", number(9.0)), ("a", number(1.0))];
        assert_eq!(copy.with(added), expected);
    }

    #[test]
    fn a_copy_does_not_follow_the_original() {
        let mut original = variables(&[("a", 1.0)]);
        let copy = original.clone();

        assert_eq!(original.insert("b", 2.0.into()), None);
        assert_eq!(original.insert("a", 3.0.into()), Some(1.0.into()));
        assert_eq!(copy, variables(&[("a", 1.0)]));
        assert_eq!(original, variables(&[("a", 3.0), ("b", 2.0)]));
    }

    #[test]
    fn what_is_dropped_is_dropped_in_one_place_only() {
        let mut original = variables(&[("a", 1.0), ("b", 2.0), ("c", 3.0)]);
        let copy = original.clone();

        original.retain(|name, _| name != "b");
        assert_eq!(original, variables(&[("a", 1.0), ("c", 3.0)]));
        assert_eq!(copy.len(), 3);
        assert_eq!(original.get("b"), None);
    }

    proptest! {
        /// A map of the standard library gives the same text, the same values and the same order.
        #[test]
        fn it_is_a_map(entries in proptest::collection::vec(("[a-d]{0,3}", -9.0..9.0), 0..40)) {
            let mut map = BTreeMap::new();
            let mut one_by_one = StateVariables::new();
            let mut text = String::new();
            for (name, value) in &entries {
                let value = Variable::Number(*value);
                prop_assert_eq!(one_by_one.insert(name, value.clone()), map.insert(name.clone(), value.clone()));
                let separator = if text.is_empty() { "{" } else { "," };
                text += &format!("{separator}{name:?}:{value:?}")
                    .replace("Number(", "")
                    .replace(')', "");
            }
            text += if text.is_empty() { "{}" } else { "}" };

            let at_once: StateVariables = entries
                .iter()
                .map(|(name, value)| (name, Variable::Number(*value)))
                .collect();
            let read: StateVariables = serde_json::from_str(&text).unwrap();
            prop_assert_eq!(&at_once, &one_by_one);
            prop_assert_eq!(&read, &one_by_one);
            prop_assert_eq!(serde_json::to_string(&read).unwrap(), serde_json::to_string(&map).unwrap());
            prop_assert!(read.iter().eq(map.iter().map(|(name, value)| (name.as_str(), value))));
            for (name, value) in &map {
                prop_assert_eq!(read.get(name), Some(value));
            }
        }
    }
}
