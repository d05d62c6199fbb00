//! The simulator's side: who takes part, and when a tick is complete.
//!
//! Every input is checked against the open tick before it changes anything, and counts once. So the caller may feed
//! messages in any order, late, twice or not at all: what is lost is asked for again by repeating the clock
//! ([`Barrier::repeat`]), and what a tick comes to depends on who reported what, never on when.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;

use protocol::messages::{Clock, End, FaultKind, NEWS_FLAGS, OnLate, Presence, Reason};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::{IncarnationNotice, Membership, Sent, TickOutcome};
use crate::member::{Admission, Attendance, LatePolicy, Member, Received};
use crate::outputs::{BarrierOutput, Ignored, MissingCommand, Refused, Stamp, Timer, Timing};
use crate::repetition::Repetition;

/// What the barrier is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum BarrierPhase {
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

/// The simulator's side of the lock-step. `R` is the content of a report, `C` that of a command.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Barrier<R, C> {
    members: BTreeMap<RobotName, Member<R, C>>,
    lateness: LatePolicy,
    timing: Timing,
    max_commands: u32,
    phase: BarrierPhase,
    epoch: Epoch,
    tick: Tick,
    /// Robots for which the simulation has news of the open tick.
    news: BTreeSet<RobotName>,
    membership: Vec<Membership>,
    /// Who takes part in the tick, where it is executed again: then neither tokens nor time decide.
    attendance: Option<Attendance>,
    is_announced: bool,
    repetition: Repetition,
    straggler: Straggler,
}

/// A robot for which the open tick may still wait: where the search for one begins, so that the reports of a tick do not cost the square
/// of the roster. It decides nothing, so barriers that differ in nothing else are equal.
#[derive(Debug, Clone, Eq, Default)]
struct Straggler(Option<RobotName>);

impl PartialEq for Straggler {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl std::hash::Hash for Straggler {
    fn hash<H: std::hash::Hasher>(&self, _: &mut H) {}
}

impl<R, C> Barrier<R, C> {
    /// A barrier for these robots, before the first epoch. A robot sends at most `max_commands` in a tick.
    #[must_use]
    pub fn new(
        roster: impl IntoIterator<Item = RobotName>,
        lateness: LatePolicy,
        timing: Timing,
        max_commands: u32,
    ) -> Self {
        let mut members = BTreeMap::new();
        for name in roster {
            members.insert(name, Member::default());
        }

        Self {
            members,
            lateness,
            timing,
            max_commands,
            phase: BarrierPhase::Gathering,
            epoch: 0,
            tick: 0,
            news: BTreeSet::new(),
            membership: Vec::new(),
            attendance: None,
            is_announced: false,
            repetition: Repetition::new(timing),
            straggler: Straggler::default(),
        }
    }

    /// Begins an epoch: waits until every robot of the roster is connected, then asks for tick 0 by
    /// [`BarrierOutput::Gathered`]. An open tick is given up.
    pub fn gather(
        &mut self,
        epoch: Epoch,
        lateness: LatePolicy,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        self.phase = BarrierPhase::Gathering;
        self.epoch = epoch;
        self.tick = 0;
        self.lateness = lateness;
        self.is_announced = false;
        self.membership.clear();
        self.attendance = None;
        for member in self.members.values_mut() {
            member.end_epoch();
        }

        // Names and tokens outlive an epoch. Where all robots are connected already, no further token
        // comes, so the barrier looks for itself.
        out.push(BarrierOutput::SetTimer(
            Timer::Announce,
            self.timing.announce,
        ));
        self.check_all_joined(out);
    }

    /// Says who takes part in the tick that is opened next, because it is executed again. `None` if that is open, as
    /// usual.
    pub fn recall(&mut self, attendance: Option<Attendance>) {
        self.attendance = attendance;
    }

    /// Asks the process of a robot to join again, so that it takes part as a further incarnation from the next tick
    /// on.
    pub fn ask_to_rejoin(&mut self, robot: &RobotName) {
        if let Some(member) = self.members.get_mut(robot) {
            member.ask_to_rejoin();
        }
    }

    /// Grants a tick. `news` are the robots for which the simulation has something new.
    pub fn open(
        &mut self,
        tick: Tick,
        news: BTreeSet<RobotName>,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        assert!(
            matches!(self.phase, BarrierPhase::Gathered | BarrierPhase::Between),
            "a tick is granted when the one before is complete"
        );
        self.phase = BarrierPhase::Open;
        self.tick = tick;
        self.news = news;

        // Successors are taken in before anyone is excluded: one that replaces a lost robot is waited
        // for in this very tick.
        for (name, member) in &mut self.members {
            let attendance = self.attendance.as_ref();
            let recorded = attendance.map(|recorded| recorded.joined.contains(name));
            let joined = if tick == 0 {
                // All take part. Only where a process took the place of another one while tick 0 was open does the
                // record say so; here it is the first.
                let generation = member.begin_epoch();
                recorded.unwrap_or(false).then_some(generation)
            } else if recorded.unwrap_or(true) {
                member.take_in()
            } else {
                // Where the tick is executed again, a successor waits until its predecessor's absence is over.
                None
            };
            if let Some(generation) = joined {
                let joined = Membership::Joined(name.clone(), generation);
                self.membership.push(joined);
            }
        }

        // Their welcome came before this clock, and they may still be reading it.
        self.repetition.begin(!self.membership.is_empty());

        // Robots that cannot report are excluded before the clock goes out, so that it does not wait for them even
        // once. The tick may be complete at once, without any report: where all robots are lost.
        self.exclude_unavailable();
        self.grant(out);
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
        out: &mut Vec<BarrierOutput<R, C>>,
    ) -> Result<Admission, Refused> {
        if self.phase == BarrierPhase::Over {
            return Err(Refused::Ended);
        }
        let index = self.members.keys().position(|own| own == name);
        let (Some(index), Some(member)) = (index, self.members.get_mut(name)) else {
            return Err(Refused::UnknownName);
        };
        if member.is_taken_from(instance) {
            return Err(Refused::NameTaken);
        }

        // Even while a tick is open: it takes part from its token on ([`Self::token`]), and until then the tick
        // waits.
        if member.admit(instance) {
            let timer = Timer::Token(name.clone());
            out.push(BarrierOutput::SetTimer(timer, self.timing.token));
        }

        // The flag is that of the place in the roster, which is the same for every incarnation.
        let admission = Admission {
            epoch: self.epoch,
            generation: member.generation(),
            news_flag: news_flag(index),
        };
        // The open tick waits for what is welcomed here, so its clock has been put already: in a new epoch, which robots find
        // out by that clock. A robot without a token gets the clock again when it declares it.
        let is_open = self.phase == BarrierPhase::Open;
        if is_open && member.has_token && member.is_awaited() && self.repetition.hasten() {
            // By a timer, and so behind the welcome: that is on its way before any timer is looked at.
            self.set_repeat_timer(out);
        }
        // Its token may have been seen before it asked.
        if self.phase == BarrierPhase::Gathering {
            self.check_all_joined(out);
        }

        Ok(admission)
    }

    /// A robot's liveliness token was declared or undeclared.
    pub fn token(
        &mut self,
        name: &RobotName,
        is_present: bool,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        let is_open = self.phase == BarrierPhase::Open;
        let Some(member) = self.members.get_mut(name) else {
            out.push(BarrierOutput::Ignored(Ignored::UnknownRobot, name.clone()));
            return;
        };

        // Noted in every phase: ticks and epochs that begin later ask for it.
        member.has_token = is_present;
        let is_awaited = is_open && member.is_awaited();
        if is_present {
            member.end_reservation();
            if is_awaited {
                // The open tick waits for it: it takes the place of a predecessor, or it is back and may have missed
                // the clock. Everything that it subscribes to is in effect, because it declares its token last.
                if let Some(generation) = member.take_in() {
                    self.note_joined(name, generation);
                }
                self.repeat(out);
            }
        } else if is_awaited
            && self.attendance.is_none()
            && self.lateness.of(name) == OnLate::Continue
        {
            // It will not report in time. Under the other policies the tick stays open for it, until it is back or its deadline is over.
            self.give_up(name, self.lateness.lose_after);
            self.stand_in(name, out);
            self.settle(out);
        }

        if self.phase == BarrierPhase::Gathering {
            self.check_all_joined(out);
        }
        // People were told for whom the clock waits, and that may have changed.
        if self.is_announced {
            out.push(BarrierOutput::Held);
        }
    }

    /// A command arrived: the one with this number among those that the robot sent in the tick of `stamp`.
    pub fn command(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        number: u32,
        command: Sent<C>,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        let is_allowed = (1..=self.max_commands).contains(&number);

        match self.received(from, stamp, is_allowed) {
            Ok(received) => {
                // The first one counts; a repetition has the same content. So repeating is idempotent, and a message
                // that was delivered twice or overtaken by its repetition changes nothing.
                received.commands.entry(number).or_insert(command);
                if received.is_complete() {
                    self.settle(out);
                }
            }
            Err(ignored) => out.push(BarrierOutput::Ignored(ignored, from.clone())),
        }
    }

    /// A report arrived, which states how many commands the robot sent in its tick.
    pub fn report(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        commands: u32,
        report: R,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        // It would be refused as stale below. In the log these are two things: the robot is right and
        // answers in vain, or the message is late.
        let is_lost = self.is_member(from, |member| {
            member.is_lost() && member.generation() == stamp.generation
        });
        if is_lost {
            out.push(BarrierOutput::Ignored(Ignored::Lost, from.clone()));
            return;
        }

        match self.received(from, stamp, commands <= self.max_commands) {
            Ok(received) => {
                // Its tick is done, so it waits for no other robot any more. As for commands, the first
                // report counts.
                received.waits_for = None;
                received.report.get_or_insert((commands, report));
                if received.is_complete() {
                    self.settle(out);
                }
            }
            Err(ignored) => out.push(BarrierOutput::Ignored(ignored, from.clone())),
        }
    }

    /// A robot cannot finish its tick because it waits for another robot's answer.
    pub fn waiting(
        &mut self,
        from: &RobotName,
        epoch: Epoch,
        tick: Tick,
        on: &RobotName,
        out: &mut Vec<BarrierOutput<R, C>>,
    ) {
        if !self.is_open_at(epoch, tick) {
            return;
        }
        let Some(member) = self.members.get_mut(from) else {
            out.push(BarrierOutput::Ignored(Ignored::UnknownRobot, from.clone()));
            return;
        };

        // Of whichever incarnation: it says for whom the clock waits in the end, and completes nothing.
        member.wait_for(on);
        // The robot that is asked may be one without which the clock goes on: then its state is put
        // now, and again with each repetition of the clock.
        self.stand_in(on, out);
        if self.is_announced {
            out.push(BarrierOutput::Held);
        }
    }

    /// A timer that was set has fired. It may be of a tick that is over: a timer is replaced, never withdrawn, so it
    /// decides nothing that the state does not bear out.
    pub fn timer(&mut self, timer: &Timer, out: &mut Vec<BarrierOutput<R, C>>) {
        let is_open = self.phase == BarrierPhase::Open;

        match timer {
            Timer::Announce => {
                let is_waiting = is_open || self.phase == BarrierPhase::Gathering;
                if is_waiting && !self.is_announced {
                    self.is_announced = true;
                    out.push(BarrierOutput::Held);
                }
            }
            Timer::Repeat if is_open => {
                self.repeat(out);
                // A state that was put on a robot's behalf may have been lost like any other message.
                for name in self.members.keys() {
                    self.stand_in(name, out);
                }
                self.repetition.advance();
                self.set_repeat_timer(out);
            }
            // Where a tick is executed again, its record says who was late, not the time that it takes
            // now.
            Timer::Deadline if is_open && self.attendance.is_none() => self.judge_late(out),
            Timer::Repeat | Timer::Deadline => {}
            // Set anew for each process that is admitted, so it is that of the last one. Where its token came in time, nothing is
            // reserved any more.
            Timer::Token(name) => {
                if let Some(member) = self.members.get_mut(name) {
                    member.end_reservation();
                }
            }
        }
    }

    /// Puts the last clock and its news again. Between two ticks that is the clock of the complete one: it reaches a
    /// robot that is asked to join again, and changes nothing for any other.
    pub fn repeat(&mut self, out: &mut Vec<BarrierOutput<R, C>>) {
        if matches!(self.phase, BarrierPhase::Open | BarrierPhase::Between) {
            self.grant(out);
        }
    }

    /// The scenario has brought a fault upon a robot's process, or that fault is over. While it lasts, the scenario
    /// decides what becomes of the robot, and no timer does.
    pub fn fault(&mut self, robot: &RobotName, fault: Option<FaultKind>) {
        // Only noted: what follows is decided where a tick opens, or a robot misses one.
        if let Some(member) = self.members.get_mut(robot) {
            member.fault = fault;
        }
    }

    /// The run is over: returns the clock to put.
    pub fn end(&mut self, end: End) -> Clock {
        self.phase = BarrierPhase::Over;

        Clock {
            epoch: self.epoch,
            tick: self.tick,
            end: Some(end),
            ..Clock::default()
        }
    }

    /// Changes what the clock does about late robots. An open tick no longer waits for robots that cannot report, if the
    /// clock goes on without them from now on.
    pub fn set_lateness(&mut self, lateness: LatePolicy, out: &mut Vec<BarrierOutput<R, C>>) {
        self.lateness = lateness;
        if self.phase != BarrierPhase::Open {
            return;
        }

        // The tick that is open may have no deadline yet, if all robots were waited for.
        self.set_timers(out);
        let mut out_of_reach = Vec::new();
        for (name, member) in &self.members {
            if member.is_out(self.tick) {
                out_of_reach.push(name.clone());
            }
        }
        self.give_up_awaited(out_of_reach, out);
    }

    /// The process of this robot is known to be stopped: where the clock goes on without late robots, the open tick does not
    /// wait for the deadline.
    pub fn note_stopped(&mut self, robot: &RobotName, out: &mut Vec<BarrierOutput<R, C>>) {
        if self.phase == BarrierPhase::Open {
            self.give_up_awaited(vec![robot.clone()], out);
        }
    }

    /// Gives up those of the robots for which the open tick waits although the clock goes on without late robots. They are
    /// lost: ticks that follow do not wait for them either.
    fn give_up_awaited(&mut self, robots: Vec<RobotName>, out: &mut Vec<BarrierOutput<R, C>>) {
        // Where the tick is executed again, its record says who misses it.
        if self.attendance.is_some() {
            return;
        }

        for name in robots {
            let goes_on = self.lateness.of(&name) == OnLate::Continue;
            if goes_on && self.is_member(&name, Member::is_awaited) {
                self.give_up(&name, 1);
                self.stand_in(&name, out);
            }
        }
        self.settle(out);
    }

    /// What the clock does about late robots.
    #[must_use]
    pub fn lateness(&self) -> &LatePolicy {
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
        self.phase == BarrierPhase::Open
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
        let presence = match (member.is_lost(), member.has_token) {
            (true, _) => Presence::Lost,
            (false, true) => Presence::Here,
            (false, false) => Presence::Gone,
        };

        (member.generation(), presence)
    }

    /// Whether a robot's process is connected.
    #[must_use]
    pub fn is_present(&self, robot: &RobotName) -> bool {
        self.is_member(robot, |member| member.has_token)
    }

    /// Whether a process was admitted as this robot and its token is still awaited.
    #[must_use]
    pub fn is_reserved(&self, robot: &RobotName) -> bool {
        self.is_member(robot, Member::is_reserved)
    }

    /// Whether this incarnation of a robot has missed the last ticks.
    #[must_use]
    pub fn is_behind(&self, robot: &RobotName, generation: Generation) -> bool {
        self.is_member(robot, |member| {
            member.is_behind() && member.generation() == generation
        })
    }

    /// Whether the scenario keeps the process of a robot from running.
    #[must_use]
    pub fn is_stopped(&self, robot: &RobotName) -> bool {
        self.is_member(robot, Member::is_stopped)
    }

    /// Whether a robot can take part in the next tick.
    #[must_use]
    pub fn is_back(&self, robot: &RobotName) -> bool {
        self.members.get(robot).is_none_or(Member::is_back)
    }

    /// The report of a robot for the open tick, if it is here.
    #[must_use]
    pub fn open_report(&self, robot: &RobotName) -> Option<&R> {
        let report = self.members.get(robot)?.report();

        report.filter(|_| self.is_open())
    }

    /// The robots for which the clock waits, and why.
    #[must_use]
    pub fn awaited(&self) -> Vec<(RobotName, Reason)> {
        let mut awaited = Vec::new();
        for (name, member) in &self.members {
            let reason = match self.phase {
                BarrierPhase::Gathering if !member.is_ready() => Reason::NotJoined,
                BarrierPhase::Open if member.is_awaited() => match member.waits_for() {
                    _ if !member.has_token => Reason::Gone,
                    Some(other) => Reason::WaitsFor(other.clone()),
                    None => Reason::Silent,
                },
                _ => continue,
            };
            awaited.push((name.clone(), reason));
        }

        awaited
    }

    /// For each robot that has reported in the open tick, the first command that its report counts and that is not here.
    #[must_use]
    pub fn missing_commands(&self) -> Vec<MissingCommand> {
        let mut missing = Vec::new();
        for (name, member) in &self.members {
            if self.is_open()
                && let Some((counted, number)) = member.missing_command()
            {
                missing.push(MissingCommand {
                    robot: name.clone(),
                    counted,
                    number,
                });
            }
        }

        missing
    }

    fn is_member(&self, robot: &RobotName, is: impl FnOnce(&Member<R, C>) -> bool) -> bool {
        self.members.get(robot).is_some_and(is)
    }

    /// Whether this tick is open.
    #[must_use]
    pub fn is_open_at(&self, epoch: Epoch, tick: Tick) -> bool {
        self.phase == BarrierPhase::Open && (epoch, tick) == (self.epoch, self.tick)
    }

    /// What has come from a robot for the open tick, if a message with this stamp counts.
    fn received(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        is_allowed: bool,
    ) -> Result<&mut Received<R, C>, Ignored> {
        let is_open = self.is_open_at(stamp.epoch, stamp.tick);
        let member = self.members.get_mut(from).ok_or(Ignored::UnknownRobot)?;
        if !is_allowed {
            return Err(Ignored::TooMany);
        }

        let received = member.received(stamp.generation);
        received.filter(|_| is_open).ok_or(Ignored::Stale)
    }

    /// An incarnation takes part from the open tick on. One that was taken in before it and has not reported leaves
    /// no trace.
    fn note_joined(&mut self, name: &RobotName, generation: Generation) {
        self.membership
            .retain(|change| !matches!(change, Membership::Joined(robot, _) if robot == name));
        self.membership
            .push(Membership::Joined(name.clone(), generation));
    }

    fn check_all_joined(&mut self, out: &mut Vec<BarrierOutput<R, C>>) {
        if self.members.values().all(Member::is_ready) {
            // A robot that leaves from here on does not undo it: tick 0 is opened with all, and waits for it.
            self.phase = BarrierPhase::Gathered;
            // People are told that the clock goes on only if they were told that it did not.
            if std::mem::take(&mut self.is_announced) {
                out.push(BarrierOutput::Released);
            }
            out.push(BarrierOutput::Gathered);
        }
    }

    /// Has the state of a robot put that cannot answer, because the clock goes on without it in the open tick.
    fn stand_in(&self, robot: &RobotName, out: &mut Vec<BarrierOutput<R, C>>) {
        // Putting it more than once is harmless: a robot keeps the first state that it gets for a tick.
        if self.phase == BarrierPhase::Open && self.is_member(robot, Member::is_given_up) {
            out.push(BarrierOutput::StandIn(robot.clone()));
        }
    }

    /// Puts the news and the clock of the tick that was granted last. The news are composed anew each time: since the
    /// clock was put last, a robot may have joined, or been asked to.
    fn grant(&self, out: &mut Vec<BarrierOutput<R, C>>) {
        let mut flags = 0;
        for (index, (name, member)) in self.members.iter().enumerate() {
            let is_named = member.notice(self.tick) != IncarnationNotice::default();
            if is_named || self.news.contains(name) || self.is_withheld(name, member) {
                flags |= news_flag(index);
            }
        }

        // A flag may belong to several robots. All of them get news then, so that each one that finds its flag set
        // waits for something that comes.
        let mut news = Vec::new();
        for (index, (name, member)) in self.members.iter().enumerate() {
            let is_flagged = flags & news_flag(index) != 0;
            if is_flagged && !self.is_withheld(name, member) {
                news.push((name.clone(), member.notice(self.tick)));
            }
        }

        out.push(BarrierOutput::Grant {
            news,
            clock: Clock {
                epoch: self.epoch,
                tick: self.tick,
                news: flags,
                ..Clock::default()
            },
        });
    }

    /// Whether a robot is kept from running the tick: it does not run one whose clock says that it has news, and they
    /// do not come. A robot that is asked to join again does not run it either, and must get to know.
    fn is_withheld(&self, name: &RobotName, member: &Member<R, C>) -> bool {
        let attendance = self.attendance.as_ref();
        let is_absent = attendance.is_some_and(|recorded| recorded.absent.contains(name));

        is_absent && member.notice(self.tick).rejoin.is_none()
    }

    fn set_timers(&self, out: &mut Vec<BarrierOutput<R, C>>) {
        // Each replaces the one of the tick before, so none has to be withdrawn when a tick is
        // complete.
        out.push(BarrierOutput::SetTimer(
            Timer::Announce,
            self.timing.announce,
        ));
        self.set_repeat_timer(out);
        let has_deadline = self
            .members
            .keys()
            .any(|name| self.lateness.of(name) != OnLate::Wait);
        if has_deadline {
            out.push(BarrierOutput::SetTimer(
                Timer::Deadline,
                self.lateness.deadline,
            ));
        }
    }

    fn set_repeat_timer(&self, out: &mut Vec<BarrierOutput<R, C>>) {
        out.push(BarrierOutput::SetTimer(
            Timer::Repeat,
            self.repetition.next(),
        ));
    }

    /// Where the clock goes on without late robots, it does not wait for those that cannot report. It never waits for
    /// a report that would not count. Where the tick is executed again, its record says which robots those are.
    fn exclude_unavailable(&mut self) {
        let mut unavailable = Vec::new();
        for (name, member) in &self.members {
            let is_out = match &self.attendance {
                Some(recorded) => recorded.absent.contains(name),
                // Under `wait` and `abort` the tick stays open for it.
                None => member.is_out(self.tick) && self.lateness.of(name) == OnLate::Continue,
            };
            if !member.is_lost() && (is_out || member.must_rejoin()) {
                unavailable.push(name.clone());
            }
        }

        for name in unavailable {
            self.give_up(&name, self.lateness.lose_after);
        }
    }

    /// The deadline is over: the scenario decides, robot by robot, what follows.
    fn judge_late(&mut self, out: &mut Vec<BarrierOutput<R, C>>) {
        // All are looked at before anything is done: whether the run ends must not depend on the order
        // of names.
        let mut late = Vec::new();
        for (name, member) in &self.members {
            if member.is_awaited() {
                late.push((name.clone(), self.lateness.of(name)));
            }
        }
        if late.iter().any(|(_, policy)| *policy == OnLate::Abort) {
            out.push(BarrierOutput::Aborted);
            return;
        }

        for (name, policy) in late {
            if policy == OnLate::Continue {
                self.give_up(&name, self.lateness.lose_after);
                self.stand_in(&name, out);
            }
        }
        self.settle(out);
    }

    /// The clock goes on without a robot in the open tick, and from then on if it is lost: that is after `lose_after` ticks that
    /// it has missed in a row, or by the record of a run that is executed again.
    fn give_up(&mut self, name: &RobotName, lose_after: u32) {
        let attendance = self.attendance.as_ref();
        let recorded = attendance.map(|recorded| recorded.lost.contains(name));
        if let Some(member) = self.members.get_mut(name)
            && member.miss(lose_after, recorded)
        {
            self.membership.push(Membership::Lost(name.clone()));
        }
    }

    /// Whether the open tick still waits for a robot.
    fn is_any_awaited(&mut self) -> bool {
        // From the last one that was found: robots before it have mostly answered, and mostly robots answer in the order of names.
        let later = self.straggler.0.as_ref().and_then(|last| {
            let from_last = (Bound::Included(last), Bound::Unbounded);
            let mut from_last = self.members.range::<RobotName, _>(from_last);
            from_last.find(|(_, member)| member.is_awaited())
        });
        // Only this shows that none is left: one before may be awaited since, because a successor of a lost robot was taken in.
        let mut all = self.members.iter();
        let found = later.or_else(|| all.find(|(_, member)| member.is_awaited()));

        self.straggler = Straggler(found.map(|(name, _)| name.clone()));
        self.straggler.0.is_some()
    }

    /// Completes the open tick if no robot is awaited any more. Whatever may have been the last thing that it waited
    /// for calls this.
    fn settle(&mut self, out: &mut Vec<BarrierOutput<R, C>>) {
        if self.phase != BarrierPhase::Open || self.is_any_awaited() {
            return;
        }

        // From here on nothing that arrives can change the tick: reports, tokens and timers ask for the phase, so
        // those that come between two ticks are for the next one, or stale.
        self.phase = BarrierPhase::Between;
        if std::mem::take(&mut self.is_announced) {
            out.push(BarrierOutput::Released);
        }
        let mut outcome = TickOutcome {
            reports: BTreeMap::new(),
            membership: std::mem::take(&mut self.membership),
        };
        // In the order of their tokens, which is wall clock, the bytes of two records would differ.
        outcome.membership.sort();
        for (name, member) in &mut self.members {
            if let Some(reply) = member.take_reply() {
                outcome.reports.insert(name.clone(), reply);
            }
        }
        out.push(BarrierOutput::Complete(outcome));
    }
}

/// The flag of a robot in [`Clock::news`].
fn news_flag(index: usize) -> u32 {
    1 << (index % NEWS_FLAGS)
}
