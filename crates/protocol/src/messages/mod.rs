//! The messages, one module for each pair of participants.

mod control;
mod observe;
mod state;
mod step;

use std::collections::BTreeMap;

pub use crate::codec::FieldError;
pub use control::{
    Awaited, Control, ControlAnswer, FaultKind, FaultOrder, LogFile, OnLate, Phase, ProcessOrder,
    Range, Reason, RobotStatus, Setup, SetupAnswer, Status,
};
pub use observe::{
    Cut, Face, Fate, Flight, LogKind, LogRecord, MAX_FLIGHTS, MAX_WIDGETS, Panel, Presence,
    RecordedRobot, RecordedTick, RecordingHeader, RobotFrame, Tone, Widget, WorldFrame,
};
pub use state::{Answer, PublicState, StateVariables, Variable};
pub use step::{
    Clock, Command, CommandText, Correction, Delivery, End, JoinAnswer, JoinRequest, NEWS_FLAGS,
    News, Performative, Refusal, Report, SensedBody, SensedKind, SensedRobot, Waiting, Welcome,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Index of a simulation step. Tick 0 is the initial state.
pub type Tick = u64;
/// Number of an execution within a run, from 1; `init` starts the next one.
pub type Epoch = u32;
/// Number of a robot's incarnation, from 1; a robot that comes back has a higher one.
pub type Generation = u32;
/// Number of a command in the record, among those of its sender in an epoch, from 1. The simulator counts.
pub type Seq = u64;

/// Robot parameters as they travel: whatever the scenario says of the robot, lengths and times already in SI units.
pub type Parameters = BTreeMap<String, serde_json::Value>;

/// A place on the field: meters from its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Point {
    /// Meters to the right.
    pub x: f64,
    /// Meters up.
    pub y: f64,
}

impl Point {
    /// The place at `x`, `y` meters.
    #[must_use]
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Straight distance, meters.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        (dx * dx + dy * dy).sqrt()
    }

    fn check(self, field: &str) -> Result<(), FieldError> {
        finite(self.x, &format!("{field}.x"))?;
        finite(self.y, &format!("{field}.y"))
    }
}

/// Longest text in a message, in bytes: a command, a state's name, a log line.
pub const MAX_TEXT_BYTES: usize = 4096;
/// Most entries of any list or map in a message.
pub const MAX_ENTRIES: usize = 1024;

fn finite(value: f64, field: &str) -> Result<(), FieldError> {
    if value.is_finite() {
        return Ok(());
    }

    Err(FieldError::new(field, "not a finite number"))
}

/// Ticks stay below 2^53, so that every language can hold them and add to them exactly.
fn counted(tick: Tick, field: &str) -> Result<(), FieldError> {
    if tick < 1 << 53 {
        return Ok(());
    }

    Err(FieldError::new(field, "not below 2^53"))
}

fn short(text: &str, field: &str) -> Result<(), FieldError> {
    if text.len() <= MAX_TEXT_BYTES {
        return Ok(());
    }

    let reason = format!(
        "{} bytes of text, more than the {MAX_TEXT_BYTES} allowed",
        text.len()
    );
    Err(FieldError::new(field, reason))
}

fn few(len: usize, field: &str) -> Result<(), FieldError> {
    if len <= MAX_ENTRIES {
        return Ok(());
    }

    let reason = format!("{len} entries, more than the {MAX_ENTRIES} allowed");
    Err(FieldError::new(field, reason))
}

fn is_false(flag: &bool) -> bool {
    !*flag
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}
