//! What robots let others know of themselves.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize};

use super::limits::{MAX_TEXT_BYTES, counted, few, finite, short};
use super::numbers::{Epoch, Tick};
use super::performative::Performative;
use super::point::Point;
use crate::codec::{FieldError, Message, encode};
use crate::keys::STATE;

/// A value that a robot publishes about itself. Numbers are one kind: 7 and 7.0 are the same value, so that robots in
/// languages that do not tell them apart give the same run.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Variable {
    /// Yes or no.
    Flag(bool),
    /// A finite number, in SI units where it has one.
    Number(f64),
    /// Text.
    Text(String),
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
        Ok(Variable::Text(value.to_owned()))
    }

    fn visit_string<E>(self, value: String) -> Result<Variable, E> {
        Ok(Variable::Text(value))
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
        Self::Text(value.to_owned())
    }
}
impl From<String> for Variable {
    fn from(value: String) -> Self {
        Self::Text(value)
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

/// All that a robot chooses to publish about its inner workings: the seed's hashtable.
pub type StateVariables = BTreeMap<String, Variable>;

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

/// The answer to all six queries of the common robot interface at once: the robot as it reported itself for `tick`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PublicState {
    /// Epoch of the report.
    pub epoch: Epoch,
    /// Tick of the report.
    pub tick: Tick,
    /// Where it stood, meters.
    pub location: Point,
    /// Magnitude of its velocity, m/s.
    pub speed_mps: f64,
    /// Direction of motion, radians counter-clockwise from +x, in (-pi, pi].
    pub direction_rad: f64,
    /// The variables it publishes.
    pub state_variables: StateVariables,
    /// Its emotion state.
    pub emotion_state: String,
    /// Its behavior state.
    pub behavior_state: String,
}

impl Message for PublicState {
    fn check(&self) -> Result<(), FieldError> {
        counted(self.tick, "tick")?;
        self.location.check("location")?;
        finite(self.speed_mps, "speed_mps")?;
        finite(self.direction_rad, "direction_rad")?;
        short(&self.emotion_state, "emotion_state")?;
        short(&self.behavior_state, "behavior_state")?;
        check_variables(&self.state_variables)
    }
}

/// The answer to one of the six queries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Answer {
    /// That it is an answer: always `tell`.
    #[serde(default = "tell")]
    pub performative: Performative,
    /// Epoch of the report it is taken from.
    pub epoch: Epoch,
    /// Tick of the report it is taken from.
    pub tick: Tick,
    /// What was asked for: a point, a number, a map of variables or a text.
    pub value: serde_json::Value,
}

fn tell() -> Performative {
    Performative::Tell
}

impl Message for Answer {}

impl PublicState {
    /// The reply to the query called `what` ([`crate::keys::QUERIES`] or [`STATE`]), encoded; `None` if there is no such query.
    #[must_use]
    pub fn reply(&self, what: &str) -> Option<Vec<u8>> {
        if what == STATE {
            return Some(encode(self));
        }
        Some(encode(&self.answer(what)?))
    }

    /// The answer to the query called `what` ([`crate::keys::QUERIES`]); `None` if there is no such query.
    #[must_use]
    pub fn answer(&self, what: &str) -> Option<Answer> {
        let value = match what {
            "location" => serde_json::json!(self.location),
            "speed" => self.speed_mps.into(),
            "direction" => self.direction_rad.into(),
            "state_variables" => serde_json::json!(self.state_variables),
            "emotion_state" => self.emotion_state.clone().into(),
            "behavior_state" => self.behavior_state.clone().into(),
            _ => return None,
        };
        Some(Answer {
            performative: Performative::Tell,
            epoch: self.epoch,
            tick: self.tick,
            value,
        })
    }
}
