//! A robot of the roster as the barrier knows it: its process, whether it takes part, and its turn in the open tick.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use protocol::messages::{FaultKind, OnLate};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::Sent;
use crate::rules::{Rule, Rules};

/// What the clock does about robots that are late.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Lateness {
    /// For robots that have no rule of their own.
    pub on_late: OnLate,
    /// For single robots.
    pub own: BTreeMap<RobotName, OnLate>,
    /// After how long without a report a robot is late.
    pub deadline: Duration,
    /// After this many missed ticks in a row a robot is lost, where the clock goes on without it.
    pub lose_after: u32,
}

impl Lateness {
    /// What the clock does when this robot is late.
    #[must_use]
    pub fn of(&self, robot: &RobotName) -> OnLate {
        self.own.get(robot).copied().unwrap_or(self.on_late)
    }
}

/// What a robot is admitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Admission {
    /// The epoch.
    pub epoch: Epoch,
    /// Its incarnation.
    pub generation: Generation,
    /// Its flag in [`protocol::messages::Clock::news`].
    pub news_flag: u32,
}

/// Who takes part in a tick that is executed again, as its record has it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Attendance {
    /// Robots of which a further incarnation takes part from this tick on.
    pub joined: BTreeSet<RobotName>,
    /// Robots that do not run this tick.
    pub absent: BTreeSet<RobotName>,
    /// Those of them that are lost in it.
    pub lost: BTreeSet<RobotName>,
}

/// A robot of the roster.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Member<R, C> {
    /// The process that joined last.
    pub(crate) instance: Option<Arc<str>>,
    /// Whether that process has joined and its token is still awaited, so that its place is reserved.
    pub(crate) is_reserved: bool,
    /// Its incarnation; 0 before the first.
    pub(crate) generation: Generation,
    /// Whether its token is declared.
    pub(crate) is_present: bool,
    /// The incarnation that was taken in last; 0 before the first epoch. A further process is a further incarnation.
    pub(crate) seated: Generation,
    /// Whether the clock goes on without it.
    pub(crate) is_lost: bool,
    /// Whether a further incarnation takes part as soon as its token is declared.
    pub(crate) is_coming: bool,
    /// Whether the clock has gone on without its process, which takes part again as a further incarnation only: it was lost, or
    /// the scenario stopped it.
    pub(crate) must_rejoin: bool,
    /// Whether this incarnation has reported in this epoch since it was taken in.
    pub(crate) has_reported: bool,
    /// The fault that the scenario has brought upon its process.
    pub(crate) fault: Option<FaultKind>,
    /// Ticks in a row that it has missed.
    pub(crate) missed: u32,
    /// The open tick.
    pub(crate) turn: Turn<R, C>,
}

/// What has come from a robot for the open tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Turn<R, C> {
    /// Its commands by number, from 1.
    pub(crate) commands: BTreeMap<u32, Sent<C>>,
    /// Its report, and how many commands that states.
    pub(crate) report: Option<(u32, R)>,
    /// The robot whose answer it waits for.
    pub(crate) waits_for: Option<RobotName>,
    /// Whether the clock goes on without it in this tick.
    pub(crate) is_given_up: bool,
}

impl<R, C> Default for Turn<R, C> {
    fn default() -> Self {
        Self {
            commands: BTreeMap::new(),
            report: None,
            waits_for: None,
            is_given_up: false,
        }
    }
}

impl<R, C> Turn<R, C> {
    /// Whether the report is here, and all commands that it states.
    pub(crate) fn is_complete(&self, counts_commands: bool) -> bool {
        let Some((stated, _)) = self.report else {
            return false;
        };

        let arrived = self.commands.range(..=stated).count();
        arrived == stated as usize || !counts_commands
    }
}

impl<R, C> Default for Member<R, C> {
    fn default() -> Self {
        Self {
            instance: None,
            is_reserved: false,
            generation: 0,
            is_present: false,
            seated: 0,
            is_lost: false,
            is_coming: false,
            must_rejoin: false,
            has_reported: false,
            fault: None,
            missed: 0,
            turn: Turn::default(),
        }
    }
}

impl<R, C> Member<R, C> {
    /// Whether it can take part in a new epoch.
    pub(crate) fn is_ready(&self) -> bool {
        self.is_present && self.instance.is_some()
    }

    /// Whether another process has its place: connected, or admitted and about to declare its token.
    pub(crate) fn is_taken_from(&self, instance: &str) -> bool {
        let is_other = self.instance.as_deref().is_some_and(|own| own != instance);

        is_other && (self.is_present || self.is_reserved)
    }

    /// Takes part from tick 0 of an epoch.
    pub(crate) fn begin_epoch(&mut self) {
        self.seated = self.generation;
        self.is_lost = false;
        self.is_coming = false;
        self.must_rejoin = false;
        self.has_reported = false;
        self.missed = 0;
    }

    /// The incarnation that is to be taken in, if there is one and its process is connected.
    pub(crate) fn take_in(&mut self) -> Option<Generation> {
        if !(self.is_coming && self.is_present) {
            return None;
        }

        self.seated = self.generation;
        self.is_coming = false;
        self.is_lost = false;
        self.has_reported = false;
        self.missed = 0;
        Some(self.generation)
    }

    /// Misses the open tick. Returns whether it is lost now; `recorded` is whether it was, where the tick is executed again.
    pub(crate) fn miss(&mut self, lose_after: u32, recorded: Option<bool>, rules: Rules) -> bool {
        self.turn = Turn {
            is_given_up: true,
            ..Turn::default()
        };
        self.missed += 1;

        // While the scenario keeps its process stopped, its token goes when the lease is over: that is wall clock and decides
        // nothing.
        let is_hung = self.fault == Some(FaultKind::Hang) && rules.hold(Rule::HangDecides);
        let is_gone = !self.is_present && !is_hung;
        self.is_lost = recorded.unwrap_or(self.missed >= lose_after || is_gone);

        // How many old clocks a stopped process answers when it goes on is wall clock: its state must not matter any more.
        let was_stopped = self.fault == Some(FaultKind::Hang) && rules.hold(Rule::RejoinsAfterHang);
        let has_successor = self.generation != self.seated;
        self.must_rejoin |= (self.is_lost || was_stopped) && !has_successor;
        self.is_lost
    }

    /// Whether the next clock finds it able to take part.
    pub(crate) fn is_back(&self, rules: Rules) -> bool {
        let has_rejoined = !self.must_rejoin || !rules.hold(Rule::AwaitsRejoining);

        self.is_present && has_rejoined && (!self.is_lost || self.is_coming)
    }

    /// Whether it cannot report for this tick: the scenario keeps its process from running, or it is not connected.
    pub(crate) fn is_out(&self, tick: Tick) -> bool {
        tick > 0 && (self.is_stopped() || !self.is_present)
    }

    /// Whether the scenario keeps its process from running.
    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self.fault, Some(FaultKind::Hang | FaultKind::Crash))
    }

    /// The incarnation whose process is asked to join again, if it is connected.
    pub(crate) fn asked_to_rejoin(&self) -> Option<Generation> {
        (self.must_rejoin && self.is_present).then_some(self.generation)
    }
}
