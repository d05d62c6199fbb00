//! The name of a robot or a site of a scenario file, or the names of several: `"S{1..20}"`.

use std::ops::RangeInclusive;

use protocol::RobotName;
use protocol::pattern::split_range;
use serde::{Deserialize, Serialize};

/// A name, and where it is the table of several robots, the numbers that follow it in their names.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub(super) struct BulkName {
    pub(super) name: RobotName,
    numbers: Option<RangeInclusive<usize>>,
}

impl BulkName {
    /// The numbers of the members of a table with this name and a `count`; `None` for a table that is one by itself.
    ///
    /// # Errors
    /// In words, if it says twice how many there are.
    pub(super) fn numbers(
        &self,
        count: Option<usize>,
    ) -> Result<Option<RangeInclusive<usize>>, &'static str> {
        match (&self.numbers, count) {
            (Some(_), Some(_)) => Err("the name has a range of numbers: leave `count` out"),
            (Some(numbers), None) => Ok(Some(numbers.clone())),
            (None, count) => Ok(count.map(|count| 1..=count)),
        }
    }
}

impl TryFrom<String> for BulkName {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let (name, numbers) = match split_range(&text)? {
            Some((name, numbers)) => (name, Some(numbers)),
            None => (text.as_str(), None),
        };
        let name = RobotName::new(name).map_err(|error| error.to_string())?;
        Ok(Self { name, numbers })
    }
}

impl From<BulkName> for String {
    fn from(names: BulkName) -> Self {
        match names.numbers {
            Some(numbers) => format!("{}{{{}..{}}}", names.name, numbers.start(), numbers.end()),
            None => names.name.into(),
        }
    }
}

impl From<RobotName> for BulkName {
    fn from(name: RobotName) -> Self {
        Self {
            name,
            numbers: None,
        }
    }
}
