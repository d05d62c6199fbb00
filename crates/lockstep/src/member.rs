//! A robot of the roster as the barrier knows it: which process has its name, which incarnation takes part, and what
//! has come from it for the open tick.
//!
//! Name and participation are separate, because a process is admitted first and takes part later, when its token is
//! declared:
//!
//! ```text
//! registration   None --admit--> reserved --token, or timer--> not reserved --admit a successor--> reserved
//! participation  NotYet --begin_epoch--> Active --miss--> Lost; Active or Lost --take_in--> Active
//! successor      NotNeeded --miss, ask_to_rejoin--> Requested --admit--> Admitted --take_in--> NotNeeded
//!                NotNeeded --admit another process--> Admitted; Requested --end_epoch--> NotNeeded
//! reply          Expected --miss--> GivenUp; either --take_reply, end_epoch--> Expected
//! ```
//!
//! Until `take_in` the predecessor is the one that is active or lost, and its numbers are those of `Incarnation`;
//! messages are checked against the generation of the registration, so that those of a predecessor are stale from
//! `admit` on.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use protocol::messages::{FaultKind, OnLate};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::{IncarnationNotice, Sent};

/// What the clock does about robots that are late.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct LatePolicy {
    /// For robots that have no rule of their own.
    pub on_late: OnLate,
    /// For single robots.
    pub own: BTreeMap<RobotName, OnLate>,
    /// After how long without a report a robot is late.
    pub deadline: Duration,
    /// After this many missed ticks in a row a robot is lost, where the clock goes on without it.
    pub lose_after: u32,
}

impl LatePolicy {
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
    /// The process that joined last; it keeps the name from epoch to epoch.
    registration: Option<Registration>,
    /// Whether a token of this name is declared. It does not tell of which process: it may be that of a predecessor
    /// whose lease is not over, or of a process that has not asked this simulator to join yet.
    pub(crate) has_token: bool,
    participation: Participation,
    /// The fault that the scenario has brought upon its process.
    pub(crate) fault: Option<FaultKind>,
    reply: TickReply<R, C>,
}

/// A process that was admitted as a robot.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Registration {
    instance: Arc<str>,
    /// Its incarnation, from 1. Each further process gets the next one, and so does a process that joins again after
    /// the clock has gone on without it.
    generation: Generation,
    /// Whether no other process gets the name although no token is declared: it has just been admitted. Without this,
    /// two processes that start at once would replace each other until one of them is connected.
    is_reserved: bool,
}

/// Which incarnation takes part in the ticks of the epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Participation {
    /// No epoch has begun.
    NotYet,
    /// The clock waits for it.
    Active(Incarnation),
    /// The clock goes on without it. It stays so until tick 0 of the next epoch, or until a successor is taken in.
    Lost(Incarnation),
}

/// An incarnation that takes part, or took part last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Incarnation {
    generation: Generation,
    /// Whether it has reported in this epoch.
    has_reported: bool,
    /// Ticks in a row that it has missed.
    missed: u32,
    successor: Successor,
}

/// Whether another incarnation follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Successor {
    /// It goes on.
    NotNeeded,
    /// The clock has gone on without its process. How many old clocks that still answers is wall clock, so its state
    /// must not matter any more: it is asked to join again, and takes part as a further incarnation only.
    Requested,
    /// A further incarnation was admitted, the same process or another one, and takes part when its token is
    /// declared.
    Admitted,
}

/// What has come from a robot for the open tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum TickReply<R, C> {
    /// It counts, and the tick waits until it is complete.
    Expected(Received<R, C>),
    /// The clock goes on without it in this tick, whatever still arrives.
    GivenUp,
}

/// Messages of a robot for the open tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Received<R, C> {
    /// Its commands by number, from 1.
    pub(crate) commands: BTreeMap<u32, Sent<C>>,
    /// Its report, and how many commands that states.
    pub(crate) report: Option<(u32, R)>,
    /// The robot whose answer it waits for.
    pub(crate) waits_for: Option<RobotName>,
}

impl<R, C> Default for TickReply<R, C> {
    fn default() -> Self {
        Self::Expected(Received {
            commands: BTreeMap::new(),
            report: None,
            waits_for: None,
        })
    }
}

impl<R, C> Received<R, C> {
    /// Whether the report is here, and all commands that it states. The count makes the order of arrival irrelevant:
    /// any of the messages may have been lost and be repeated later.
    pub(crate) fn is_complete(&self) -> bool {
        let stated = self.report.as_ref().map(|(stated, _)| *stated);

        stated.is_some_and(|stated| self.commands.range(..=stated).count() == stated as usize)
    }

    /// How many commands the report states, and the lowest number that is missing.
    fn missing(&self) -> Option<(u32, u32)> {
        let (stated, _) = self.report.as_ref()?;
        let mut numbers = 1..=*stated;
        let number = numbers.find(|number| !self.commands.contains_key(number))?;

        Some((*stated, number))
    }
}

impl Incarnation {
    fn new(generation: Generation) -> Self {
        Self {
            generation,
            has_reported: false,
            missed: 0,
            successor: Successor::NotNeeded,
        }
    }
}

impl<R, C> Default for Member<R, C> {
    fn default() -> Self {
        Self {
            registration: None,
            has_token: false,
            participation: Participation::NotYet,
            fault: None,
            reply: TickReply::default(),
        }
    }
}

impl<R, C> Member<R, C> {
    /// The incarnation that was admitted last; 0 before the first.
    pub(crate) fn generation(&self) -> Generation {
        self.registration.as_ref().map_or(0, |own| own.generation)
    }

    /// Whether it can take part in a new epoch.
    pub(crate) fn is_ready(&self) -> bool {
        self.has_token && self.registration.is_some()
    }

    /// Whether a process was admitted and its token is awaited.
    pub(crate) fn is_reserved(&self) -> bool {
        self.registration
            .as_ref()
            .is_some_and(|own| own.is_reserved)
    }

    /// Its token was declared, or not in time: from now on the name is free when no token is declared.
    pub(crate) fn end_reservation(&mut self) {
        if let Some(own) = &mut self.registration {
            own.is_reserved = false;
        }
    }

    /// Whether another process has its name: connected, or admitted and about to declare its token.
    pub(crate) fn is_taken_from(&self, instance: &str) -> bool {
        let other = self
            .registration
            .as_ref()
            .filter(|own| *own.instance != *instance);

        other.is_some_and(|other| self.has_token || other.is_reserved)
    }

    /// Admits a process. Returns whether it is another one than before.
    ///
    /// A process that asks again is the same incarnation, so that it can ask as often as it likes: its answer was
    /// lost, or it joins a further epoch. It is a further one only if it must not go on.
    pub(crate) fn admit(&mut self, instance: &str) -> bool {
        let own = self.registration.as_ref();
        let is_new = own.is_none_or(|own| *own.instance != *instance);
        if is_new || self.must_rejoin() {
            self.registration = Some(Registration {
                instance: Arc::from(instance),
                generation: self.generation() + 1,
                // A process that joins again has its token declared, or is still expected to declare
                // it.
                is_reserved: is_new || self.is_reserved(),
            });
            if let Some(active) = self.incarnation_mut() {
                active.successor = Successor::Admitted;
            }
        }

        // What a predecessor has sent for the open tick counts only if all of it is here: its successor cannot
        // complete it, and messages of the old generation are stale from now on.
        if is_new
            && let TickReply::Expected(received) = &self.reply
            && !received.is_complete()
        {
            self.reply = TickReply::default();
        }

        is_new
    }

    fn incarnation(&self) -> Option<&Incarnation> {
        match &self.participation {
            Participation::NotYet => None,
            Participation::Active(own) | Participation::Lost(own) => Some(own),
        }
    }

    fn incarnation_mut(&mut self) -> Option<&mut Incarnation> {
        match &mut self.participation {
            Participation::NotYet => None,
            Participation::Active(own) | Participation::Lost(own) => Some(own),
        }
    }

    fn has_successor(&self, successor: Successor) -> bool {
        let own = self.incarnation();

        own.is_some_and(|own| own.successor == successor)
    }

    /// Whether the clock goes on without it until a further incarnation is taken in.
    pub(crate) fn is_lost(&self) -> bool {
        matches!(self.participation, Participation::Lost(_))
    }

    /// Whether its process takes part as a further incarnation only, and has not joined again yet.
    pub(crate) fn must_rejoin(&self) -> bool {
        self.has_successor(Successor::Requested)
    }

    /// Asks its process to join again, unless it has.
    pub(crate) fn ask_to_rejoin(&mut self) {
        if let Some(own) = self.incarnation_mut()
            && own.successor == Successor::NotNeeded
        {
            own.successor = Successor::Requested;
        }
    }

    /// The epoch is over. Who is connected, and as which incarnation, stays: a robot keeps its process and its token.
    pub(crate) fn end_epoch(&mut self) {
        self.reply = TickReply::default();
        self.fault = None;
        // A new epoch begins with an initial state, whatever the process has done before.
        if let Some(own) = self.incarnation_mut()
            && own.successor == Successor::Requested
        {
            own.successor = Successor::NotNeeded;
        }
    }

    /// The incarnation that was admitted last takes part from the open tick on, as if nothing had been before.
    /// Returns which it is.
    pub(crate) fn begin_epoch(&mut self) -> Generation {
        let generation = self.generation();
        self.participation = Participation::Active(Incarnation::new(generation));

        generation
    }

    /// Takes in the incarnation that was admitted, if there is one and its process is connected.
    pub(crate) fn take_in(&mut self) -> Option<Generation> {
        // Before its token, what it subscribes to may not be in effect: it would miss the clock that
        // waits for it.
        if !self.has_token || !self.has_successor(Successor::Admitted) {
            return None;
        }

        Some(self.begin_epoch())
    }

    /// Misses the open tick. Returns whether it is lost now; `recorded` is whether it was, where the tick is executed
    /// again.
    pub(crate) fn miss(&mut self, lose_after: u32, recorded: Option<bool>) -> bool {
        // Also for one that is lost already: what still arrives from it must not count.
        self.reply = TickReply::GivenUp;
        let Participation::Active(own) = &mut self.participation else {
            return false;
        };
        own.missed += 1;

        // While the scenario keeps its process stopped, its token goes when the lease is over: that is wall clock and
        // decides nothing.
        let is_hung = self.fault == Some(FaultKind::Hang);
        let is_gone = !self.has_token && !is_hung;
        let is_lost = recorded.unwrap_or(own.missed >= lose_after || is_gone);
        let lost = Participation::Lost(*own);

        if is_lost {
            self.participation = lost;
        }
        if is_lost || is_hung {
            self.ask_to_rejoin();
        }
        is_lost
    }

    /// Whether the next clock finds it able to take part.
    pub(crate) fn is_back(&self) -> bool {
        let can_go_on = match self.participation {
            Participation::NotYet => true,
            Participation::Active(own) => own.successor != Successor::Requested,
            Participation::Lost(own) => own.successor == Successor::Admitted,
        };

        self.has_token && can_go_on
    }

    /// Whether the last ticks were missed.
    pub(crate) fn is_behind(&self) -> bool {
        self.incarnation().is_some_and(|own| own.missed > 0)
    }

    /// Whether it cannot report for this tick: the scenario keeps its process from running, or it is not connected.
    pub(crate) fn is_out(&self, tick: Tick) -> bool {
        // All take part in tick 0: every robot was connected when it was asked for.
        tick > 0 && (self.is_stopped() || !self.has_token)
    }

    /// Whether the scenario keeps its process from running.
    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self.fault, Some(FaultKind::Hang | FaultKind::Crash))
    }

    /// The incarnations that its news of this tick name.
    pub(crate) fn notice(&self, tick: Tick) -> IncarnationNotice {
        let Some(own) = self.incarnation() else {
            return IncarnationNotice::default();
        };
        let must_rejoin = self.must_rejoin();
        // It does not begin before it is named, and any of these news may be lost.
        let is_newcomer = tick > 0 && !own.has_reported && !must_rejoin;
        // A predecessor may still run, cut off for as long as it likes: it ends when it finds its successor named.
        let is_replacement = own.generation > 1;

        IncarnationNotice {
            joined: (is_newcomer || is_replacement).then_some(own.generation),
            rejoin: (must_rejoin && self.has_token).then_some(own.generation),
        }
    }

    /// What has come from it, if further messages of this incarnation count.
    pub(crate) fn received(&mut self, generation: Generation) -> Option<&mut Received<R, C>> {
        let counts = !self.is_lost() && generation == self.generation();

        match &mut self.reply {
            TickReply::Expected(received) if counts => Some(received),
            _ => None,
        }
    }

    /// Whether the open tick waits for it.
    pub(crate) fn is_awaited(&self) -> bool {
        match &self.reply {
            TickReply::Expected(received) => !self.is_lost() && !received.is_complete(),
            TickReply::GivenUp => false,
        }
    }

    /// Whether the clock goes on without it in the open tick.
    pub(crate) fn is_given_up(&self) -> bool {
        matches!(self.reply, TickReply::GivenUp)
    }

    /// It waits for the answer of another robot.
    pub(crate) fn wait_for(&mut self, other: &RobotName) {
        if let TickReply::Expected(received) = &mut self.reply {
            received.waits_for = Some(other.clone());
        }
    }

    /// The robot whose answer it waits for.
    pub(crate) fn waits_for(&self) -> Option<&RobotName> {
        match &self.reply {
            TickReply::Expected(received) => received.waits_for.as_ref(),
            TickReply::GivenUp => None,
        }
    }

    /// Its report, if it is here.
    pub(crate) fn report(&self) -> Option<&R> {
        match &self.reply {
            TickReply::Expected(received) => received.report.as_ref().map(|(_, report)| report),
            TickReply::GivenUp => None,
        }
    }

    /// How many commands its report states, and the lowest number of those that the open tick waits for.
    pub(crate) fn missing_command(&self) -> Option<(u32, u32)> {
        match &self.reply {
            TickReply::Expected(received) => received.missing(),
            TickReply::GivenUp => None,
        }
    }

    /// The tick is complete: takes the report that counts, with the commands that it states.
    pub(crate) fn take_reply(&mut self) -> Option<(R, Vec<Sent<C>>)> {
        let TickReply::Expected(mut received) = std::mem::take(&mut self.reply) else {
            return None;
        };
        let (stated, report) = received.report?;
        if let Some(own) = self.incarnation_mut() {
            // Only ticks in a row make a robot lost.
            own.missed = 0;
            own.has_reported = true;
        }

        // A predecessor may have sent more commands than the report that counts states.
        received.commands.retain(|number, _| *number <= stated);
        Some((report, received.commands.into_values().collect()))
    }
}
