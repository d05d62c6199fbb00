//! Key expressions: where each message of a run is said. `cars/{run}/…`, robots addressed by name.

use crate::name::{RobotName, RunName};

/// Builds the keys of one run.
///
/// ```
/// # use protocol::{keys::Keys, RobotName, RunName};
/// let keys = Keys::new(&RunName::new("demo")?);
/// let leguin = RobotName::new("Leguin")?;
/// assert_eq!(keys.report(&leguin), "cars/demo/robot/Leguin/report");
/// assert_eq!(Keys::robot_of("cars/demo/robot/Leguin/report"), Some("Leguin"));
/// # Ok::<(), protocol::BadName>(())
/// ```
#[derive(Debug, Clone)]
pub struct Keys {
    root: String,
}

/// The six queries of the common robot interface, as the last chunk of their keys (seed, Figure 7).
pub const QUERIES: [&str; 6] = [
    "location",
    "speed",
    "direction",
    "state_variables",
    "emotion_state",
    "behavior_state",
];

/// All six answers in one: what a robot asks for when it wants more than one of them in a tick. One reply costs
/// half of what six do.
pub const STATE: &str = "state";

/// Last chunk of the key on which a robot puts its commands.
pub(crate) const OUTBOX: &str = "outbox";

/// Last chunk of the key at which a robot checks parameters.
pub(crate) const PARAMETERS: &str = "parameters";

impl Keys {
    /// The keys of run `run`.
    #[must_use]
    pub fn new(run: &RunName) -> Self {
        Self {
            root: format!("cars/{run}"),
        }
    }

    /// The keys of all runs: what is not about one run, as access control is not.
    #[must_use]
    pub fn of_any_run() -> Self {
        Self {
            root: "cars/*".to_owned(),
        }
    }

    /// Everything that is said in the run.
    #[must_use]
    pub fn all(&self) -> String {
        format!("{}/**", self.root)
    }

    /// Simulator to all: a tick is granted.
    #[must_use]
    pub fn clock(&self) -> String {
        format!("{}/clock", self.root)
    }

    /// Queryable at the simulator: a robot asks to take part. Open to all; see [`Self::join_as`].
    #[must_use]
    pub fn join(&self) -> String {
        format!("{}/join", self.root)
    }

    /// Queryable at the simulator: this robot asks to take part; its name is in the key, so that access control can
    /// pin it.
    #[must_use]
    pub fn join_as(&self, robot: &RobotName) -> String {
        format!("{}/join/{robot}", self.root)
    }

    /// All that ask to take part with their name in the key.
    #[must_use]
    pub fn joins(&self) -> String {
        format!("{}/join/*", self.root)
    }

    /// The robot that a key of joining names, if it names one.
    #[must_use]
    pub fn joins_as(key: &str) -> Option<&str> {
        let (before, last) = key.rsplit_once('/')?;
        before.ends_with("/join").then_some(last)
    }

    /// Robot to simulator: its tick is done.
    #[must_use]
    pub fn report(&self, robot: &RobotName) -> String {
        format!("{}/robot/{robot}/report", self.root)
    }

    /// All reports of the run.
    #[must_use]
    pub fn reports(&self) -> String {
        format!("{}/robot/*/report", self.root)
    }

    /// Robot to simulator: it waits for another robot's answer.
    #[must_use]
    pub fn waiting(&self, robot: &RobotName) -> String {
        format!("{}/robot/{robot}/waiting", self.root)
    }

    /// All notes of waiting of the run.
    #[must_use]
    pub fn all_waiting(&self) -> String {
        format!("{}/robot/*/waiting", self.root)
    }

    /// Robot to medium: a command; target and sender are in the key, so that access control can pin the sender.
    #[must_use]
    pub fn command(&self, to: &RobotName, from: &RobotName) -> String {
        format!("{}/robot/{to}/command/{from}", self.root)
    }

    /// Robot to medium: commands that name their targets themselves. The sender is in the key, so that access control can pin it.
    #[must_use]
    pub fn outbox(&self, from: &RobotName) -> String {
        self.robot(from.as_str(), OUTBOX)
    }

    /// All outboxes of the run.
    #[must_use]
    pub fn outboxes(&self) -> String {
        self.robot("*", OUTBOX)
    }

    /// All commands of the run that are put on the keys of their targets.
    #[must_use]
    pub fn commands(&self) -> String {
        format!("{}/robot/*/command/*", self.root)
    }

    /// Simulator to robot: what is new for this robot in a tick.
    #[must_use]
    pub fn news(&self, robot: &RobotName) -> String {
        self.robot(robot.as_str(), "news")
    }

    /// The news of all robots.
    #[must_use]
    pub fn all_news(&self) -> String {
        self.robot("*", "news")
    }

    /// A key about one robot, or about all of them where its name is `*`.
    pub(crate) fn robot(&self, robot: &str, what: &str) -> String {
        format!("{}/robot/{robot}/{what}", self.root)
    }

    /// Queryable at the robot, of robots that can check parameters before they change.
    #[must_use]
    pub fn parameters(&self, robot: &RobotName) -> String {
        self.robot(robot.as_str(), PARAMETERS)
    }

    /// Queryable at the robot: `what` is one of [`QUERIES`] or [`STATE`].
    #[must_use]
    pub fn query(&self, robot: &RobotName, what: &str) -> String {
        self.robot(robot.as_str(), what)
    }

    /// The same of all robots: a get there has a reply of each one, on its own key.
    #[must_use]
    pub fn queries(&self, what: &str) -> String {
        self.robot("*", what)
    }

    /// Robot to observers: what it chooses to display.
    #[must_use]
    pub fn panel(&self, robot: &RobotName) -> String {
        format!("{}/robot/{robot}/panel", self.root)
    }

    /// All panels of the run.
    #[must_use]
    pub fn panels(&self) -> String {
        format!("{}/robot/*/panel", self.root)
    }

    /// Queryable at the simulator: init, start, pause, step, stop, speed, command, status.
    #[must_use]
    pub fn control(&self) -> String {
        format!("{}/control", self.root)
    }

    /// Simulator to observers: positions, at a display rate.
    #[must_use]
    pub fn world(&self) -> String {
        format!("{}/world", self.root)
    }

    /// Simulator to observers: state changes as lines.
    #[must_use]
    pub fn log(&self) -> String {
        format!("{}/log", self.root)
    }

    /// Simulator to launcher: what to do to processes before a tick.
    #[must_use]
    pub fn faults(&self) -> String {
        format!("{}/faults", self.root)
    }

    /// All liveliness tokens.
    #[must_use]
    pub fn alive(&self) -> String {
        format!("{}/alive/**", self.root)
    }

    /// Liveliness token of the simulator.
    #[must_use]
    pub fn alive_sim(&self) -> String {
        format!("{}/alive/sim", self.root)
    }

    /// Liveliness token of a robot; declared last, so that it means "ready".
    #[must_use]
    pub fn alive_robot(&self, robot: &RobotName) -> String {
        format!("{}/alive/robot/{robot}", self.root)
    }

    /// All robots' liveliness tokens.
    #[must_use]
    pub fn alive_robots(&self) -> String {
        format!("{}/alive/robot/*", self.root)
    }

    /// Liveliness token of a console, while a browser shows the run there.
    #[must_use]
    pub fn alive_viewer(&self) -> String {
        format!("{}/alive/viewer", self.root)
    }

    /// The robot that a key under `…/robot/{name}` is about.
    #[must_use]
    pub fn robot_of(key: &str) -> Option<&str> {
        let mut chunks = key.split('/').skip_while(|chunk| *chunk != "robot");
        chunks.next()?;
        chunks.next()
    }

    /// The sender that the key of a command to one robot names; `None` for an outbox.
    #[must_use]
    pub fn command_sender(key: &str) -> Option<&str> {
        let (before, from) = key.rsplit_once('/')?;
        before.ends_with("/command").then_some(from)
    }

    /// The last chunk of a key: the sender of a command, or what a query asks for.
    #[must_use]
    pub fn last_chunk(key: &str) -> &str {
        key.rsplit('/').next().unwrap_or(key)
    }
}
