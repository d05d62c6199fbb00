//! People and the simulator: the CD-player buttons, and what the simulator says of itself.

use serde::{Deserialize, Serialize};

use super::limits::{counted, few, finite, is_false, short};
use super::log::LogRecord;
use super::numbers::{Epoch, Generation, Tick};
use super::point::Point;
use crate::codec::{FieldError, Message, as_json};
use crate::name::{RobotName, RunName};

/// A request to the simulator. It never goes through the barrier: it is answered at once, also while the clock is held.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Control {
    /// Start the next epoch: everything back to tick 0, with the same processes.
    Init {
        /// Another seed; without it the same.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// Another set-up; without it the same. A refusal names the fields that are wrong, and changes nothing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        setup: Option<Box<Setup>>,
        /// Only if this is the epoch in progress: another one has another set-up, perhaps. Without it whatever the epoch.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        epoch: Option<Epoch>,
    },
    /// Start the next epoch with the scenario that this TOML text describes; its roster must be that of the run.
    Load {
        /// The text of a scenario file. Its `params_from` may name parameters that the simulator brings along, and no other file.
        scenario: String,
    },
    /// What the run is set up with: answered with [`ControlAnswer::Setup`].
    Setup,
    /// Let the clock run.
    Start,
    /// Hold the clock after the current tick.
    Pause,
    /// Grant this many ticks, then pause. Answered with the tick that was reached.
    Step {
        /// How many.
        n: u64,
    },
    /// Show another tick of a recording, earlier or later. A run in progress refuses.
    Seek {
        /// The tick.
        tick: Tick,
    },
    /// End the run.
    Stop,
    /// Simulated seconds per second of wall clock; `null` is as fast as the barrier goes.
    Speed {
        /// The real-time factor.
        factor: Option<f64>,
    },
    /// What the clock does about robots that are late, from now on.
    Late {
        /// For which robot; without it for all that have no rule of their own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        robot: Option<RobotName>,
        /// What it does; without it as before.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        on_late: Option<OnLate>,
        /// After how long without a report a robot is late, seconds of wall clock; for all robots; without it as before.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        deadline_s: Option<f64>,
    },
    /// Do something to the run, as an experiment: it takes effect before the next tick, and is an event.
    Intervene {
        /// What.
        what: Intervention,
    },
    /// The launcher has carried out the faults that it was ordered before this tick.
    FaultsDone {
        /// Epoch of the order.
        epoch: Epoch,
        /// Tick of the order.
        tick: Tick,
    },
    /// The process that played these robots has ended, and the launcher starts no further one for them. Repeated until it is
    /// answered; a process that joins later takes it back.
    ProcessEnded {
        /// The robots.
        robots: Vec<RobotName>,
        /// How it ended, as the predicate of a sentence about the robot.
        because: String,
    },
    /// The last lines of the log: answered with [`ControlAnswer::Log`].
    Log,
    /// Nothing but the status.
    Status,
}

impl Message for Control {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        match self {
            Self::Speed {
                factor: Some(factor),
            } => finite(*factor, "factor"),
            Self::Late {
                deadline_s: Some(deadline_s),
                ..
            } => finite(*deadline_s, "deadline_s"),
            Self::Seek { tick } => counted(*tick, "tick"),
            Self::Init {
                setup: Some(setup), ..
            } => setup.check(),
            Self::Intervene { what } => what.check(),
            Self::ProcessEnded { robots, because } => {
                few(robots.len(), "robots")?;
                short(because, "because")
            }
            _ => Ok(()),
        }
    }
}

/// What a person does to a run in progress. It is what a scenario can say, too: the record has it in the words of the scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "intervention", rename_all = "snake_case")]
pub enum Intervention {
    /// Cuts the links between two groups of robots.
    Cut {
        /// One group.
        from: Vec<RobotName>,
        /// The other.
        to: Vec<RobotName>,
        /// Whether only messages from the one group to the other are cut.
        #[serde(default, skip_serializing_if = "is_false")]
        one_way: bool,
    },
    /// Heals the links between two groups of robots, whatever has cut them.
    Heal {
        /// One group; without names all robots.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        from: Vec<RobotName>,
        /// The other; without names all robots.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        to: Vec<RobotName>,
        /// Whether only messages from the one group to the other pass again.
        #[serde(default, skip_serializing_if = "is_false")]
        one_way: bool,
    },
    /// Loses the next command on a link.
    Lose {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
    },
    /// Delays the next command on a link.
    Delay {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
        /// By how much, simulated seconds.
        by_s: f64,
    },
    /// Has the next command on a link arrive twice.
    Duplicate {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
    },
    /// Brings a fault upon the process of a robot.
    Fault {
        /// Whose.
        robot: RobotName,
        /// Which.
        kind: FaultKind,
        /// After how long it ends by itself, seconds of wall clock; only where the clock waits for the robot.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        for_s: Option<f64>,
    },
    /// Ends the fault of a robot's process: a stopped one goes on, a killed one is started again.
    Recover {
        /// Whose.
        robot: RobotName,
    },
    /// Changes the scenario from the next tick on, as a `[[change]]` does.
    Set {
        /// Changes as in `robot.Butler.params.policy=rules`.
        set: Vec<String>,
    },
}

impl Intervention {
    fn check(&self) -> Result<(), FieldError> {
        match self {
            Self::Cut { from, to, .. } | Self::Heal { from, to, .. } => {
                few(from.len(), "what.from")?;
                few(to.len(), "what.to")
            }
            Self::Fault {
                for_s: Some(for_s), ..
            } => finite(*for_s, "what.for_s"),
            Self::Set { set } => {
                few(set.len(), "what.set")?;
                set.iter().try_for_each(|one| short(one, "what.set"))
            }
            Self::Delay { by_s, .. } => finite(*by_s, "what.by_s"),
            Self::Lose { .. }
            | Self::Duplicate { .. }
            | Self::Fault { .. }
            | Self::Recover { .. } => Ok(()),
        }
    }
}

/// The answer to a [`Control`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "answer", rename_all = "snake_case")]
pub enum ControlAnswer {
    /// Done; this is how things stand now.
    Done(Box<Status>),
    /// What the run is set up with.
    Setup(Box<SetupAnswer>),
    /// The last lines of the log, the oldest first.
    Log {
        /// The lines. Every line that is put later is newer than these.
        lines: Vec<LogRecord>,
    },
    /// Not done.
    Refused {
        /// Why, and what to do about it.
        explanation: String,
        /// Of a set-up: what is wrong with which of its fields.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        fields: Vec<FieldError>,
    },
}

/// The set-up of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SetupAnswer {
    /// What a person can change before the next epoch.
    pub setup: Setup,
    /// The whole scenario as a file, to keep.
    pub scenario: String,
}

/// What a person can change between two epochs: the set-up screen of the paper ("Overall Architecture"). Everything else
/// of the scenario stays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Setup {
    /// Where all chance of the epoch comes from.
    pub seed: u64,
    /// Simulated time, seconds.
    pub duration_s: f64,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Number of guests.
    pub guests: u32,
    /// Triangular distribution of the guests' speeds, m/s.
    pub guest_speed_mps: Range,
    /// Triangular distribution of the times after which a guest draws a new speed and direction, seconds.
    pub guest_duration_s: Range,
    /// Centers of the fixed obstacles, meters.
    pub obstacles: Vec<Point>,
    /// Where each robot starts, meters.
    pub robots: std::collections::BTreeMap<RobotName, Point>,
    /// The readable log.
    pub log_file: LogFile,
}

/// A triangular distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Range {
    /// Least value.
    pub min: f64,
    /// Most likely value.
    pub mode: f64,
    /// Largest value.
    pub max: f64,
}

/// The readable log of a run, in the run's folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LogFile {
    /// Whether it is written.
    pub enabled: bool,
    /// Its name, without a folder.
    pub name: String,
}

impl Message for ControlAnswer {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        match self {
            Self::Log { lines } => few(lines.len(), "lines"),
            _ => Ok(()),
        }
    }
}

impl Setup {
    /// Numbers that are numbers and lists that are bounded; whether they make sense is the simulator's to say.
    fn check(&self) -> Result<(), FieldError> {
        finite(self.duration_s, "setup.duration_s")?;
        self.field_m
            .iter()
            .try_for_each(|size| finite(*size, "setup.field_m"))?;

        for (range, name) in [
            (self.guest_speed_mps, "setup.guest_speed_mps"),
            (self.guest_duration_s, "setup.guest_duration_s"),
        ] {
            [range.min, range.mode, range.max]
                .iter()
                .try_for_each(|value| finite(*value, name))?;
        }

        self.obstacles
            .iter()
            .try_for_each(|at| at.check("setup.obstacles"))?;
        short(&self.log_file.name, "setup.log_file.name")?;
        self.robots
            .values()
            .try_for_each(|at| at.check("setup.robots"))
    }
}

/// What the simulator is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Robots of the roster are still missing.
    Gathering,
    /// Initialized; nothing has moved yet.
    Ready,
    /// The clock runs.
    Running,
    /// The clock is held by request.
    Paused,
    /// The run is over.
    Ended,
}

impl std::fmt::Display for Phase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Gathering => "gathering",
            Self::Ready => "ready",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Ended => "ended",
        })
    }
}

/// What the clock does about a robot that is late.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum OnLate {
    /// Hold, and say for whom; never act. The mode for science.
    Wait,
    /// Go on without it: the missed tick is recorded and its body stays.
    Continue,
    /// End the run.
    Abort,
}

/// What the scenario has the launcher do to processes before a tick; the clock is held until it answers with
/// [`Control::FaultsDone`]. The same order may come twice; what was done is not done again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FaultOrder {
    /// Epoch.
    pub epoch: Epoch,
    /// Tick before whose clock it is done.
    pub tick: Tick,
    /// What to do, in this order.
    pub orders: Vec<ProcessOrder>,
}

impl Message for FaultOrder {
    as_json!();

    fn check(&self) -> Result<(), FieldError> {
        few(self.orders.len(), "orders")
    }
}

/// What to do to one robot's process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ProcessOrder {
    /// Whose process.
    pub robot: RobotName,
    /// Which fault.
    pub kind: FaultKind,
    /// Whether the fault begins; else it is over.
    pub begins: bool,
    /// A fault that begins ends by itself after this time of wall clock, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
}

impl ProcessOrder {
    /// The fault that is in effect from this order on; `None` if it ends, or by itself after a time of the launcher's.
    #[must_use]
    pub fn lasting(&self) -> Option<FaultKind> {
        let lasts = self.begins && self.for_s.is_none();
        lasts.then_some(self.kind)
    }
}

/// A fault of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// The process is killed; at the end of the fault it is started again.
    Crash,
    /// The process is stopped; at the end of the fault it goes on.
    Hang,
    /// The process is stopped for most of the time, and goes on in between.
    Slow,
    /// The process is killed and started again, between two ticks.
    Restart,
}

/// How things stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Status {
    /// The run.
    pub run: RunName,
    /// The epoch.
    pub epoch: Epoch,
    /// Last tick that is complete.
    pub tick: Tick,
    /// Ticks that were requested by `step` and are not done yet.
    pub pending_steps: u64,
    /// Simulated time at `tick`, seconds.
    pub time_s: f64,
    /// Simulated time at which the run ends, seconds.
    pub duration_s: f64,
    /// Length of a tick, simulated seconds; 0 if it is not known.
    #[serde(default)]
    pub tick_s: f64,
    /// Seed of the epoch.
    pub seed: u64,
    /// The recorded run of which this is a replay; none in a run in progress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replay_of: Option<RunName>,
    /// What the simulator is doing.
    pub phase: Phase,
    /// Real-time factor; `null` is as fast as the barrier goes.
    pub speed: Option<f64>,
    /// What the clock does about robots that are late and have no rule of their own.
    pub on_late: OnLate,
    /// After how long without a report a robot is late, seconds of wall clock.
    pub deadline_s: f64,
    /// For whom the clock waits now; empty when it does not.
    pub awaiting: Vec<Awaited>,
    /// The robots of the roster, by name.
    pub robots: Vec<RobotStatus>,
    /// Messages that were ignored so far, by reason.
    pub ignored: std::collections::BTreeMap<String, u64>,
}

/// A robot that the clock waits for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Awaited {
    /// Who.
    pub name: RobotName,
    /// For how long, seconds of wall clock.
    pub since_s: f64,
    /// What is known of it.
    pub because: Reason,
}

/// What is known of a robot that is awaited.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// It has not joined yet.
    NotJoined,
    /// Its process or its link is gone.
    Gone,
    /// It is there and has not reported.
    Silent,
    /// It waits for another robot's answer.
    WaitsFor(RobotName),
    /// Its process has ended in this way, and no further one is started.
    Ended(String),
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotJoined => f.write_str("has not joined"),
            Self::Gone => f.write_str("is gone: its process or its link is down"),
            Self::Silent => f.write_str("is there but has not reported"),
            Self::WaitsFor(other) => write!(f, "waits for {other}"),
            Self::Ended(how) => write!(f, "{how}, and no further process is started for it"),
        }
    }
}

/// One robot of the roster.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RobotStatus {
    /// Who.
    pub name: RobotName,
    /// Incarnation; 0 before the first.
    pub generation: Generation,
    /// What the clock does when it is late.
    pub on_late: OnLate,
    /// Whether its process is there.
    pub presence: Presence,
}

/// Whether a robot is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Presence {
    /// Its process is there.
    Here,
    /// Its process or its link is down, and the run has not given it up.
    Gone,
    /// The run goes on without it.
    Lost,
}
