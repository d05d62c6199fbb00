//! What a robot can do during a tick: the calls of the seed's "Inter-Robot Communication", sensing, chance, the log.

use std::sync::Arc;

use protocol::messages::{
    MAX_ENTRIES, MAX_TEXT_BYTES, News, Percept, Performative, Point, PublicState, SensedRobot,
    StateVariables, Welcome,
};
use protocol::random::Stream;
use protocol::{RobotName, Seq, Tick};

use crate::cri::BadParameters;
use crate::seat::{Network, Undelivered};

/// What a robot may write to the log in a tick, all lines together.
const MAX_LOG_BYTES: usize = 256 * 1024;

/// Why a call between robots gave nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// No robot of the roster has this name.
    #[error("no robot is called {0:?}")]
    UnknownRobot(String),
    /// The network between the two is cut, or the other one is lost.
    #[error("{0} is unreachable")]
    Unreachable(RobotName),
    /// Before tick 1 nobody has reported anything.
    #[error("nothing is known before tick 1")]
    TooEarly,
    /// The epoch is over; whatever this tick comes to is thrown away.
    #[error("the epoch is over")]
    Interrupted,
}

/// The simulation, as one robot sees it during one tick.
pub struct Cars<'a> {
    pub(crate) welcome: &'a Welcome,
    pub(crate) tick: Tick,
    pub(crate) news: &'a News,
    pub(crate) random: &'a mut Stream,
    pub(crate) outbox: &'a mut Outbox,
    pub(crate) log: &'a mut Vec<String>,
    pub(crate) gave_up: &'a mut Option<String>,
    pub(crate) network: &'a mut dyn Network,
}

/// Commands that a robot sent in this tick, and the next free number.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    pub(crate) last_seq: Seq,
    pub(crate) sent: Vec<protocol::messages::SentCommand>,
}

impl Cars<'_> {
    /// Its own name (`getName`).
    #[must_use]
    pub fn name(&self) -> &RobotName {
        &self.welcome.name
    }

    /// What it was told when it joined: field, roster, ranges, where it started.
    #[must_use]
    pub fn welcome(&self) -> &Welcome {
        self.welcome
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

    /// Its parameters, as the robot's own type: numbers in SI units.
    ///
    /// # Errors
    /// [`BadParameters`] says which parameter is wrong or unknown.
    pub fn parameters<P: serde::de::DeserializeOwned>(&self) -> Result<P, BadParameters> {
        let map = self.welcome.parameters.clone().into_iter().collect();
        serde_json::from_value(serde_json::Value::Object(map)).map_err(|error| BadParameters {
            robot: self.welcome.name.clone(),
            reason: error.to_string(),
        })
    }

    /// Its own random stream, derived from the seed and its name: the only chance it may use.
    pub fn random(&mut self) -> &mut Stream {
        self.random
    }

    /// Whether its last move was refused, so that it still stands where it was.
    #[must_use]
    pub fn was_blocked(&self) -> bool {
        self.news
            .correction
            .is_some_and(|correction| correction.blocked)
    }

    /// Robots within its sensing range now. Sensing is physical: no cut network hides anybody.
    #[must_use]
    pub fn sensed_robots(&self) -> &[SensedRobot] {
        &self.news.sensed
    }

    /// All bodies within its sensing range now: obstacles, guests, robots. Costs a round trip to the simulator.
    ///
    /// # Errors
    /// [`CallError::Interrupted`] if the epoch is over.
    pub fn percept(&mut self) -> Result<Percept, CallError> {
        let (epoch, tick) = (self.welcome.epoch, self.tick);
        self.network
            .percept(&self.welcome.name, epoch, tick)
            .map_err(|_| CallError::Interrupted)
    }

    /// Writes a line to the log of the run. It is cut to what a message may hold, and so is their number in a tick.
    pub fn log(&mut self, line: impl Into<String>) {
        let mut line = line.into();
        if line.len() > MAX_TEXT_BYTES {
            let end = (0..=MAX_TEXT_BYTES)
                .rev()
                .find(|at| line.is_char_boundary(*at))
                .unwrap_or(0);
            line.truncate(end);
        }
        // Room is left for what the seat itself may have to say, and for the rest of the report.
        let bytes: usize = self.log.iter().map(String::len).sum();
        if self.log.len() < MAX_ENTRIES / 2 && bytes + line.len() <= MAX_LOG_BYTES {
            self.log.push(line);
        }
    }

    /// It cannot go on, and says why: whatever this tick comes to is thrown away, and its process leaves the run. The
    /// first reason counts.
    pub fn give_up(&mut self, reason: impl Into<String>) {
        self.gave_up.get_or_insert(reason.into());
    }

    /// Sends a command to another robot (`setRobotCommand`). It arrives at a later tick, if the network lets it.
    ///
    /// # Errors
    /// [`CallError::UnknownRobot`] if nobody has this name.
    pub fn set_robot_command(
        &mut self,
        to: &str,
        command: impl Into<String>,
    ) -> Result<Seq, CallError> {
        let to = self.known(to)?;
        self.outbox.last_seq += 1;
        let (seq, performative, command) =
            (self.outbox.last_seq, Performative::Achieve, command.into());
        let message = protocol::messages::Command {
            epoch: self.welcome.epoch,
            tick: self.tick,
            seq,
            performative,
            command: command.clone(),
        };
        self.network.send(&self.welcome.name, &to, &message);
        self.outbox.sent.push(protocol::messages::SentCommand {
            to,
            seq,
            performative,
            command,
        });
        Ok(seq)
    }

    /// Where another robot stood at the last tick, meters (`getRobotLocation`).
    ///
    /// # Errors
    /// See [`CallError`]; the same holds for the other queries.
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
        if self.news.unreachable.contains(&of) {
            return Err(CallError::Unreachable(of));
        }
        self.network
            .state_of(&of, self.welcome.epoch, self.tick - 1)
            .map_err(|undelivered| match undelivered {
                Undelivered::Lost => CallError::Unreachable(of),
                Undelivered::Interrupted => CallError::Interrupted,
            })
    }

    fn known(&self, name: &str) -> Result<RobotName, CallError> {
        let found = self
            .welcome
            .roster
            .iter()
            .find(|robot| robot.as_str() == name);
        found
            .cloned()
            .ok_or_else(|| CallError::UnknownRobot(name.to_owned()))
    }
}
