//! Simulator and robots to observers: the picture, the log, the panels. Nothing here takes part in a tick.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Awaited, Epoch, Phase, Point, Tick, finite, short};
use crate::codec::Message;
use crate::name::{RobotName, RunName};

/// The field at a moment, published at a display rate while somebody watches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorldFrame {
    /// The run.
    pub run: RunName,
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Simulated time at which the run ends, seconds.
    pub duration_s: f64,
    /// What the simulator is doing.
    pub phase: Phase,
    /// For whom the clock waits; empty when it does not.
    pub awaiting: Vec<Awaited>,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// The robots, by name.
    pub robots: Vec<RobotFrame>,
    /// Centers of the guests, meters.
    pub guests: Vec<[f64; 2]>,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<[f64; 2]>,
}

impl Message for WorldFrame {}

/// A robot in a [`WorldFrame`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobotFrame {
    /// Who.
    pub name: RobotName,
    /// Where.
    pub location: Point,
    /// Whether its last move was refused.
    pub blocked: bool,
    /// Its emotion state.
    pub emotion_state: String,
    /// Its behavior state.
    pub behavior_state: String,
}

/// One line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogRecord {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// A robot's name, or `simulator`.
    pub source: String,
    /// What kind of line it is.
    pub kind: LogKind,
    /// The line.
    pub text: String,
}

impl Message for LogRecord {
    fn check(&self) -> Result<(), (String, String)> {
        short(&self.source, "source")?;
        short(&self.text, "text")
    }
}

/// Kinds of log lines, to filter by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LogKind {
    /// Init, start, pause, stop, end.
    Run,
    /// A robot joined, was lost, came back.
    Membership,
    /// An emotion changed.
    Emotion,
    /// A behavior changed.
    Behavior,
    /// A command was sent, delivered, dropped or is missing.
    Command,
    /// A robot said something.
    Say,
    /// The clock waits; wall-clock matter, not part of the run's record.
    Late,
}

/// What a robot chooses to display: data, not code.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Panel {
    /// The widgets, from top to bottom.
    pub widgets: Vec<Widget>,
}

/// Most widgets of a panel.
pub const MAX_WIDGETS: usize = 64;

impl Message for Panel {
    fn check(&self) -> Result<(), (String, String)> {
        if self.widgets.len() > MAX_WIDGETS {
            let reason = format!("{} widgets, more than the {MAX_WIDGETS} allowed", self.widgets.len());
            return Err(("widgets".to_owned(), reason));
        }
        self.widgets.iter().enumerate().try_for_each(|(i, widget)| widget.check(&format!("widgets[{i}]")))
    }
}

/// One element of a panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "widget", rename_all = "snake_case")]
pub enum Widget {
    /// A labeled line of text.
    Text {
        /// What it is.
        label: String,
        /// What it says.
        text: String,
    },
    /// A state, set off from the rest.
    Badge {
        /// What it is.
        label: String,
        /// The state.
        text: String,
        /// How it is meant.
        tone: Tone,
    },
    /// A quantity within bounds.
    Bar {
        /// What it is.
        label: String,
        /// The quantity.
        value: f64,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// A facial expression (seed: stored facial expressions).
    Face {
        /// The expression.
        face: Face,
        /// How strong, 0 to 1.
        intensity: f64,
    },
    /// A small curve of recent values.
    Sparkline {
        /// What it is.
        label: String,
        /// The values, oldest first.
        values: Vec<f64>,
    },
    /// Rows of text.
    Table {
        /// The rows.
        rows: Vec<Vec<String>>,
    },
    /// A picture; shown as an image, so that nothing in it runs.
    Svg {
        /// What it shows, for those who do not see it.
        label: String,
        /// The document.
        svg: String,
    },
    /// Sends the robot a command.
    Button {
        /// What it says.
        label: String,
        /// The command.
        command: String,
    },
}

impl Widget {
    fn check(&self, field: &str) -> Result<(), (String, String)> {
        match self {
            Self::Text { label, text } | Self::Badge { label, text, .. } => {
                short(label, &format!("{field}.label"))?;
                short(text, &format!("{field}.text"))
            }
            Self::Bar { label, value, min, max } => {
                short(label, &format!("{field}.label"))?;
                finite(*value, &format!("{field}.value"))?;
                finite(*min, &format!("{field}.min"))?;
                finite(*max, &format!("{field}.max"))
            }
            Self::Face { intensity, .. } => finite(*intensity, &format!("{field}.intensity")),
            Self::Sparkline { label, values } => {
                super::few(values.len(), &format!("{field}.values"))?;
                short(label, &format!("{field}.label"))?;
                values.iter().try_for_each(|value| finite(*value, &format!("{field}.values")))
            }
            Self::Table { rows } => {
                super::few(rows.iter().map(Vec::len).sum(), &format!("{field}.rows"))?;
                rows.iter().flatten().try_for_each(|cell| short(cell, &format!("{field}.rows")))
            }
            // The size of a picture is bounded by that of a message.
            Self::Svg { label, .. } => short(label, &format!("{field}.label")),
            Self::Button { label, command } => {
                short(label, &format!("{field}.label"))?;
                short(command, &format!("{field}.command"))
            }
        }
    }
}

/// How a badge is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// All is well.
    Good,
    /// Nothing special.
    Neutral,
    /// Watch out.
    Warning,
    /// Something is wrong.
    Bad,
}

/// The facial expressions of the seed ("Emotion Components").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the words are the seed's and say what they are")]
pub enum Face {
    Happy,
    Sad,
    Surprised,
    Disgusted,
    Angry,
    Fearful,
    Neutral,
}
