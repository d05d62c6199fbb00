//! Simulator and robots: joining, and the messages of one tick.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::state::check_variables;
use super::{
    Epoch, Generation, Parameters, Point, PublicState, Seq, StateVariables, Tick, counted, few,
    finite, is_false, short,
};
use crate::codec::Message;
use crate::name::{RobotName, RunName};

/// A robot asks to take part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JoinRequest {
    /// Version of the contract that the robot speaks.
    pub protocol: u32,
    /// Run that it means to join.
    pub run: RunName,
    /// Robot that it is.
    pub name: RobotName,
    /// Identity of this process among all that ever claim the name; any text that no other process has.
    pub instance: String,
    /// Language and version of what it is written with, for people.
    #[serde(default)]
    pub sdk: String,
}

impl Message for JoinRequest {
    fn check(&self) -> Result<(), (String, String)> {
        short(&self.instance, "instance")?;
        short(&self.sdk, "sdk")
    }
}

/// The simulator's answer to a [`JoinRequest`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "answer", rename_all = "snake_case")]
pub enum JoinAnswer {
    /// It takes part from the tick whose clock names it.
    Welcome(Box<Welcome>),
    /// It does not.
    Refused {
        /// Why, for programs.
        reason: Refusal,
        /// Why, and what to do about it, for people.
        explanation: String,
    },
}

impl Message for JoinAnswer {}

/// Why a robot may not take part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// No robot of the scenario has this name.
    UnknownName,
    /// A living process already is this robot.
    NameTaken,
    /// It speaks another version of the contract.
    OtherProtocol,
    /// It means another run than the one this simulator executes.
    OtherRun,
    /// The request could not be understood.
    Malformed,
    /// The run is over.
    Ended,
}

/// What a robot needs to know to take part in an epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Welcome {
    /// Version of the contract.
    pub protocol: u32,
    /// Run it joined.
    pub run: RunName,
    /// Robot it is.
    pub name: RobotName,
    /// Its incarnation.
    pub generation: Generation,
    /// Epoch that these facts hold for.
    pub epoch: Epoch,
    /// Last tick that was granted in it.
    pub tick: Tick,
    /// Seed of the epoch.
    pub seed: u64,
    /// Name of the random stream that is its own; see [`crate::random`].
    pub stream: String,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of every body, meters.
    pub body_m: f64,
    /// Distance within which it senses other bodies, meters.
    pub sensing_range_m: f64,
    /// Where it stands.
    pub location: Point,
    /// Names of all robots of the scenario, itself included.
    pub roster: Vec<RobotName>,
    /// Its parameters.
    pub parameters: Parameters,
    /// What its previous incarnation reported last, if it had one in this epoch. Others may still ask for it: the robot
    /// must answer with it until it has reported itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_state: Option<PublicState>,
    /// What it reported for the tick before that, where it had reported for the tick under way before it was gone: the
    /// others still ask for this one in this tick.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_before: Option<PublicState>,
    /// Its commands of this epoch are numbered from the next one on: no incarnation uses a number that a former one may
    /// have used.
    #[serde(default)]
    pub last_seq: Seq,
    /// Whoever sees a clock repeated repeats the commands of this many ticks back: a clock may name one so late, because
    /// the medium holds commands back.
    #[serde(default = "two_ticks")]
    pub repeat_ticks: Tick,
}

fn two_ticks() -> Tick {
    2
}

/// The simulator grants a tick. It carries exceptions only: a robot that is not named moved as it proposed and has no
/// command, and a quiet tick is a small message however many robots there are.
///
/// The same clock may come twice. Then somebody's message of this tick was lost: every robot repeats its report and
/// the commands of its last ticks ([`Welcome::repeat_ticks`]), and whoever already has them ignores the repetition.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Clock {
    /// Epoch; a higher one than before means `init`.
    pub epoch: Epoch,
    /// Tick that is granted.
    pub tick: Tick,
    /// What is new, by robot.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub news: BTreeMap<RobotName, News>,
    /// The run is over; no report is awaited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<End>,
}

impl Message for Clock {
    fn check(&self) -> Result<(), (String, String)> {
        counted(self.tick, "tick")
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Its duration is over.
    Finished,
    /// It was stopped from outside.
    Stopped,
    /// It could not go on.
    Aborted,
}

/// What one robot is told with a clock.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct News {
    /// Where it stands, where that is not what it proposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// Commands that arrive now, in this order (by sender, then number). One that the medium has doubled is named twice in
    /// a row and counts as two commands.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<CommandId>,
    /// Robots that it cannot query in this tick: the medium has cut it off from them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unreachable: Vec<RobotName>,
    /// Other robots within its sensing range, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sensed: Vec<SensedRobot>,
    /// The incarnation of this generation takes part from this tick on. Another one with this name has been replaced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joined: Option<Generation>,
}

impl News {
    /// Whether there is nothing to tell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// A robot does not stand where it proposed to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Correction {
    /// Where it stands instead.
    pub location: Point,
    /// Whether its move was refused (collision, edge of the field, too fast); else it was placed there.
    #[serde(default, skip_serializing_if = "is_false")]
    pub blocked: bool,
}

/// A command, named by its sender and its number.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct CommandId {
    /// Who sent it.
    pub from: RobotName,
    /// Its number among the sender's commands of this epoch: from 1, or from where its welcome says.
    pub seq: Seq,
}

/// Another robot within sensing range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SensedRobot {
    /// Who.
    pub name: RobotName,
    /// Where, as of this tick.
    pub location: Point,
}

/// A robot has done its tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Epoch of the clock it answers.
    pub epoch: Epoch,
    /// Tick of the clock it answers.
    pub tick: Tick,
    /// Incarnation that answers.
    pub generation: Generation,
    /// Where it means to be at the next tick.
    pub proposal: Point,
    /// Magnitude of its velocity, m/s.
    pub speed_mps: f64,
    /// Direction of motion, radians counter-clockwise from +x, in (-pi, pi].
    pub direction_rad: f64,
    /// Its emotion state.
    pub emotion_state: String,
    /// Its behavior state.
    pub behavior_state: String,
    /// What it publishes about its inner workings.
    #[serde(default)]
    pub state_variables: StateVariables,
    /// Commands it sent in this tick, in this order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sent: Vec<SentCommand>,
    /// Commands that the clock named and that never came.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<CommandId>,
    /// Lines for the log: what it says, what it did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log: Vec<String>,
}

impl Message for Report {
    fn check(&self) -> Result<(), (String, String)> {
        self.proposal.check("proposal")?;
        finite(self.speed_mps, "speed_mps")?;
        finite(self.direction_rad, "direction_rad")?;
        short(&self.emotion_state, "emotion_state")?;
        short(&self.behavior_state, "behavior_state")?;
        check_variables(&self.state_variables)?;
        few(self.sent.len(), "sent")?;
        few(self.missing.len(), "missing")?;
        few(self.log.len(), "log")?;
        self.sent
            .iter()
            .try_for_each(|sent| short(&sent.command, "sent.command"))?;
        self.log.iter().try_for_each(|line| short(line, "log"))
    }
}

/// A report's note of a command that went straight to its target.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SentCommand {
    /// To whom.
    pub to: RobotName,
    /// Its number.
    pub seq: Seq,
    /// What it is meant to do.
    #[serde(default)]
    pub performative: Performative,
    /// What it says, for the log; the target has it from the sender.
    pub command: String,
}

/// A command on its way from robot to robot (`setRobotCommand`). The target holds it until a clock names it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Command {
    /// Epoch in which it was sent.
    pub epoch: Epoch,
    /// Tick in which it was sent.
    pub tick: Tick,
    /// Its number among the sender's commands of this epoch, from 1.
    pub seq: Seq,
    /// What it is meant to do.
    #[serde(default)]
    pub performative: Performative,
    /// What it says.
    pub command: String,
}

/// What a message between robots is meant to do: the part of KQML that the robots of the paper need (Finin et al. 1994;
/// the paper's robots spoke KQML, Murphy et al. 2002, abstract). A query of the common robot interface is an `ask-one`
/// by being a query, and its answer says that it is a `tell`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Performative {
    /// The sender wants the receiver to make something true of its environment: every `setRobotCommand`.
    #[default]
    Achieve,
    /// The sender wants one answer from what the receiver knows: every `getRobot...`.
    AskOne,
    /// The content is true as far as the sender knows: every answer to a query.
    Tell,
}

impl Performative {
    /// Its name in KQML.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Achieve => "achieve",
            Self::AskOne => "ask-one",
            Self::Tell => "tell",
        }
    }
}

impl std::fmt::Display for Performative {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Message for Command {
    fn check(&self) -> Result<(), (String, String)> {
        counted(self.tick, "tick")?;
        short(&self.command, "command")
    }
}

/// A robot that cannot finish its tick says for whose answer it waits, so that nobody else is blamed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Waiting {
    /// Epoch.
    pub epoch: Epoch,
    /// Tick.
    pub tick: Tick,
    /// Whose answer or command it waits for.
    pub on: RobotName,
}

impl Message for Waiting {}

/// What a robot senses around itself, by its own query to the simulator.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Percept {
    /// Epoch.
    pub epoch: Epoch,
    /// Tick as of which it holds.
    pub tick: Tick,
    /// Bodies whose center is within sensing range, in a fixed order.
    pub bodies: Vec<SensedBody>,
}

impl Message for Percept {
    fn check(&self) -> Result<(), (String, String)> {
        counted(self.tick, "tick")
    }
}

/// One sensed body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SensedBody {
    /// What it is.
    pub kind: SensedKind,
    /// Its center.
    pub location: Point,
}

/// What a robot can tell about a body it senses.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum SensedKind {
    /// A fixed obstacle.
    Obstacle,
    /// A guest.
    Guest,
    /// A robot.
    Robot,
}
