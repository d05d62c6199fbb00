//! What goes into the barrier and what it wants done, as data.

use std::time::Duration;

use protocol::messages::Clock;
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::{IncarnationNotice, TickOutcome};

/// How long the barrier waits for what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Timing {
    /// After this long without a report people are told for whom the clock waits.
    pub announce: Duration,
    /// A held clock is repeated this often.
    pub repeat: Duration,
    /// The first interval at which it is repeated for a robot that has just been welcomed; each further one is twice as long.
    pub repeat_for_newcomers: Duration,
    /// A robot that was admitted declares its token within this time, or its place is free again.
    pub token: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            announce: Duration::from_millis(500),
            repeat: Duration::from_secs(2),
            // Much less than any deadline, and much more than a round trip.
            repeat_for_newcomers: Duration::from_millis(10),
            token: Duration::from_secs(2),
        }
    }
}

/// A timer of the barrier. Setting it again replaces it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Timer {
    /// It is time to tell people for whom the clock waits.
    Announce,
    /// It is time to repeat the clock.
    Repeat,
    /// The robots that have not reported are late.
    Deadline,
    /// This robot was admitted and has not declared its token.
    Token(RobotName),
}

/// What the barrier wants done.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum BarrierOutput<R, C> {
    /// Every robot of the roster is connected: grant tick 0.
    Gathered,
    /// Put these news, each to its robot with the incarnations that it names, then the clock.
    Grant {
        /// Robots that get news, in the order of their names.
        news: Vec<(RobotName, IncarnationNotice)>,
        /// The clock.
        clock: Clock,
    },
    /// The tick is complete.
    Complete(TickOutcome<R, C>),
    /// The clock goes on without this robot, and others may wait for its state as of the tick before: put that on its behalf.
    StandIn(RobotName),
    /// The clock is held: tell people for whom, or tell them again because that has changed.
    Held,
    /// A clock that was held goes on.
    Released,
    /// A robot is late and the run ends because of it.
    Aborted,
    /// Call `Barrier::timer` after this time.
    SetTimer(Timer, Duration),
    /// A message changed nothing.
    Ignored(Ignored, RobotName),
}

/// Why a message changed nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Ignored {
    /// No robot of the roster has this name.
    UnknownRobot,
    /// It is of another tick, epoch or incarnation than the open one.
    Stale,
    /// It is from a robot without which the clock goes on.
    Lost,
    /// More commands than a robot may send in a tick.
    TooMany,
}

impl Ignored {
    /// In words.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::UnknownRobot => "unknown robot",
            Self::Stale => "stale",
            Self::Lost => "lost",
            Self::TooMany => "too many commands",
        }
    }
}

/// A command that a robot's report counts and that has not arrived.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct MissingCommand {
    /// Who has reported.
    pub robot: RobotName,
    /// How many commands its report counts.
    pub counted: u32,
    /// The lowest number, from 1, that no command has.
    pub number: u32,
}

/// Why a robot is not admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refused {
    /// No robot of the roster has this name.
    UnknownName,
    /// A connected process is this robot.
    NameTaken,
    /// The run is over.
    Ended,
}

/// Epoch, tick and generation that a robot's message states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Stamp {
    /// Epoch of the clock that it answers.
    pub epoch: Epoch,
    /// Tick of the clock that it answers.
    pub tick: Tick,
    /// Incarnation that answers.
    pub generation: Generation,
}
