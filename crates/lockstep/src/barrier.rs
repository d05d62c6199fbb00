//! The simulator's side: who takes part, and when a tick is complete.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use protocol::messages::{Clock, End, FaultKind, NEWS_FLAGS, OnLate, Presence, Reason};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::{IncarnationNotice, Membership, Outcome, Sent};
use crate::member::{Admission, Attendance, Lateness, Member, Turn};
use crate::rules::{Rule, Rules};

/// How long the barrier waits for what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Timing {
    /// After this long without a report people are told for whom the clock waits.
    pub announce: Duration,
    /// A held clock is repeated this often.
    pub repeat: Duration,
    /// A robot that was admitted declares its token within this time, or its place is free again.
    pub token: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            announce: Duration::from_millis(500),
            repeat: Duration::from_secs(2),
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
pub enum Output<R, C> {
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
    Complete(Outcome<R, C>),
    /// The clock goes on without this robot, and others may wait for its state as of the tick before: put that on its behalf.
    StandIn(RobotName),
    /// The clock is held: tell people for whom, or tell them again because that has changed.
    Held,
    /// A clock that was held goes on.
    Released,
    /// A robot is late and the run ends because of it.
    Aborted,
    /// Call [`Barrier::timer`] after this time.
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

/// What the barrier is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Phase {
    /// Robots of the roster are missing.
    Gathering,
    /// Every robot is connected, and tick 0 is not granted yet.
    Gathered,
    /// A tick is complete, and the next one is not granted yet.
    Between,
    /// A tick is open: reports are awaited.
    Open,
    /// The run is over.
    Over,
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

/// The simulator's side of the lock-step. `R` is the content of a report, `C` that of a command.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Barrier<R, C> {
    members: BTreeMap<RobotName, Member<R, C>>,
    lateness: Lateness,
    timing: Timing,
    max_commands: u32,
    phase: Phase,
    epoch: Epoch,
    tick: Tick,
    /// Robots for which the simulation has news of the open tick.
    news: BTreeSet<RobotName>,
    membership: Vec<Membership>,
    /// Who takes part in the tick, where it is executed again: then neither tokens nor time decide.
    attendance: Option<Attendance>,
    is_announced: bool,
    pub(crate) rules: Rules,
}

impl<R: Clone, C: Clone> Barrier<R, C> {
    /// A barrier for these robots, before the first epoch. A robot sends at most `max_commands` in a tick.
    #[must_use]
    pub fn new(
        roster: impl IntoIterator<Item = RobotName>,
        lateness: Lateness,
        timing: Timing,
        max_commands: u32,
    ) -> Self {
        Self {
            members: roster
                .into_iter()
                .map(|name| (name, Member::default()))
                .collect(),
            lateness,
            timing,
            max_commands,
            phase: Phase::Gathering,
            epoch: 0,
            tick: 0,
            news: BTreeSet::new(),
            membership: Vec::new(),
            attendance: None,
            is_announced: false,
            rules: Rules::default(),
        }
    }

    /// Begins an epoch: waits until every robot of the roster is connected, then asks for tick 0 by [`Output::Gathered`].
    /// An open tick is given up.
    pub fn gather(&mut self, epoch: Epoch, lateness: Lateness, out: &mut Vec<Output<R, C>>) {
        self.phase = Phase::Gathering;
        self.epoch = epoch;
        self.tick = 0;
        self.lateness = lateness;
        self.is_announced = false;
        self.news.clear();
        self.membership.clear();
        self.attendance = None;
        // Only what belongs to the epoch that is over is forgotten. Who is connected, and as which incarnation, stays: a robot keeps
        // its process and its token from epoch to epoch.
        for member in self.members.values_mut() {
            member.turn = Turn::default();
            member.fault = None;
            member.must_rejoin = false;
        }

        out.push(Output::SetTimer(Timer::Announce, self.timing.announce));
        self.check_all_joined(out);
    }

    /// Says who takes part in the tick that is opened next, because it is executed again. `None` if that is open, as usual.
    pub fn recall(&mut self, attendance: Option<Attendance>) {
        self.attendance = attendance;
    }

    /// Asks the process of a robot to join again, so that it takes part as a further incarnation from the next tick on.
    pub fn ask_to_rejoin(&mut self, robot: &RobotName) {
        if let Some(member) = self.members.get_mut(robot) {
            member.must_rejoin |= !member.is_coming;
        }
    }

    /// Grants a tick. `news` are the robots for which the simulation has something new.
    pub fn open(&mut self, tick: Tick, news: BTreeSet<RobotName>, out: &mut Vec<Output<R, C>>) {
        assert!(
            matches!(self.phase, Phase::Gathered | Phase::Between),
            "a tick is granted when the one before is complete"
        );
        self.phase = Phase::Open;
        self.tick = tick;
        self.news = news;
        self.membership.clear();
        self.is_announced = false;
        for (name, member) in &mut self.members {
            member.turn = Turn::default();
            let attendance = self.attendance.as_ref();
            if tick == 0 {
                member.begin_epoch();
                // Then a process took the place of another one while tick 0 was open. Here it is the first.
                if attendance.is_some_and(|recorded| recorded.joined.contains(name)) {
                    let joined = Membership::Joined(name.clone(), member.seated);
                    self.membership.push(joined);
                }
                continue;
            }
            // Where the tick is executed again, a successor waits until its predecessor's absence is over.
            let is_admitted = attendance.is_none_or(|recorded| recorded.joined.contains(name));
            if is_admitted && let Some(generation) = member.take_in() {
                self.membership
                    .push(Membership::Joined(name.clone(), generation));
            }
        }

        self.exclude_unavailable();
        // Robots that cannot report are excluded before the clock goes out, so that it does not wait for them even once. The tick may
        // be complete at once, without any report: where all robots are lost.
        self.grant(true, out);
        self.set_timers(out);
        self.settle(out);
    }

    /// A robot asks to take part as the process `instance`.
    ///
    /// # Errors
    /// [`Refused`] says why it may not.
    pub fn join(
        &mut self,
        name: &RobotName,
        instance: &str,
        out: &mut Vec<Output<R, C>>,
    ) -> Result<Admission, Refused> {
        if self.phase == Phase::Over {
            return Err(Refused::Ended);
        }
        let news_flag = self.news_flag(name);
        let Some(member) = self.members.get_mut(name) else {
            return Err(Refused::UnknownName);
        };
        if member.is_taken_from(instance) && self.rules.hold(Rule::RefusesTakenName) {
            return Err(Refused::NameTaken);
        }

        // The same process asks again: its answer was lost, it joins a further epoch, or it must join again.
        let is_new = member.instance.as_deref() != Some(instance);
        let is_further = if is_new {
            member.generation == 0 || self.rules.hold(Rule::CountsGenerations)
        } else {
            member.must_rejoin && self.rules.hold(Rule::CountsRejoining)
        };
        if is_further {
            member.generation += 1;
        }
        if is_new || member.must_rejoin {
            member.is_coming = member.seated > 0;
            member.must_rejoin = false;
        }
        if is_new {
            // What the predecessor has sent for the open tick counts only if all of it is here: its successor cannot complete it, and
            // messages of the old generation are stale from now on.
            member.instance = Some(Arc::from(instance));
            member.is_reserved = self.rules.hold(Rule::ReservesPlace);
            if self.rules.hold(Rule::DropsPredecessor) && !member.turn.is_complete(true) {
                let is_given_up = member.turn.is_given_up;
                member.turn = Turn {
                    is_given_up,
                    ..Turn::default()
                };
            }
            out.push(Output::SetTimer(
                Timer::Token(name.clone()),
                self.timing.token,
            ));
        }

        Ok(Admission {
            epoch: self.epoch,
            generation: member.generation,
            news_flag,
        })
    }

    /// A robot's liveliness token was declared or undeclared.
    pub fn token(&mut self, name: &RobotName, is_present: bool, out: &mut Vec<Output<R, C>>) {
        let takes_in_now = self.phase == Phase::Open && self.rules.hold(Rule::TakesInWhileOpen);
        let policy = self.lateness.of(name);
        let Some(member) = self.members.get_mut(name) else {
            out.push(Output::Ignored(Ignored::UnknownRobot, name.clone()));
            return;
        };

        member.is_present = is_present;
        if is_present {
            // From now on its place is free as soon as its token goes.
            member.is_reserved = false;
        }
        let is_awaited = is_awaited(self.phase, member, self.rules);
        if is_present && takes_in_now && is_awaited {
            // The open tick waits for it: it takes the place of a predecessor, or it is back and may have missed the clock.
            if let Some(generation) = member.take_in() {
                self.note_joined(name, generation);
            }
            self.repeat(out);
        }
        let is_decided = self.attendance.is_some();
        if !is_present && is_awaited && policy == OnLate::Continue && !is_decided {
            // It will not report in time.
            self.give_up(name);
            self.stand_in(name, out);
            self.settle(out);
        }
        if self.phase == Phase::Gathering {
            self.check_all_joined(out);
        }
        if self.is_announced {
            out.push(Output::Held);
        }
    }

    /// A command arrived: the one with this number among those that the robot sent in the tick of `stamp`.
    pub fn command(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        number: u32,
        command: Sent<C>,
        out: &mut Vec<Output<R, C>>,
    ) {
        let is_open = self.is_open_for(from, stamp);
        let max_commands = self.max_commands;
        let Some(member) = self.members.get_mut(from) else {
            out.push(Output::Ignored(Ignored::UnknownRobot, from.clone()));
            return;
        };
        if number == 0 || number > max_commands {
            out.push(Output::Ignored(Ignored::TooMany, from.clone()));
            return;
        }
        if !is_open {
            out.push(Output::Ignored(Ignored::Stale, from.clone()));
            return;
        }

        // The first one counts; a repetition has the same content. So repeating is idempotent, and a message that was delivered twice
        // or overtaken by its repetition changes nothing.
        member.turn.commands.entry(number).or_insert(command);
        if member.turn.report.is_some() {
            self.settle(out);
        }
    }

    /// A report arrived, which states how many commands the robot sent in its tick.
    pub fn report(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        commands: u32,
        report: R,
        out: &mut Vec<Output<R, C>>,
    ) {
        let is_open = self.is_open_for(from, stamp);
        let Some(member) = self.members.get_mut(from) else {
            out.push(Output::Ignored(Ignored::UnknownRobot, from.clone()));
            return;
        };
        if member.is_lost && stamp.generation == member.generation {
            out.push(Output::Ignored(Ignored::Lost, from.clone()));
            return;
        }
        if commands > self.max_commands {
            out.push(Output::Ignored(Ignored::TooMany, from.clone()));
            return;
        }
        if !is_open {
            out.push(Output::Ignored(Ignored::Stale, from.clone()));
            return;
        }

        // The report states how many commands belong to it. It completes the turn only when they are all here, in whatever order: on
        // one session they arrive before it, but any of them may have been lost and be repeated later.
        member.turn.waits_for = None;
        member.turn.report.get_or_insert((commands, report));
        let counts = self.rules.hold(Rule::CountsCommands);
        if member.turn.is_complete(counts) {
            self.settle(out);
        }
    }

    /// A robot cannot finish its tick because it waits for another robot's answer.
    pub fn waiting(
        &mut self,
        from: &RobotName,
        epoch: Epoch,
        tick: Tick,
        on: &RobotName,
        out: &mut Vec<Output<R, C>>,
    ) {
        if self.phase != Phase::Open || (epoch, tick) != (self.epoch, self.tick) {
            return;
        }
        let Some(member) = self.members.get_mut(from) else {
            out.push(Output::Ignored(Ignored::UnknownRobot, from.clone()));
            return;
        };

        member.turn.waits_for = Some(on.clone());
        self.stand_in(on, out);
        if self.is_announced {
            out.push(Output::Held);
        }
    }

    /// A timer that was set has fired.
    pub fn timer(&mut self, timer: &Timer, out: &mut Vec<Output<R, C>>) {
        let is_waiting = matches!(self.phase, Phase::Open | Phase::Gathering);
        match timer {
            Timer::Announce if is_waiting && !self.is_announced => {
                self.is_announced = true;
                out.push(Output::Held);
            }
            Timer::Repeat if self.phase == Phase::Open => {
                if self.rules.hold(Rule::RepeatsClock) {
                    self.repeat(out);
                }

                let roster: Vec<RobotName> = self.members.keys().cloned().collect();
                for name in roster {
                    self.stand_in(&name, out);
                }

                out.push(Output::SetTimer(Timer::Repeat, self.timing.repeat));
            }
            Timer::Deadline if self.phase == Phase::Open && self.attendance.is_none() => {
                self.judge_late(out);
            }
            Timer::Token(name) => {
                if let Some(member) = self.members.get_mut(name) {
                    member.is_reserved = false;
                }
            }
            _ => {}
        }
    }

    /// Puts the last clock and its news again.
    pub fn repeat(&mut self, out: &mut Vec<Output<R, C>>) {
        if matches!(self.phase, Phase::Open | Phase::Between) {
            self.grant(self.rules.hold(Rule::RepeatsNews), out);
        }
    }

    /// The scenario has brought a fault upon a robot's process, or that fault is over. While it lasts, the scenario decides
    /// what becomes of the robot, and no timer does.
    pub fn fault(&mut self, robot: &RobotName, fault: Option<FaultKind>) {
        if let Some(member) = self.members.get_mut(robot) {
            member.fault = fault;
        }
    }

    /// The run is over: returns the clock to put.
    pub fn end(&mut self, end: End) -> Clock {
        self.phase = Phase::Over;

        Clock {
            epoch: self.epoch,
            tick: self.tick,
            news: 0,
            end: Some(end),
        }
    }

    /// Changes what the clock does about late robots.
    pub fn set_lateness(&mut self, lateness: Lateness, out: &mut Vec<Output<R, C>>) {
        self.lateness = lateness;
        if self.phase == Phase::Open {
            self.set_timers(out);
        }
    }

    /// What the clock does about late robots.
    #[must_use]
    pub fn lateness(&self) -> &Lateness {
        &self.lateness
    }

    /// Whether this robot is one of the roster.
    #[must_use]
    pub fn has(&self, robot: &RobotName) -> bool {
        self.members.contains_key(robot)
    }

    /// The robots of the roster.
    pub fn roster(&self) -> impl Iterator<Item = &RobotName> {
        self.members.keys()
    }

    /// Whether a tick is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.phase == Phase::Open
    }

    /// Whether people have been told that the clock is held.
    #[must_use]
    pub fn is_announced(&self) -> bool {
        self.is_announced
    }

    /// The robot's incarnation, and whether it is connected.
    #[must_use]
    pub fn presence(&self, robot: &RobotName) -> (Generation, Presence) {
        let Some(member) = self.members.get(robot) else {
            return (0, Presence::Gone);
        };
        let presence = match (member.is_lost, member.is_present) {
            (true, _) => Presence::Lost,
            (false, true) => Presence::Here,
            (false, false) => Presence::Gone,
        };

        (member.generation, presence)
    }

    /// Whether a robot's process is connected.
    #[must_use]
    pub fn is_present(&self, robot: &RobotName) -> bool {
        self.members
            .get(robot)
            .is_some_and(|member| member.is_present)
    }

    /// Whether a process was admitted as this robot and its token is still awaited.
    #[must_use]
    pub fn is_reserved(&self, robot: &RobotName) -> bool {
        let member = self.members.get(robot);
        member.is_some_and(|member| member.is_reserved)
    }

    /// Whether this incarnation of a robot has missed the last ticks.
    #[must_use]
    pub fn is_behind(&self, robot: &RobotName, generation: Generation) -> bool {
        let member = self.members.get(robot);
        member.is_some_and(|member| member.missed > 0 && member.generation == generation)
    }

    /// Whether the scenario keeps the process of a robot from running.
    #[must_use]
    pub fn is_stopped(&self, robot: &RobotName) -> bool {
        self.members.get(robot).is_some_and(Member::is_stopped)
    }

    /// Whether a robot can take part in the next tick.
    #[must_use]
    pub fn is_back(&self, robot: &RobotName) -> bool {
        self.members
            .get(robot)
            .is_none_or(|member| member.is_back(self.rules))
    }

    /// The report of a robot for the open tick, if it is here.
    #[must_use]
    pub fn open_report(&self, robot: &RobotName) -> Option<&R> {
        let turn = &self.members.get(robot)?.turn;

        (self.phase == Phase::Open)
            .then_some(turn.report.as_ref())
            .flatten()
            .map(|(_, report)| report)
    }

    /// The robots for which the clock waits, and why.
    #[must_use]
    pub fn awaited(&self) -> Vec<(RobotName, Reason)> {
        let mut awaited = Vec::new();
        for (name, member) in &self.members {
            let reason = match self.phase {
                Phase::Gathering if !member.is_ready() => Reason::NotJoined,
                Phase::Open if !is_awaited(self.phase, member, self.rules) => continue,
                Phase::Open if !member.is_present => Reason::Gone,
                Phase::Open => match &member.turn.waits_for {
                    Some(other) => Reason::WaitsFor(other.clone()),
                    None => Reason::Silent,
                },
                _ => continue,
            };
            awaited.push((name.clone(), reason));
        }

        awaited
    }

    /// An incarnation takes part from the open tick on. One that was taken in before it and has not reported leaves no trace.
    fn note_joined(&mut self, name: &RobotName, generation: Generation) {
        self.membership
            .retain(|change| !matches!(change, Membership::Joined(robot, _) if robot == name));
        self.membership
            .push(Membership::Joined(name.clone(), generation));
    }

    fn check_all_joined(&mut self, out: &mut Vec<Output<R, C>>) {
        if self.members.values().all(Member::is_ready) {
            self.phase = Phase::Gathered;
            if std::mem::take(&mut self.is_announced) {
                out.push(Output::Released);
            }
            out.push(Output::Gathered);
        }
    }

    /// Has the state of a robot put that cannot answer, because the clock goes on without it in the open tick.
    fn stand_in(&self, robot: &RobotName, out: &mut Vec<Output<R, C>>) {
        let member = self.members.get(robot);
        if self.phase == Phase::Open && member.is_some_and(|member| member.turn.is_given_up) {
            out.push(Output::StandIn(robot.clone()));
        }
    }

    fn news_flag(&self, robot: &RobotName) -> u32 {
        let index = self.members.keys().position(|name| name == robot);

        1 << (index.unwrap_or_default() % NEWS_FLAGS)
    }

    /// Whether a message with this stamp counts in the open tick.
    fn is_open_for(&self, robot: &RobotName, stamp: Stamp) -> bool {
        let Some(member) = self.members.get(robot) else {
            return false;
        };
        let is_of_epoch = stamp.epoch == self.epoch || !self.rules.hold(Rule::ChecksEpoch);
        let is_of_tick = stamp.tick == self.tick || !self.rules.hold(Rule::ChecksTick);
        let is_of_generation =
            stamp.generation == member.generation || !self.rules.hold(Rule::ChecksGeneration);

        self.phase == Phase::Open
            && is_of_epoch
            && is_of_tick
            && is_of_generation
            && !member.is_lost
            && !(member.turn.is_given_up && self.rules.hold(Rule::GivesUpForGood))
    }

    /// Puts the news and the clock of the tick that was granted last.
    fn grant(&mut self, has_news: bool, out: &mut Vec<Output<R, C>>) {
        let mut named = BTreeMap::new();
        for (name, member) in &self.members {
            let notice = self.notice(member);
            if notice != IncarnationNotice::default() {
                named.insert(name.clone(), notice);
            }
        }

        // A robot does not run a tick whose clock says that it has news, and they do not come.
        let mut withheld = BTreeSet::new();
        for name in self.attendance.iter().flat_map(|recorded| &recorded.absent) {
            let notice = named.get(name).copied().unwrap_or_default();
            if notice.rejoin.is_none() {
                withheld.insert(name.clone());
            }
        }

        // A flag may belong to several robots. All of them get news then, so that each one that finds its flag set waits for something
        // that comes.
        let mut flags = 0;
        for (index, name) in self.members.keys().enumerate() {
            let has_own = self.news.contains(name) || named.contains_key(name);
            if has_own || withheld.contains(name) {
                flags |= 1_u32 << (index % NEWS_FLAGS);
            }
        }
        let mut news = Vec::new();
        for (index, name) in self.members.keys().enumerate() {
            let is_flagged = flags & (1 << (index % NEWS_FLAGS)) != 0;
            if has_news && is_flagged && !withheld.contains(name) {
                news.push((name.clone(), named.get(name).copied().unwrap_or_default()));
            }
        }

        out.push(Output::Grant {
            news,
            clock: Clock {
                epoch: self.epoch,
                tick: self.tick,
                news: if self.rules.hold(Rule::FlagsNews) {
                    flags
                } else {
                    0
                },
                end: None,
            },
        });
    }

    /// The incarnations that a robot's news name.
    fn notice(&self, member: &Member<R, C>) -> IncarnationNotice {
        let is_replacement = member.seated > 1 && self.rules.hold(Rule::NamesReplacement);
        let is_newcomer = self.tick > 0
            && !member.has_reported
            && !member.must_rejoin
            && self.rules.hold(Rule::NamesUntilReported);
        let asked = member.asked_to_rejoin();

        IncarnationNotice {
            joined: (is_replacement || is_newcomer).then_some(member.seated),
            rejoin: asked.filter(|_| self.rules.hold(Rule::AsksToRejoin)),
        }
    }

    fn set_timers(&self, out: &mut Vec<Output<R, C>>) {
        out.push(Output::SetTimer(Timer::Announce, self.timing.announce));
        out.push(Output::SetTimer(Timer::Repeat, self.timing.repeat));
        let has_deadline = self
            .members
            .keys()
            .any(|name| self.lateness.of(name) != OnLate::Wait);
        if has_deadline {
            out.push(Output::SetTimer(Timer::Deadline, self.lateness.deadline));
        }
    }

    /// Where the clock goes on without late robots, it does not wait for those that cannot report. It never waits for a report
    /// that would not count. Where the tick is executed again, its record says which robots those are.
    fn exclude_unavailable(&mut self) {
        let goes_on = self.rules.hold(Rule::GoesOnWithoutAbsent);
        let mut out = Vec::new();
        for (name, member) in &self.members {
            let policy = self.lateness.of(name);
            let is_out = match &self.attendance {
                Some(recorded) => recorded.absent.contains(name),
                None => member.is_out(self.tick) && policy == OnLate::Continue && goes_on,
            };
            if !member.is_lost && (is_out || member.must_rejoin) {
                out.push(name.clone());
            }
        }

        for name in out {
            self.give_up(&name);
        }
    }

    /// The deadline is over: the scenario decides, robot by robot, what follows.
    fn judge_late(&mut self, out: &mut Vec<Output<R, C>>) {
        let mut late = Vec::new();
        for (name, member) in &self.members {
            if is_awaited(self.phase, member, self.rules) {
                late.push((name.clone(), self.lateness.of(name)));
            }
        }
        if late.iter().any(|(_, policy)| *policy == OnLate::Abort) {
            out.push(Output::Aborted);
            return;
        }

        for (name, policy) in late {
            if policy == OnLate::Continue {
                self.give_up(&name);
                self.stand_in(&name, out);
            }
        }
        self.settle(out);
    }

    /// The clock goes on without a robot in the open tick, and from then on if it is lost.
    fn give_up(&mut self, name: &RobotName) {
        let lose_after = self.lateness.lose_after;
        let attendance = self.attendance.as_ref();
        let recorded = attendance.map(|recorded| recorded.lost.contains(name));
        let Some(member) = self.members.get_mut(name) else {
            return;
        };
        if member.miss(lose_after, recorded, self.rules) {
            self.membership.push(Membership::Lost(name.clone()));
        }
    }

    /// Completes the open tick if no robot is awaited any more.
    fn settle(&mut self, out: &mut Vec<Output<R, C>>) {
        if self.phase != Phase::Open {
            return;
        }
        let is_awaited = |member: &Member<R, C>| is_awaited(Phase::Open, member, self.rules);
        let has_report = self
            .members
            .values()
            .any(|member| member.turn.report.is_some());
        let goes_early = !self.rules.hold(Rule::WaitsForAll) && has_report;
        if self.members.values().any(is_awaited) && !goes_early {
            return;
        }

        // From here on nothing that arrives can change the tick: `is_open_for` asks for the phase, so reports and tokens that come
        // between two ticks are for the next one, or stale.
        self.phase = Phase::Between;
        if self.is_announced {
            self.is_announced = false;
            out.push(Output::Released);
        }
        let outcome = self.take_outcome();
        out.push(Output::Complete(outcome));
    }

    fn take_outcome(&mut self) -> Outcome<R, C> {
        let mut reports = BTreeMap::new();
        for (name, member) in &mut self.members {
            let turn = std::mem::take(&mut member.turn);
            let Some((stated, report)) = turn.report else {
                continue;
            };

            member.missed = 0;
            member.has_reported = true;
            // A predecessor may have sent more commands than the report that counts states.
            let mut commands = turn.commands;
            commands.retain(|number, _| *number <= stated);
            reports.insert(name.clone(), (report, commands.into_values().collect()));
        }
        self.membership.sort();

        Outcome {
            reports,
            membership: self.membership.clone(),
        }
    }
}

/// Whether the open tick waits for a robot.
fn is_awaited<R, C>(phase: Phase, member: &Member<R, C>, rules: Rules) -> bool {
    phase == Phase::Open
        && !member.is_lost
        && !member.turn.is_given_up
        && !member.turn.is_complete(rules.hold(Rule::CountsCommands))
}
