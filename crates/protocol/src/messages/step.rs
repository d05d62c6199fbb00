//! Simulator and robots: joining, and the messages of one tick.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::drive::{DriveLimits, Pose, Velocity};
use super::layer::{LayerAction, LayerResult, SensedLayer, check_layer_actions};
use super::limits::{counted, few, finite, is_false, is_zero, log_lines, short};
use super::numbers::{Epoch, Generation, Tick};
use super::payload::Payload;
use super::performative::Performative;
use super::point::Point;
use super::sensing::Rays;
use super::site::{KnownSite, SensedSite, SiteAction, SiteResult, check_site_actions};
use super::state::PublicState;
use super::target::Target;
use super::variables::{StateVariables, check_variables};
use crate::codec::{FieldError, Message, as_json};
use crate::name::{RobotName, RunName};

/// A robot asks to take part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct JoinRequest {
    /// Version of the contract that the robot speaks.
    pub protocol: u32,
    /// Run that it means to join.
    pub run: RunName,
    /// Robot that it is.
    pub name: RobotName,
    /// Identity of this process among all that ever claim the name; any text that no other process has.
    pub instance: String,
    /// Whether its news list the bodies around it ([`TickUpdate::bodies`]).
    #[serde(default, skip_serializing_if = "is_false")]
    pub bodies: bool,
    /// Whether its news list the ranges of its rays ([`TickUpdate::ranges`]).
    #[serde(default, skip_serializing_if = "is_false")]
    pub ranges: bool,
    /// Language and version of what it is written with, for people.
    #[serde(default)]
    pub sdk: String,
}

impl Message for JoinRequest {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        short(&self.instance, "instance")?;
        short(&self.sdk, "sdk")
    }
}

/// The simulator's answer to a [`JoinRequest`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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

impl Message for JoinAnswer {
    as_json!();
}

/// Why a robot may not take part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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

/// Parameters of a robot: all that the scenario has for it, lengths and times in SI units.
pub type Parameters = BTreeMap<String, serde_json::Value>;

/// Asks a robot whether it can work with these parameters, before they change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ParametersOffer {
    /// All of its parameters, as a [`Welcome`] would have them.
    pub parameters: Parameters,
}

impl Message for ParametersOffer {
    as_json!();
}

/// The answer to a [`ParametersOffer`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "answer", rename_all = "snake_case")]
pub enum ParametersAnswer {
    /// It can.
    Accepted,
    /// It cannot.
    Refused {
        /// Which parameter is wrong, and why.
        reason: String,
    },
}

impl Message for ParametersAnswer {
    as_json!();
}

/// What a robot needs to know to take part in an epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// Seed of the epoch, or what its stream was last drawn anew from before it joined.
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
    /// The fan of rays by which it may sense distances, if the scenario has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<Rays>,
    /// Its limits, if it drives like wheels: it proposes velocities, and its news have its [`TickUpdate::pose`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveLimits>,
    /// Where it stands.
    pub location: Point,
    /// Names of all robots of the scenario, itself included, in the order of their bytes.
    pub roster: Vec<RobotName>,
    /// The sites that every robot knows of, by name. Their states are sensed within range ([`TickUpdate::sites`]).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known_sites: Vec<KnownSite>,
    /// Its parameters.
    pub parameters: Parameters,
    /// If its parameters have changed in this epoch: those before, the last first. A robot that refuses its parameters when it
    /// takes part again goes on with the first of these that it accepts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub earlier_parameters: Vec<Parameters>,
    /// Its parameters after the changes that the scenario has planned: a robot that refuses one of them does so at once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub later_parameters: Vec<Parameters>,
    /// Where its stream is drawn anew in the middle of the epoch, in the order of ticks. Most runs have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reseeds: Vec<StreamReseed>,
    /// The flag of [`Clock::news`] that is its own.
    #[serde(default)]
    pub news_flag: u32,
    /// What its previous incarnation reported last, if it had one in this epoch. Other robots may still query it: the robot
    /// must answer with it until it has reported itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_state: Option<PublicState>,
    /// What its previous incarnation reported for the tick before that, if it had already reported for the tick that is open:
    /// the other robots query this state during the open tick.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_before: Option<PublicState>,
}

/// From a tick on, a robot draws from a stream with its own name and another seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StreamReseed {
    /// The first tick with draws from the new stream.
    pub tick: Tick,
    /// Seed of the new stream.
    pub seed: u64,
}

impl Welcome {
    /// What its previous incarnation reported, with the ticks: at most two states, the older first.
    #[must_use]
    pub fn states_before<S: From<PublicState>>(&self) -> Vec<(Tick, S)> {
        let states = self.state_before.iter().chain(&self.last_state);
        states
            .map(|state| (state.tick, S::from(state.clone())))
            .collect()
    }
}

/// The flags of [`Clock::news`]: robot number i of the roster, from 0, has flag `1 << (i % NEWS_FLAGS)`.
pub const NEWS_FLAGS: usize = 32;

/// The simulator grants a tick. Its size does not depend on the number of robots.
///
/// The same clock may arrive twice: a message of this tick may have been lost. Every robot that has answered it repeats its
/// commands and its report, and the simulator ignores what it already has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clock {
    /// Epoch; a higher one than before means `init`.
    pub epoch: Epoch,
    /// Tick that is granted.
    pub tick: Tick,
    /// Flags of the robots that have [`TickUpdate`] of this tick. A robot whose flag is set waits for its news before it acts; a
    /// robot whose flag is not set has none. Robots may share a flag, and then all of them get news.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub news: u32,
    /// Observers are shown this tick: a robot puts its panel of it ([`TickPanel`](super::TickPanel)) before its report. A clock
    /// that was answered without may come again with it.
    #[serde(default, skip_serializing_if = "is_false")]
    pub panels: bool,
    /// The run is over; no report is awaited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<End>,
}

impl Message for Clock {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        counted(self.tick, "tick")
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Its duration is over.
    Finished,
    /// It was stopped from outside.
    Stopped,
    /// It could not go on.
    Aborted,
}

/// What is new for one robot in a tick. It is put before the clock of the tick, on the same session.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TickUpdate {
    /// Epoch of the clock that it belongs to.
    pub epoch: Epoch,
    /// Tick of the clock that it belongs to.
    pub tick: Tick,
    /// The incarnation of this generation takes part from this tick on. Any other process with this name has been replaced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joined: Option<Generation>,
    /// The clock has gone on without the incarnation of this generation, which takes part no more. Its process joins again, and
    /// takes part as a further incarnation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejoin: Option<Generation>,
    /// Where it stands, if not where it proposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// Its pose, in every tick, if the scenario has it drive like wheels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Commands that arrive now, in the order in which they count: by sender, then in the order in which they were sent. One
    /// that the medium has doubled is listed twice.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<Delivery>,
    /// The robots that its radio reaches, by name: it can query no others in this tick. Absent where distance does not matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_range: Option<Vec<RobotName>>,
    /// Robots that it cannot query in this tick: the medium has cut the link between the two, or they missed the tick before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unreachable: Vec<RobotName>,
    /// Other robots within its sensing range, by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sensed: Vec<SensedRobot>,
    /// All bodies within its sensing range, itself excepted, in a fixed order; only if it asked for them when it joined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<SensedBody>,
    /// The distance from its center in the direction of each ray ([`Welcome::rays`]) to the next body or the edge of the field,
    /// meters; the range of the rays where nothing is nearer. Only if it asked for them when it joined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ranges: Vec<f64>,
    /// All sites that it senses, by name. The whole list comes in every tick with one in range, so that a robot needs no memory of
    /// it, whichever incarnation it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<SensedSite>,
    /// What became of its actions on sites in the tick before, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub site_results: Vec<SiteResult>,
    /// What it senses of the layers that have a range, by name; in every tick, as sites.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<SensedLayer>,
    /// What became of its actions on layers in the tick before, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layer_results: Vec<LayerResult>,
}

impl TickUpdate {
    /// Whether another robot can be queried in this tick.
    #[must_use]
    pub fn can_query(&self, robot: &RobotName) -> bool {
        let in_range = self.in_range.as_ref();
        in_range.is_none_or(|names| names.contains(robot)) && !self.unreachable.contains(robot)
    }

    /// Whether there is nothing to send.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let Self {
            epoch: _,
            tick: _,
            joined,
            rejoin,
            correction,
            pose,
            commands,
            in_range,
            unreachable,
            sensed,
            bodies,
            ranges,
            sites,
            site_results,
            layers,
            layer_results,
        } = self;

        joined.is_none()
            && rejoin.is_none()
            && correction.is_none()
            && pose.is_none()
            && commands.is_empty()
            && in_range.is_none()
            && unreachable.is_empty()
            && sensed.is_empty()
            && bodies.is_empty()
            && ranges.is_empty()
            && sites.is_empty()
            && site_results.is_empty()
            && layers.is_empty()
            && layer_results.is_empty()
    }
}

impl Message for TickUpdate {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        counted(self.tick, "tick")?;
        self.commands.iter().try_for_each(|delivery| {
            short(&delivery.command, "commands.command")?;
            check_payload(delivery.payload.as_ref(), "commands.payload")
        })
    }
}

/// A robot does not stand where it proposed to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Correction {
    /// Where it stands instead.
    pub location: Point,
    /// Whether its move was refused (collision, edge of the field, too fast); otherwise it was placed there.
    #[serde(default, skip_serializing_if = "is_false")]
    pub blocked: bool,
}

/// A command that arrives at its target.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Delivery {
    /// The sender.
    pub from: RobotName,
    /// What it is meant to do.
    #[serde(default)]
    pub performative: Performative,
    /// Its text.
    pub command: String,
    /// Its payload, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<Payload>,
}

/// Another robot within sensing range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensedRobot {
    /// Who.
    pub name: RobotName,
    /// Where, as of this tick.
    pub location: Point,
}

/// A robot has done its tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
    /// How many commands it put for this tick, before this report.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub commands: u32,
    /// Lines for the log: what it says, what it did. Of longer lines, and of more, the rest is left out.
    #[serde(
        default,
        deserialize_with = "log_lines",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub log: Vec<String>,
    /// What it does to sites, in this order. It is carried out when all reports of the tick are in.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub site_actions: Vec<SiteAction>,
    /// What it does to layers, in this order, at the same time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layer_actions: Vec<LayerAction>,
    /// The velocity that it means to have, if the scenario has it drive like wheels: it counts in the place of the proposal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Velocity>,
}

impl Report {
    /// What the robot lets others know of itself by this report. `location` is where it stood in the tick.
    #[must_use]
    pub fn state(&self, location: Point) -> PublicState {
        PublicState {
            epoch: self.epoch,
            tick: self.tick,
            location,
            speed_mps: self.speed_mps,
            direction_rad: self.direction_rad,
            state_variables: self.state_variables.clone(),
            emotion_state: self.emotion_state.clone(),
            behavior_state: self.behavior_state.clone(),
        }
    }
}

impl Message for Report {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        self.proposal.check("proposal")?;
        finite(self.speed_mps, "speed_mps")?;
        // Not its range, and nothing corrects it: other robots get it from this robot, or, where the clock goes on without it,
        // from the simulator, which puts its report as a state. Which of both is wall clock, so both must have the same bytes.
        finite(self.direction_rad, "direction_rad")?;
        short(&self.emotion_state, "emotion_state")?;
        short(&self.behavior_state, "behavior_state")?;
        check_variables(&self.state_variables)?;
        few(self.commands as usize, "commands")?;
        check_site_actions(&self.site_actions)?;
        check_layer_actions(&self.layer_actions)?;
        self.velocity.as_ref().map_or(Ok(()), Velocity::check)
    }
}

/// A command from one robot to another (`setRobotCommand`), or to all others: put on the outbox of its sender for the medium, which
/// decides whether and when it arrives, or on the key of its target. An operator's command needs nothing but the text.
#[derive(Debug, Clone, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Command {
    /// Epoch in which it was sent.
    #[serde(default)]
    pub epoch: Epoch,
    /// Tick in which it was sent.
    #[serde(default)]
    pub tick: Tick,
    /// Incarnation that sent it.
    #[serde(default)]
    pub generation: Generation,
    /// Its number among the sender's commands of this tick, from 1.
    #[serde(default)]
    pub number: u32,
    /// For whom it is, on the outbox of its sender: a robot, or `*` for every other robot of the roster, as if each were sent one
    /// command in the order of the roster. On the key of a target that counts, and not this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<Target>,
    /// What it is meant to do.
    #[serde(default)]
    pub performative: Performative,
    /// Its text: the name of what is to be done.
    pub command: String,
    /// Its payload, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<Payload>,
}

/// What a command says.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct CommandText {
    /// What it is meant to do.
    pub performative: Performative,
    /// Its text.
    pub command: String,
    /// Its payload, if it has one.
    pub payload: Option<Payload>,
}

impl CommandText {
    /// A command that says this, without a payload.
    #[must_use]
    pub fn named(command: impl Into<String>) -> Self {
        Self {
            command: command.into(),
            ..Self::default()
        }
    }

    /// Checks its sizes.
    ///
    /// # Errors
    /// The field that is too large.
    pub fn check(&self) -> Result<(), FieldError> {
        short(&self.command, "command")?;
        check_payload(self.payload.as_ref(), "payload")
    }
}

impl From<Command> for CommandText {
    fn from(command: Command) -> Self {
        Self {
            performative: command.performative,
            command: command.command,
            payload: command.payload,
        }
    }
}

fn check_payload(payload: Option<&Payload>, field: &str) -> Result<(), FieldError> {
    payload.map_or(Ok(()), |payload| payload.check(field))
}

impl Message for Command {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        counted(self.tick, "tick")?;
        short(&self.command, "command")?;
        check_payload(self.payload.as_ref(), "payload")
    }
}

/// A robot that cannot finish its tick reports which robot's answer it waits for, so that it is not held responsible itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Waiting {
    /// Epoch.
    pub epoch: Epoch,
    /// Tick.
    pub tick: Tick,
    /// Whose answer or command it waits for.
    pub on: RobotName,
}

impl Message for Waiting {
    as_json!();
}

/// One sensed body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensedBody {
    /// What it is.
    pub kind: SensedKind,
    /// Its center.
    pub location: Point,
}

/// What a robot can tell about a body it senses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SensedKind {
    /// A fixed obstacle.
    Obstacle,
    /// A guest.
    Guest,
    /// A robot.
    Robot,
}
