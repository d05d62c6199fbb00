//! For whom a command is.

use std::fmt;

#[cfg(test)]
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::name::RobotName;

/// How all other robots of the roster are written.
pub const OTHERS: &str = "*";

/// For whom a command is: one robot, or all others.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Target {
    /// This robot.
    Robot(RobotName),
    /// Every other robot of the roster: a broadcast, written `*`.
    Others,
}

impl Target {
    /// The target that a text means; `None` if it is neither `*` nor a name that a robot can have.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        if text == OTHERS {
            return Some(Self::Others);
        }
        RobotName::new(text).ok().map(Self::Robot)
    }

    /// How it is written.
    #[must_use]
    pub fn as_str(&self) -> &str {
        match self {
            Self::Robot(name) => name.as_str(),
            Self::Others => OTHERS,
        }
    }
}

impl From<RobotName> for Target {
    fn from(name: RobotName) -> Self {
        Self::Robot(name)
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Serialize for Target {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for Target {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        if text == OTHERS {
            return Ok(Self::Others);
        }
        RobotName::new(&text)
            .map(Self::Robot)
            .map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
impl JsonSchema for Target {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Target".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "For whom a command is: the name of a robot, or * for every other robot of the roster.",
            "type": "string",
        })
    }
}
