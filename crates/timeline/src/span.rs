//! What has a beginning in a run: spans, and the moments at which robots join, the scenario changes and an expectation is decided.

use protocol::event::Cause;
use protocol::messages::{FaultKind, Performative, Verdict};
use protocol::{Generation, RobotName, Seq, Tick};

/// A period: from the tick in which something began up to the tick in which it was over, which is not part of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Period {
    /// The first tick.
    pub begin: Tick,
    /// The tick after the last one; `None` while it is in progress.
    pub end: Option<Tick>,
}

impl Period {
    /// A period that is in progress.
    #[must_use]
    pub fn since(begin: Tick) -> Self {
        Self { begin, end: None }
    }

    /// A single tick.
    #[must_use]
    pub fn only(tick: Tick) -> Self {
        let end = Some(tick + 1);
        Self { begin: tick, end }
    }

    /// Whether it is not over before a tick.
    #[must_use]
    pub fn lasts_to(self, tick: Tick) -> bool {
        self.end.is_none_or(|end| end >= tick)
    }

    /// Its number of ticks. If it is in progress, it is counted up to the tick `now`, which is not part of it.
    #[must_use]
    pub fn ticks(self, now: Tick) -> Tick {
        self.end.unwrap_or(now).saturating_sub(self.begin)
    }
}

/// Something that [`crate::Timeline`] finds in the events of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum Span {
    /// A robot was in a state.
    Stay(StateSpan),
    /// A robot took no part.
    Absence(Absence),
    /// A robot missed ticks.
    Missed(MissedTicks),
    /// A process had a fault.
    Fault(FaultSpan),
    /// A link was cut.
    Cut(CutSpan),
    /// A robot could not have queried another one, by chance.
    QueriesLost(QueriesLost),
    /// A guest that had entered was on the field.
    Guest(GuestVisit),
    /// A command was sent.
    Command(CommandSpan),
    /// A robot joined after the beginning of the run: a moment.
    Joined(Joined),
    /// The scenario changed: a moment.
    Change(ChangeSpan),
    /// An expectation was decided: a moment.
    Judged(ExpectationSpan),
}

/// What a state is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StateKind {
    /// What the robot feels.
    Emotion,
    /// What it does.
    Behavior,
}

impl StateKind {
    /// How it is written.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Emotion => "emotion",
            Self::Behavior => "behavior",
        }
    }
}

/// A time without a break in which a robot was in one state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateSpan {
    /// The robot.
    pub robot: RobotName,
    /// What the state is about.
    pub kind: StateKind,
    /// Name of the state.
    pub name: String,
    /// When. One that is over lasted for at least one tick.
    pub period: Period,
}

/// A time in which a robot took no part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Absence {
    /// The robot.
    pub robot: RobotName,
    /// When.
    pub period: Period,
}

/// Consecutive ticks that a robot missed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MissedTicks {
    /// The robot.
    pub robot: RobotName,
    /// When; it always has an end so far.
    pub period: Period,
}

/// A fault of a robot's process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultSpan {
    /// The robot.
    pub robot: RobotName,
    /// The fault.
    pub kind: FaultKind,
    /// When.
    pub period: Period,
}

/// A link that was cut, in one direction. If what is cut changes, another cut follows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CutSpan {
    /// The robot that cannot reach the other.
    pub from: RobotName,
    /// The other one.
    pub to: RobotName,
    /// Whether commands are cut.
    pub commands: bool,
    /// Whether queries are cut.
    pub queries: bool,
    /// When.
    pub period: Period,
}

/// Consecutive ticks in which a robot could not have queried another one, for one cause.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueriesLost {
    /// The robot that would have queried.
    pub from: RobotName,
    /// The other one.
    pub to: RobotName,
    /// Why.
    pub because: Cause,
    /// When; it always has an end so far.
    pub period: Period,
}

/// A time in which a guest that had entered was on the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GuestVisit {
    /// Which guest, counted from 0.
    pub guest: u32,
    /// When. It has no tick if the guest left in the tick in which it entered.
    pub period: Period,
}

/// A command and its fate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandSpan {
    /// The sender.
    pub from: RobotName,
    /// The target.
    pub to: RobotName,
    /// Its number among those of the sender.
    pub seq: Seq,
    /// What it is meant to do.
    pub performative: Performative,
    /// What it says.
    pub text: String,
    /// The tick in which it was sent.
    pub sent: Tick,
    /// The tick in which a command that the medium held back is to arrive.
    pub until: Option<Tick>,
    /// Whether the medium doubled it.
    pub is_doubled: bool,
    /// Why it is held back or doubled, if it is not by chance: the scenario names it, or it waits in a queue.
    pub because: Option<Cause>,
    /// What became of its copies so far; one that is missing is still under way.
    pub ends: Vec<CommandEnd>,
}

impl CommandSpan {
    /// Whether a copy of it was lost.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.ends.iter().any(|end| end.lost.is_some())
    }

    /// The number of copies that were under way at first.
    #[must_use]
    pub fn copies(&self) -> usize {
        if self.is_doubled { 2 } else { 1 }
    }

    /// Whether no copy is under way. A partition loses all copies with one event.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let mut ends = self.ends.iter();
        self.ends.len() >= self.copies() || ends.any(|end| end.lost == Some(Cause::Partition))
    }
}

/// What became of a copy of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CommandEnd {
    /// The tick in which it arrived or was lost.
    pub tick: Tick,
    /// Why it was lost; `None` if it was delivered.
    pub lost: Option<Cause>,
}

/// A robot joined after the beginning of the run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Joined {
    /// The robot.
    pub robot: RobotName,
    /// Its incarnation, unless it is the first one.
    pub generation: Option<Generation>,
    /// The first tick in which it takes part.
    pub tick: Tick,
}

/// The scenario is another one from a tick on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangeSpan {
    /// The tick.
    pub tick: Tick,
    /// What is set, as `path=value`.
    pub set: String,
    /// The change before it of the same part of the scenario, if there was one.
    pub before: Option<String>,
}

/// The verdict about an expectation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpectationSpan {
    /// The tick in which it was decided.
    pub tick: Tick,
    /// Name of the expectation.
    pub expectation: String,
    /// What was decided.
    pub verdict: Verdict,
    /// Why, in words.
    pub because: String,
}
