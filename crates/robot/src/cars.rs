//! What a robot perceives and can call during a tick: its location, commands, sensing, queries to other robots (the
//! paper's "Inter-Robot Communication"), random numbers, the log.

use std::sync::Arc;

use lockstep::Sent;
use protocol::messages::{
    CommandText, LayerResult, MAX_ENTRIES, MAX_TEXT_BYTES, Payload, Performative, Point, Pose,
    PublicState, SensedBody, SensedLayer, SensedRobot, SensedSite, SiteResult, StateVariables,
    Target, TickUpdate, Welcome,
};
use protocol::plain::cut;
use protocol::random::Stream;
use protocol::{RobotName, Tick};

use crate::error::{BadParameters, read_parameters};
use crate::network::{PeerNetwork, Undelivered};

/// Most lines that a robot may write to the log in a tick. The rest of a report's lines is for those that the SDK adds.
const MAX_LOG_LINES: usize = MAX_ENTRIES / 2;
/// Most bytes that a robot may write to the log in a tick, all lines together.
const MAX_LOG_BYTES: usize = 256 * 1024;
/// Most warnings that the log has in a tick beside a robot's own lines.
const MAX_WARNINGS: usize = 16;

/// What was left out of the log because of its limits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct LeftOut {
    /// Lines that were dropped.
    pub(crate) lines: u64,
    /// Lines that were cut at their end.
    pub(crate) ends: u64,
}

impl LeftOut {
    /// The warning for the log; `None` if nothing was left out.
    pub(crate) fn warning(self) -> Option<String> {
        let what = match (self.lines, self.ends) {
            (0, 0) => return None,
            (lines, 0) => format!("{lines} lines of the log were dropped"),
            (0, ends) => format!("{ends} lines of the log were cut"),
            (lines, ends) => format!("{lines} lines of the log were dropped and {ends} cut"),
        };
        Some(format!(
            "{what}: the limits are {MAX_TEXT_BYTES} bytes a line, and {MAX_LOG_LINES} lines and {MAX_LOG_BYTES} bytes a tick"
        ))
    }
}

/// Why a call to another robot failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// No robot of the roster has this name.
    #[error("no robot is called {0:?}")]
    UnknownRobot(String),
    /// The simulated network between the two is cut, or the process of the other robot is lost.
    #[error("{0} is unreachable")]
    Unreachable(RobotName),
    /// No robot has reported before tick 1.
    #[error("nothing is known before tick 1")]
    TooEarly,
    /// The epoch is over; the result of this tick is discarded.
    #[error("the epoch is over")]
    Interrupted,
}

/// A command that arrived in this tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReceivedCommand {
    /// The sender: a robot, or an operator.
    pub from: RobotName,
    /// Its text: the name of what is to be done.
    pub text: String,
    /// Its payload, if it has one.
    pub payload: Option<Payload>,
}

/// The simulation, as one robot sees it during one tick.
pub struct Cars<'a> {
    pub(crate) welcome: &'a Welcome,
    pub(crate) tick: Tick,
    pub(crate) location: Point,
    pub(crate) commands: &'a [ReceivedCommand],
    pub(crate) news: &'a TickUpdate,
    pub(crate) random: &'a mut Stream,
    pub(crate) senses_bodies: bool,
    pub(crate) senses_ranges: bool,
    pub(crate) outbox: &'a mut Vec<Sent<CommandText>>,
    pub(crate) log: &'a mut Vec<String>,
    pub(crate) left_out: &'a mut LeftOut,
    pub(crate) gave_up: &'a mut Option<String>,
    pub(crate) network: &'a mut dyn PeerNetwork,
}

impl<'a> Cars<'a> {
    /// The robot's own name (`getName`).
    #[must_use]
    pub fn name(&self) -> &'a RobotName {
        &self.welcome.name
    }

    /// What the simulator sent when the robot joined: field, roster, ranges, and where it stood in its first tick.
    #[must_use]
    pub fn welcome(&self) -> &'a Welcome {
        self.welcome
    }

    /// Where the robot stands now, meters: where it proposed to be, or where it was if that place was taken
    /// (`setCurrentLocation`).
    #[must_use]
    pub fn location(&self) -> Point {
        self.location
    }

    /// Where the robot stands and looks, and the velocity that it has reached, if the scenario has it drive like wheels
    /// ([`Action::drive`](crate::Action::drive)); `None` for any other robot.
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.news.pose
    }

    /// The commands that arrived in this tick, in the order of senders and of their sending (`setCommand`).
    #[must_use]
    pub fn commands(&self) -> &'a [ReceivedCommand] {
        self.commands
    }

    /// The current tick; 0 is the initial state.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Length of a tick, simulated seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.welcome.tick_s
    }

    /// Simulated time, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        // Ticks stay far below 2^53.
        self.tick as f64 * self.welcome.tick_s
    }

    /// The parameters of the scenario, as the robot's own type: numbers in SI units.
    ///
    /// # Errors
    /// [`BadParameters`] names the parameter that is wrong or unknown.
    pub fn parameters<P: serde::de::DeserializeOwned>(&self) -> Result<P, BadParameters> {
        read_parameters(&self.welcome.parameters).map_err(|reason| self.bad_parameters(reason))
    }

    /// Whether the robot goes on with earlier parameters if [`Robot::init`](crate::Robot::init) refuses those of now.
    #[must_use]
    pub fn has_earlier_parameters(&self) -> bool {
        !self.welcome.earlier_parameters.is_empty()
    }

    /// The error of a robot that cannot work with its parameters.
    pub fn bad_parameters(&self, reason: impl std::fmt::Display) -> BadParameters {
        BadParameters {
            robot: self.welcome.name.clone(),
            reason: reason.to_string(),
        }
    }

    /// The robot's random stream, derived from the seed and its name. A robot that draws from anywhere else does not
    /// repeat with the seed.
    pub fn random(&mut self) -> &mut Stream {
        self.random
    }

    /// Whether the place it proposed was taken, so that it still stands where it was.
    #[must_use]
    pub fn was_blocked(&self) -> bool {
        self.news
            .correction
            .is_some_and(|correction| correction.blocked)
    }

    /// Robots within sensing range now. Sensing is physical: a network that is cut hides none of them.
    #[must_use]
    pub fn sensed_robots(&self) -> &'a [SensedRobot] {
        &self.news.sensed
    }

    /// All bodies within sensing range now: obstacles, guests, robots.
    ///
    /// # Panics
    /// If the robot does not ask for them by [`Robot::senses_bodies`](crate::Robot::senses_bodies).
    #[must_use]
    pub fn bodies(&self) -> &'a [SensedBody] {
        assert!(
            self.senses_bodies,
            "{} uses bodies() and its senses_bodies() is false",
            self.welcome.name
        );

        &self.news.bodies
    }

    /// The distance along each ray ([`Welcome::rays`]) to the next body or the edge of the field now, meters; the range of the
    /// rays where nothing is nearer. Empty if the scenario has no rays.
    ///
    /// # Panics
    /// If the robot does not ask for them by [`Robot::senses_ranges`](crate::Robot::senses_ranges).
    #[must_use]
    pub fn ranges(&self) -> &'a [f64] {
        assert!(
            self.senses_ranges,
            "{} uses ranges() and its senses_ranges() is false",
            self.welcome.name
        );

        &self.news.ranges
    }

    /// The sites that it senses now, by name.
    #[must_use]
    pub fn sites(&self) -> &'a [SensedSite] {
        &self.news.sites
    }

    /// What became of its actions on sites in the tick before, in their order.
    #[must_use]
    pub fn site_results(&self) -> &'a [SiteResult] {
        &self.news.site_results
    }

    /// What it senses now of the layers that have a range, by name.
    #[must_use]
    pub fn layers(&self) -> &'a [SensedLayer] {
        &self.news.layers
    }

    /// What it senses now of a layer; `None` if there is no such layer, or none of its cells is in range.
    #[must_use]
    pub fn layer(&self, name: &str) -> Option<&'a SensedLayer> {
        self.news.layers.iter().find(|layer| layer.name == name)
    }

    /// What became of its actions on layers in the tick before, in their order.
    #[must_use]
    pub fn layer_results(&self) -> &'a [LayerResult] {
        &self.news.layer_results
    }

    /// Writes a line to the log of the run. Long lines are truncated, and lines beyond the limit of a tick are dropped; the log
    /// has a warning when this happens first.
    pub fn log(&mut self, line: impl Into<String>) {
        let mut line = line.into();
        if cut(&mut line, MAX_TEXT_BYTES) {
            self.left_out.ends += 1;
        }

        let bytes: usize = self.log.iter().map(String::len).sum();
        if self.log.len() < MAX_LOG_LINES && bytes + line.len() <= MAX_LOG_BYTES {
            self.log.push(line);
        } else {
            self.left_out.lines += 1;
        }
    }

    /// What was left out of the log in this epoch so far because of its limits, in words; `None` if nothing was.
    #[must_use]
    pub fn log_warning(&self) -> Option<String> {
        self.left_out.warning()
    }

    /// Writes a warning about the robot to the log of the run, also where its own lines have used up their limit. For libraries that
    /// run robots; they bound how many there are.
    pub fn warn(&mut self, warning: &str) {
        let mut line = format!("warning: {warning}");
        cut(&mut line, MAX_TEXT_BYTES);
        if self.log.len() < MAX_LOG_LINES + MAX_WARNINGS {
            self.log.push(line);
        }
    }

    /// Ends the robot: the result of this tick is discarded, and its process leaves the run with this reason. The first
    /// reason counts.
    pub fn give_up(&mut self, reason: impl Into<String>) {
        self.gave_up.get_or_insert(reason.into());
    }

    /// Sends a command to another robot (`setRobotCommand`). It arrives at a later tick, unless the simulated network
    /// loses it.
    ///
    /// # Errors
    /// [`CallError::UnknownRobot`] if no robot has this name.
    pub fn set_robot_command(
        &mut self,
        to: &str,
        command: impl Into<String>,
    ) -> Result<(), CallError> {
        self.send(to, command, None)
    }

    /// Sends a command with a payload to another robot: any JSON value, of at most 64 KiB. It arrives at a later tick, unless the
    /// simulated network loses it.
    ///
    /// ```
    /// # fn tick(cars: &mut robot::Cars<'_>) -> Result<(), robot::CallError> {
    /// let bid = serde_json::json!({ "task": 3, "bid": 0.1 });
    /// cars.send("Vonda", "bid", robot::Payload::new(bid))?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`CallError::UnknownRobot`] if no robot has this name.
    pub fn send(
        &mut self,
        to: &str,
        name: impl Into<String>,
        payload: Option<Payload>,
    ) -> Result<(), CallError> {
        let to = Target::Robot(self.known(to)?);
        self.put(to, name.into(), payload);
        Ok(())
    }

    /// Sends a command to every other robot of the roster. The simulated network decides for each of them, as if each were sent one
    /// command in the order of the roster; the message itself goes to the simulator once.
    pub fn broadcast(&mut self, name: impl Into<String>, payload: Option<Payload>) {
        self.put(Target::Others, name.into(), payload);
    }

    fn put(&mut self, to: Target, command: String, payload: Option<Payload>) {
        let command = CommandText {
            performative: Performative::Achieve,
            command,
            payload,
        };
        self.outbox.push(Sent { to, command });
    }

    /// Where another robot stood at the last tick, meters (`getRobotLocation`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_location(&mut self, of: &str) -> Result<Point, CallError> {
        self.get_robot_state(of).map(|state| state.location)
    }

    /// How fast another robot was at the last tick, m/s (`getRobotSpeed`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_speed(&mut self, of: &str) -> Result<f64, CallError> {
        self.get_robot_state(of).map(|state| state.speed_mps)
    }

    /// Where another robot was heading at the last tick, radians (`getRobotDirection`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_direction(&mut self, of: &str) -> Result<f64, CallError> {
        self.get_robot_state(of).map(|state| state.direction_rad)
    }

    /// What another robot published of itself at the last tick (`getRobotStateVariables`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_state_variables(&mut self, of: &str) -> Result<StateVariables, CallError> {
        self.get_robot_state(of)
            .map(|state| state.state_variables.clone())
    }

    /// Another robot's emotion at the last tick (`getRobotEmotionState`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_emotion_state(&mut self, of: &str) -> Result<String, CallError> {
        self.get_robot_state(of)
            .map(|state| state.emotion_state.clone())
    }

    /// Another robot's behavior at the last tick (`getRobotBehaviorState`).
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_behavior_state(&mut self, of: &str) -> Result<String, CallError> {
        self.get_robot_state(of)
            .map(|state| state.behavior_state.clone())
    }

    /// All six answers at once. The first query of a tick to a robot costs a round trip; the answers cannot change
    /// within a tick, so every further one to the same robot is free.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get_robot_state(&mut self, of: &str) -> Result<Arc<PublicState>, CallError> {
        let of = self.known(of)?;
        if self.tick == 0 {
            return Err(CallError::TooEarly);
        }
        // The simulator's verdict comes first: whether an answer could be had is not for the real
        // network to decide.
        if !self.news.can_query(&of) {
            return Err(CallError::Unreachable(of));
        }

        self.network
            .state_of(&of)
            .map_err(|undelivered| match undelivered {
                Undelivered::Lost => CallError::Unreachable(of),
                Undelivered::Interrupted => CallError::Interrupted,
            })
    }

    fn known(&self, name: &str) -> Result<RobotName, CallError> {
        let roster = &self.welcome.roster;
        let index = roster.binary_search_by(|robot| robot.as_str().cmp(name));
        index
            .map(|index| roster[index].clone())
            .map_err(|_| CallError::UnknownRobot(name.to_owned()))
    }
}
