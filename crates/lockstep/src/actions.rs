//! What a participant wants done, and what its tick came to, as data.

use std::time::Duration;

use protocol::messages::{End, Refusal};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::Sent;

/// How long a participant waits for what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Timeouts {
    /// How long to try to be admitted.
    pub join: Duration,
    /// How long to wait for a simulator that is gone: it has ended, or the link to it is down, which look the same from here.
    pub gone: Duration,
}

/// A timer of a participant. Setting it again replaces it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RobotTimer {
    /// Ask to join again.
    Join,
    /// Give up joining.
    JoinPatience,
    /// Give up waiting for a simulator that is gone.
    Gone,
    /// Query again.
    Query,
    /// Tell people for whom the robot waits.
    Waiting,
}

/// What a participant wants done.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ParticipantOutput<N, S, C, R> {
    /// Ask the simulator to be admitted; answer by `Participant::admitted`, `Participant::refused` or
    /// `Participant::unanswered`.
    Join,
    /// Declare the liveliness token.
    DeclareToken,
    /// Run the robot for a tick; answer by `Participant::done`.
    Run(Turn<N>),
    /// Put what came of a tick, in this order: the commands, the state, the report.
    Put(Box<TickAnswer<S, C, R>>),
    /// Query the state of another robot as of this tick, and subscribe to it; answer by `Participant::heard`.
    Query {
        /// The other robot.
        of: RobotName,
        /// The tick under way: the answer is the state of the tick before.
        tick: Tick,
        /// The epoch.
        epoch: Epoch,
    },
    /// Subscribe no more to the state of another robot.
    Unfollow(RobotName),
    /// Put that the robot waits for another robot's answer.
    PutWaiting {
        /// The tick under way.
        tick: Tick,
        /// The epoch.
        epoch: Epoch,
        /// The other robot.
        on: RobotName,
    },
    /// Call `Participant::timer` after this time.
    SetTimer(RobotTimer, Duration),
    /// Leave the run: withdraw the token, close the session, end.
    Leave(Leave),
}

/// A tick that a robot is to run.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Turn<N> {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// How it begins.
    pub begin: Begin,
    /// What is new, if anything is.
    pub news: Option<N>,
}

/// How a robot's tick begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Begin {
    /// Tick 0: the robot returns to its initial state.
    Init,
    /// The first tick of an incarnation that takes over in the middle of an epoch.
    TakeOver,
    /// Any other tick.
    GoOn,
}

/// What came of a tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct TickAnswer<S, C, R> {
    /// The epoch.
    pub epoch: Epoch,
    /// The tick.
    pub tick: Tick,
    /// The incarnation that answers.
    pub generation: Generation,
    /// The commands, numbered from 1 in this order.
    pub commands: Vec<Sent<C>>,
    /// The state that other robots may query.
    pub state: S,
    /// The report.
    pub report: R,
}

impl<S, C, R> TickAnswer<S, C, R> {
    /// Epoch and tick, in the order of time.
    pub(crate) fn at(&self) -> (Epoch, Tick) {
        (self.epoch, self.tick)
    }
}

/// Why a robot leaves the run.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Leave {
    /// The run is over.
    End(End),
    /// It was refused.
    Refused(Refusal),
    /// No simulator answered in time.
    NoSimulator,
    /// The simulator was gone for too long.
    SimulatorGone,
    /// Another process has taken its place.
    Replaced,
    /// The process itself wants to leave.
    Stopped,
}
