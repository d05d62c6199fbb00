//! The state of the model: one simulator, processes of robots A and B, and what is under way between them.

use std::collections::BTreeMap;

/// Index of a robot's name: A, who sends a command to B in every tick, and B.
pub(crate) type Name = usize;
/// A.
pub(crate) const A: Name = 0;
/// B.
pub(crate) const B: Name = 1;
/// Both.
pub(crate) const NAMES: [Name; 2] = [A, B];

/// A rule of the protocol that a mutated model breaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Rule {
    /// The clock goes on when everybody has reported or has been given up.
    WaitsForAll,
    /// A barrier is looked at after everything that happens, not only after a report.
    LooksAfterAll,
    /// Only a report of the open epoch counts.
    ChecksEpoch,
    /// Only a report of the open tick counts.
    ChecksTick,
    /// Only a report of the present incarnation counts.
    ChecksGeneration,
    /// A robot does a tick once, however often its clock comes.
    DoesTicksOnce,
    /// A held clock is repeated.
    RepeatsClock,
    /// A robot that sees the clock it has answered repeats its report.
    RepeatsReport,
    /// And the commands of its last two ticks.
    RepeatsCommands,
    /// A newcomer uses no number that a former incarnation may have used.
    NumbersAnew,
    /// A newcomer is named by the clock that is open, where that still waits for it.
    NamesInOpenClock,
}

/// What a state must never show; found while a step is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Fault {
    /// A tick was closed without a verdict on a robot.
    NoVerdict,
    /// A command was recorded as delivered, or handed to one incarnation, twice.
    DeliveredTwice,
    /// A report of another epoch, tick or incarnation was counted.
    StaleCounted,
    /// A robot was handed a command that is not the one that was recorded under its number.
    OtherCommand,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Command {
    pub(crate) epoch: u8,
    pub(crate) tick: u8,
    pub(crate) seq: u8,
    /// The incarnation that sent it.
    pub(crate) generation: u8,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Clock {
    pub(crate) epoch: u8,
    pub(crate) tick: u8,
    /// Incarnation that takes part from this tick on; 0 for none.
    pub(crate) joined: [u8; 2],
    /// Command that arrives at B now: its number.
    pub(crate) named: Option<u8>,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Report {
    pub(crate) epoch: u8,
    pub(crate) tick: u8,
    pub(crate) generation: u8,
    pub(crate) sent: Option<Command>,
    pub(crate) is_missing: bool,
}

/// From a process to the simulator, in order.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Up {
    Report(Report),
    /// Its token came or went.
    Token(bool),
}

/// A process of a robot.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Process {
    pub(crate) name: Name,
    pub(crate) is_alive: bool,
    pub(crate) is_connected: bool,
    /// Whether the router knows its token.
    pub(crate) is_shown: bool,
    /// From its welcome.
    pub(crate) epoch: u8,
    pub(crate) generation: u8,
    pub(crate) is_seated: bool,
    /// Epoch and tick of the clock that it answers.
    pub(crate) current: (u8, u8),
    pub(crate) last_seq: u8,
    pub(crate) last: Option<Report>,
    /// A clock whose command has not come.
    pub(crate) waits: Option<Clock>,
    /// Commands that arrived and were not named, by number.
    pub(crate) held: BTreeMap<u8, Command>,
    /// Commands of its last two ticks.
    pub(crate) sent: Vec<Command>,
    /// Numbers of the commands that it was handed in this epoch.
    pub(crate) handed: Vec<u8>,
    pub(crate) up: Vec<Up>,
    pub(crate) down: Vec<Clock>,
    /// Commands on their way to B.
    pub(crate) out: Vec<Command>,
}

/// A robot as the simulator knows it (`server/member.rs`).
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(crate) struct Member {
    /// The process that joined last, counted from 1; 0 before the first.
    pub(crate) instance: usize,
    pub(crate) generation: u8,
    pub(crate) is_present: bool,
    pub(crate) is_pending: bool,
    pub(crate) is_seated: bool,
    pub(crate) is_lost: bool,
    pub(crate) has_returned: bool,
    pub(crate) has_predecessor: bool,
    pub(crate) missed: u8,
    /// Ghost: whether it was given up in the open tick.
    pub(crate) is_given_up: bool,
}

/// The simulator (`server.rs`, `simulation.rs`).
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Simulator {
    pub(crate) members: [Member; 2],
    pub(crate) epoch: u8,
    pub(crate) is_gathering: bool,
    pub(crate) is_over: bool,
    pub(crate) is_open: bool,
    pub(crate) clock: Clock,
    pub(crate) reports: [Option<Report>; 2],
    /// Number of the command that arrives at the next tick.
    pub(crate) underway: Option<u8>,
    /// Ghost: commands of this epoch as recorded, by number, and whether they were recorded as delivered.
    pub(crate) recorded: BTreeMap<u8, (u8, bool)>,
}

/// How often each thing may still go wrong.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(crate) struct Budget {
    /// Messages lost.
    pub(crate) losses: u8,
    /// Messages that come again, late.
    pub(crate) duplicates: u8,
    /// Clocks repeated while something is still under way.
    pub(crate) repeats: u8,
    /// Processes that die.
    pub(crate) crashes: u8,
    /// Links that break.
    pub(crate) cuts: u8,
    /// Processes started after the first two.
    pub(crate) starts: u8,
    /// Ticks in which somebody is given up (`on_late = "continue"`).
    pub(crate) lates: u8,
    /// New epochs.
    pub(crate) inits: u8,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct State {
    pub(crate) simulator: Simulator,
    pub(crate) processes: Vec<Process>,
    pub(crate) left: Budget,
    pub(crate) fault: Option<Fault>,
}
