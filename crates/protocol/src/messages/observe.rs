//! Simulator and robots to observers: the picture, the log, the panels. Nothing here takes part in a tick.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use smol_str::SmolStr;

use super::control::{Awaited, FaultKind, Phase, Presence};
use super::layer::LayerFrame;
use super::limits::{counted, few, finite, is_zero, short};
use super::numbers::{Epoch, Generation, Seq, Tick};
use super::point::Point;
use super::site::SiteFrame;
use super::static_world::StaticWorld;
use super::variables::StateVariables;
use crate::codec::{FieldError, Message, as_json};
use crate::name::{RobotName, RunName};

/// The field at a moment, published at a display rate while there are subscribers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Seed of the epoch.
    pub seed: u64,
    /// The recorded run of which this is a replay; none in a run in progress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replay_of: Option<RunName>,
    /// How often a replay has been moved to another tick so far; 0 in a run in progress. With each move, observers forget what
    /// they know of commands: `flights` then has all that is under way.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub jumps: u32,
    /// Real-time factor; `null` is as fast as the barrier goes.
    pub speed: Option<f64>,
    /// What the simulator is doing.
    pub phase: Phase,
    /// For whom the clock waits; empty when it does not.
    pub awaiting: Vec<Awaited>,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// In what people are shown lengths and speeds, unless they choose another unit.
    #[serde(default)]
    pub display_unit: DisplayUnit,
    /// The robots, by name.
    pub robots: Vec<RobotFrame>,
    /// Centers of the guests, meters.
    pub guests: Vec<[f64; 2]>,
    /// The number of each of them, which it keeps; left out where guests do not enter and leave: then they are counted from 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub guest_numbers: Vec<u32>,
    /// Guests that are not content, by their index in `guests`, by mood.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub guest_moods: BTreeMap<GuestMood, Vec<u32>>,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<[f64; 2]>,
    /// What does not change in an epoch: in its first frame, once a second, and in all frames while the clock stands. Without it,
    /// what the frames before had in this epoch still holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_world: Option<StaticWorld>,
    /// The sites, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<SiteFrame>,
    /// The layers, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerFrame>,
    /// Commands that were sent, or whose fate was decided, since the frame before; the newest [`MAX_FLIGHTS`] of them.
    #[serde(default)]
    pub flights: Vec<Flight>,
    /// Pairs of robots between which the medium lets nothing through now.
    #[serde(default)]
    pub cuts: Vec<Cut>,
    /// Robots whose processes a fault holds now, because the scenario or a person wants it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<HeldProcess>,
    /// How the expectations of the scenario stand, in its order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expectations: Vec<Standing>,
    /// The numbers that the measures of the scenario have up to the tick, by name. One that has none yet is left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, f64>,
}

/// How a guest feels about what it asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GuestMood {
    /// It has not asked for anything, or got it.
    Content,
    /// It asked in vain.
    Waiting,
    /// It has waited for longer than its patience lasts.
    Annoyed,
}

/// A unit of length in which people are shown a run. All messages and records are in meters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub enum DisplayUnit {
    /// Meters.
    #[default]
    #[serde(rename = "m")]
    Meters,
    /// International feet, 0.3048 m.
    #[serde(rename = "ft")]
    Feet,
}

/// Most commands that one frame shows.
pub const MAX_FLIGHTS: usize = 256;

/// A command on its way, as observers see it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Flight {
    /// Tick of what is told here.
    pub tick: Tick,
    /// Who sent it.
    pub from: RobotName,
    /// To whom.
    pub to: RobotName,
    /// Its number among the sender's.
    pub seq: Seq,
    /// What it says; only where it was sent just now.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// What became of it.
    pub fate: Fate,
    /// Why the medium lost it, in words; only where it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It was sent and is on its way.
    Sent,
    /// It reached its target.
    Delivered,
    /// The medium lost it.
    Dropped,
}

/// A link that the medium has cut, one way.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cut {
    /// Who cannot reach the other.
    pub from: RobotName,
    /// The other.
    pub to: RobotName,
    /// Whether commands are cut.
    pub commands: bool,
    /// Whether queries are cut.
    pub queries: bool,
}

/// A robot whose process a fault holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HeldProcess {
    /// Whose.
    pub robot: RobotName,
    /// Which fault.
    pub kind: FaultKind,
}

/// Whether a run has done what is expected of it. The worse is the greater: a run passes if one expectation does and no other one
/// fails or is undecided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// What should be seen in some run was not seen in this one.
    Unreached,
    /// What it is expected after did not happen.
    NotAsked,
    /// It has.
    Pass,
    /// The run ended before that was certain.
    Undecided,
    /// It has not.
    Fail,
}

impl Verdict {
    /// The word for it, as in the record.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Unreached => "unreached",
            Self::NotAsked => "not_asked",
            Self::Pass => "pass",
            Self::Undecided => "undecided",
            Self::Fail => "fail",
        }
    }

    /// The exit status of a program that has played or judged the run.
    #[must_use]
    pub fn exit_status(self) -> u8 {
        match self {
            Self::Pass | Self::NotAsked | Self::Unreached => 0,
            Self::Fail => 1,
            Self::Undecided => 2,
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotAsked => f.pad("not asked"),
            other => f.pad(other.name()),
        }
    }
}

/// How an expectation of the scenario stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Standing {
    /// Its name.
    pub expectation: String,
    /// The verdict; none while it is not decided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
}

impl Message for WorldFrame {
    as_json!();
}

/// A robot in a [`WorldFrame`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RobotFrame {
    /// Who.
    pub name: RobotName,
    /// Where.
    pub location: Point,
    /// Magnitude of its velocity, m/s.
    pub speed_mps: f64,
    /// Direction of motion, radians counter-clockwise from +x.
    pub direction_rad: f64,
    /// Its heading, radians counter-clockwise from +x, if it drives like wheels: its body is turned by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_rad: Option<f64>,
    /// Whether its last move was refused.
    pub blocked: bool,
    /// Its emotion state.
    pub emotion_state: String,
    /// Its behavior state.
    pub behavior_state: String,
    /// What it publishes about itself.
    pub state_variables: StateVariables,
    /// Incarnation; above 1 it has returned.
    pub generation: Generation,
    /// Whether it is there.
    pub presence: Presence,
}

/// What a robot chooses to display: data, not code.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Panel {
    /// The widgets, from top to bottom.
    pub widgets: Vec<Widget>,
}

/// Most widgets of a panel.
pub const MAX_WIDGETS: usize = 64;

impl Message for Panel {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        check_widgets(&self.widgets)
    }
}

/// What a robot displays of one tick, published for the ticks that observers are shown ([`Clock::panels`](super::Clock)). It is
/// shown with this tick and with no other one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TickPanel {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick that the robot has run last.
    pub tick: Tick,
    /// The widgets, from top to bottom.
    pub widgets: Vec<Widget>,
}

impl TickPanel {
    /// A robot's panel in a tick.
    #[must_use]
    pub fn new(epoch: Epoch, tick: Tick, panel: Panel) -> Self {
        Self {
            epoch,
            tick,
            widgets: panel.widgets,
        }
    }
}

impl Message for TickPanel {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        counted(self.tick, "tick")?;
        check_widgets(&self.widgets)
    }
}

fn check_widgets(widgets: &[Widget]) -> Result<(), FieldError> {
    if widgets.len() > MAX_WIDGETS {
        let reason = format!(
            "{} widgets, more than the {MAX_WIDGETS} allowed",
            widgets.len()
        );
        return Err(FieldError::new("widgets", reason));
    }

    for (i, widget) in widgets.iter().enumerate() {
        widget.check().map_err(|error| {
            FieldError::new(format!("widgets[{i}].{}", error.field), error.reason)
        })?;
    }
    Ok(())
}

/// One element of a panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "widget", rename_all = "snake_case")]
pub enum Widget {
    /// A labeled line of text.
    Text {
        /// What it is.
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
        /// What it says.
        #[cfg_attr(test, schemars(with = "String"))]
        text: SmolStr,
    },
    /// A state, set off from the rest.
    Badge {
        /// What it is.
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
        /// The state.
        #[cfg_attr(test, schemars(with = "String"))]
        text: SmolStr,
        /// How it is meant.
        tone: Tone,
    },
    /// A quantity within bounds.
    Bar {
        /// What it is.
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
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
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
        /// The values, oldest first.
        values: Vec<f64>,
    },
    /// Rows of text.
    Table {
        /// The rows.
        #[cfg_attr(test, schemars(with = "Vec<Vec<String>>"))]
        rows: Vec<Vec<SmolStr>>,
    },
    /// A picture; shown as an image, so that nothing in it runs.
    Svg {
        /// What it shows, for those who do not see it.
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
        /// The document.
        svg: String,
    },
    /// Sends the robot a command.
    Button {
        /// What it says.
        #[cfg_attr(test, schemars(with = "String"))]
        label: SmolStr,
        /// The command.
        #[cfg_attr(test, schemars(with = "String"))]
        command: SmolStr,
    },
}

impl Widget {
    /// Checks the fields of the widget. Errors have paths from the widget on: this runs for every panel.
    fn check(&self) -> Result<(), FieldError> {
        match self {
            Self::Text { label, text } | Self::Badge { label, text, .. } => {
                short(label, "label")?;
                short(text, "text")
            }
            Self::Bar {
                label,
                value,
                min,
                max,
            } => {
                short(label, "label")?;
                finite(*value, "value")?;
                finite(*min, "min")?;
                finite(*max, "max")
            }
            Self::Face { intensity, .. } => finite(*intensity, "intensity"),
            Self::Sparkline { label, values } => {
                few(values.len(), "values")?;
                short(label, "label")?;
                values.iter().try_for_each(|value| finite(*value, "values"))
            }
            Self::Table { rows } => {
                few(rows.iter().map(Vec::len).sum(), "rows")?;
                rows.iter()
                    .flatten()
                    .try_for_each(|cell| short(cell, "rows"))
            }
            // The size of a picture is bounded by that of a message.
            Self::Svg { label, .. } => short(label, "label"),
            Self::Button { label, command } => {
                short(label, "label")?;
                short(command, "command")
            }
        }
    }
}

/// How a badge is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[allow(
    missing_docs,
    reason = "the words are the seed's and say what they are"
)]
pub enum Face {
    Happy,
    Sad,
    Surprised,
    Disgusted,
    Angry,
    Fearful,
    Neutral,
}
