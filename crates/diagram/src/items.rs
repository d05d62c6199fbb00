//! The things that a diagram shows.

use protocol::event::Cause;
use protocol::messages::{Awaited, FaultKind, Performative};
use protocol::{Generation, RobotName, Seq, Tick};

/// A period: from the tick in which something began up to that in which it was over, which is not part of it. `None`: it goes
/// on after the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Period {
    pub(crate) begin: Tick,
    pub(crate) end: Option<Tick>,
}

/// A robot's emotion or behavior over a period.
#[derive(Debug, Clone)]
pub(crate) struct Band {
    pub(crate) robot: RobotName,
    pub(crate) kind: BandKind,
    pub(crate) name: String,
    pub(crate) period: Period,
}

/// What a band shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum BandKind {
    Emotion,
    Behavior,
}

/// A command and its fate.
#[derive(Debug, Clone)]
pub(crate) struct Command {
    pub(crate) from: RobotName,
    pub(crate) to: RobotName,
    pub(crate) seq: Seq,
    pub(crate) performative: Performative,
    pub(crate) text: String,
    pub(crate) sent: Tick,
    /// Tick of arrival of a command that the medium held back.
    pub(crate) until: Option<Tick>,
    pub(crate) is_doubled: bool,
    /// What became of it, each copy by itself; a copy that is missing is still under way.
    pub(crate) ends: Vec<CommandEnd>,
}

impl Command {
    /// Whether a copy of it was lost.
    pub(crate) fn is_lost(&self) -> bool {
        self.ends.iter().any(|end| end.lost.is_some())
    }

    /// Number of copies that are under way at first.
    pub(crate) fn copies(&self) -> usize {
        if self.is_doubled { 2 } else { 1 }
    }
}

/// What became of a copy of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CommandEnd {
    pub(crate) tick: Tick,
    /// Why it was lost; none if it was delivered.
    pub(crate) lost: Option<Cause>,
}

/// A link that was cut, in one direction.
#[derive(Debug, Clone)]
pub(crate) struct Cut {
    pub(crate) from: RobotName,
    pub(crate) to: RobotName,
    pub(crate) commands: bool,
    pub(crate) queries: bool,
    pub(crate) period: Period,
}

/// A fault of a robot's process.
#[derive(Debug, Clone)]
pub(crate) struct Fault {
    pub(crate) robot: RobotName,
    pub(crate) kind: FaultKind,
    pub(crate) period: Period,
}

/// Consecutive ticks that a robot missed.
#[derive(Debug, Clone)]
pub(crate) struct Missed {
    pub(crate) robot: RobotName,
    pub(crate) period: Period,
}

/// A robot took part no more, from a tick on.
#[derive(Debug, Clone)]
pub(crate) struct Absence {
    pub(crate) robot: RobotName,
    pub(crate) period: Period,
}

/// A robot joined after the beginning of the run.
#[derive(Debug, Clone)]
pub(crate) struct Joined {
    pub(crate) robot: RobotName,
    pub(crate) generation: Option<Generation>,
    pub(crate) tick: Tick,
}

/// Consecutive ticks in which a robot could not have queried another one.
#[derive(Debug, Clone)]
pub(crate) struct QueriesLost {
    pub(crate) from: RobotName,
    pub(crate) to: RobotName,
    pub(crate) because: Cause,
    pub(crate) period: Period,
}

/// A tick for which the clock was held.
#[derive(Debug, Clone)]
pub(crate) struct HeldUp {
    pub(crate) tick: Tick,
    pub(crate) awaited: Awaited,
}

/// What the scenario sets from a tick on.
#[derive(Debug, Clone)]
pub(crate) struct Change {
    pub(crate) tick: Tick,
    pub(crate) set: String,
    /// The change before it of the same part of the scenario, if there was one.
    pub(crate) before: Option<String>,
}

/// Everything in a window.
#[derive(Debug, Clone, Default)]
pub(crate) struct Items {
    pub(crate) bands: Vec<Band>,
    pub(crate) commands: Vec<Command>,
    pub(crate) cuts: Vec<Cut>,
    pub(crate) faults: Vec<Fault>,
    pub(crate) missed: Vec<Missed>,
    pub(crate) absences: Vec<Absence>,
    pub(crate) joined: Vec<Joined>,
    pub(crate) queries: Vec<QueriesLost>,
    pub(crate) held_up: Vec<HeldUp>,
    pub(crate) changes: Vec<Change>,
}

impl Items {
    /// Number of all of them.
    pub(crate) fn count(&self) -> usize {
        let states = self.bands.len() + self.missed.len() + self.absences.len() + self.joined.len();
        let network = self.commands.len() + self.cuts.len() + self.queries.len();
        states + network + self.faults.len() + self.held_up.len() + self.changes.len()
    }

    /// Adds those of another list.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.bands.append(&mut other.bands);
        self.commands.append(&mut other.commands);
        self.cuts.append(&mut other.cuts);
        self.faults.append(&mut other.faults);
        self.missed.append(&mut other.missed);
        self.absences.append(&mut other.absences);
        self.joined.append(&mut other.joined);
        self.queries.append(&mut other.queries);
        self.held_up.append(&mut other.held_up);
        self.changes.append(&mut other.changes);
    }
}
