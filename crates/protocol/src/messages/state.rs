//! What robots let others know of themselves.

use serde::{Deserialize, Serialize};

use super::limits::{counted, finite, short};
use super::numbers::{Epoch, Tick};
use super::performative::Performative;
use super::point::Point;
use super::variables::{StateVariables, check_variables};
use crate::codec::{FieldError, Message, as_json, encode};
use crate::keys::STATE;

/// The answer to all six queries of the common robot interface at once: the robot as it reported itself for `tick`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    as_json!();

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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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

impl Message for Answer {
    as_json!();
}

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
