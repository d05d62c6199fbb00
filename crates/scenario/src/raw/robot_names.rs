//! The name of a robot of a scenario file, or the names of several: `"S{1..20}"`.

use std::ops::RangeInclusive;

use config::bulk::split_range;
use protocol::RobotName;
use serde::{Deserialize, Serialize};

/// A name, and where it is the table of several robots, the numbers that follow it in their names.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub(super) struct RobotNames {
    pub(super) name: RobotName,
    pub(super) numbers: Option<RangeInclusive<usize>>,
}

impl TryFrom<String> for RobotNames {
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

impl From<RobotNames> for String {
    fn from(names: RobotNames) -> Self {
        match names.numbers {
            Some(numbers) => format!("{}{{{}..{}}}", names.name, numbers.start(), numbers.end()),
            None => names.name.into(),
        }
    }
}

impl From<RobotName> for RobotNames {
    fn from(name: RobotName) -> Self {
        Self {
            name,
            numbers: None,
        }
    }
}
