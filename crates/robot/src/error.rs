//! Why a robot cannot take part, or cannot go on.

use protocol::messages::Parameters;
use protocol::wording::without_type_names;
use protocol::{RobotName, Tick};
use serde::de::DeserializeOwned;

/// Parameters that a robot cannot work with.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("parameters of {robot}: {reason}")]
pub struct BadParameters {
    /// The robot that refuses them.
    pub robot: RobotName,
    /// What is wrong with them.
    pub reason: String,
}

/// Checks parameters, without a robot that has them.
pub type ParametersCheck = fn(&Parameters) -> Result<(), String>;

/// Reads parameters as a robot's own type: numbers in SI units.
///
/// # Errors
/// In words, which parameter is wrong or unknown.
pub fn read_parameters<P: DeserializeOwned>(parameters: &Parameters) -> Result<P, String> {
    let map = parameters.clone().into_iter().collect();
    serde_path_to_error::deserialize(serde_json::Value::Object(map)).map_err(|error| {
        let reason = without_type_names(&error.inner().to_string());
        match error.path().to_string() {
            path if path == "." => reason,
            path => format!("{path}: {reason}"),
        }
    })
}

/// Why a robot leaves the run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RobotError {
    /// It refuses its parameters.
    #[error(transparent)]
    Parameters(#[from] BadParameters),
    /// It gave up during a tick ([`crate::Cars::give_up`]).
    #[error("{robot} gives up: {reason}")]
    GaveUp {
        /// The robot.
        robot: RobotName,
        /// The reason it gave.
        reason: String,
    },
    /// Its report exceeds the limits of a message.
    #[error("{robot} says too much: {field}: {reason}")]
    TooMuch {
        /// The robot.
        robot: RobotName,
        /// The field of its report.
        field: String,
        /// Which limit the field exceeds.
        reason: String,
    },
    /// Robots of this process do not report a tick: a record that is executed again lets robots take part that cannot.
    #[error("no report of {robots} for tick {tick}, in which the record lets it take part")]
    NoReport {
        /// The robots, as a list.
        robots: String,
        /// The tick.
        tick: Tick,
    },
}
