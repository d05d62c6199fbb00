//! Wrong simulators and robots: [`Barrier`] and [`Participant`] behind a wrapper that alters what goes in or what
//! comes out, so that they behave as if one rule were missing. Without a [`Mutant`] the wrappers change nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;

use protocol::messages::{Clock, End, FaultKind, OnLate, Refusal};
use protocol::{Epoch, Generation, RobotName, Tick};

use super::simulation::{ModelReport, ModelUpdate, Order};
use crate::{
    Admission, Barrier, BarrierOutput, Begin, IncarnationNotice, LatePolicy, Leave, Participant,
    ParticipantOutput, Refused, RobotTimer, Sent, Stamp, Timeouts, Timer, Timing, Turn,
};

/// What a simulator or a robot does wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Mutant {
    // The simulator.
    /// The report of one robot counts for all.
    CompletesEarly,
    /// Reports and commands of another epoch count for the open tick.
    CountsOtherEpochs,
    CountsOtherTicks,
    CountsOtherIncarnations,
    /// A report counts before all commands are here that it states.
    CountsIncompleteReports,
    /// A report counts after the clock has gone on without its robot.
    CountsLateReports,
    /// What a predecessor has sent for the open tick counts as its successor's.
    KeepsPredecessor,
    /// A held clock is not repeated.
    RepeatsNoClock,
    /// A held clock is repeated without its news.
    RepeatsNoNews,
    /// The clock flags no robot that has news.
    FlagsNoNews,
    /// A token that is declared while a tick is open is not noticed.
    MissesReturn,
    /// A first incarnation is not named in its news.
    NamesNoNewcomer,
    /// A further incarnation is not named any more when it has reported.
    NamesReplacementOnce,
    /// A further incarnation gets the number of the one before.
    CountsNoIncarnations,
    /// A process gets the name of one that is connected.
    GivesTakenName,
    /// A process that was admitted has no time to declare its token.
    ReservesNoPlace,
    /// The clock waits for robots that cannot report, whatever the scenario wants.
    WaitsForAbsent,
    /// A robot that the scenario hangs is lost when its token is, as any other.
    LosesHung,
    /// A robot that the scenario hangs is treated as one that it crashes.
    TakesHangForCrash,
    /// The clock goes on after a hang although the robot has not joined again.
    AwaitsNoRejoining,
    /// A robot that was lost is not asked to join again.
    AsksNoneToRejoin,

    // A robot.
    /// A tick is run without its news.
    IgnoresFlags,
    /// The oldest news are taken for those of the tick.
    MixesNewsUp,
    /// A tick that was answered is run again.
    RunsAgain,
    /// An answer is not repeated.
    RepeatsNoAnswer,
    /// A report is repeated without its commands.
    RepeatsNoCommands,
    /// A clock that is earlier than the last one is run.
    RunsEarlierClock,
    /// A clock of a later epoch is ignored.
    IgnoresNewEpoch,
    /// A request to join again is ignored.
    IgnoresRequest,
    /// A process that joins again takes its own next incarnation for another process.
    ExpectsNoWelcome,
    /// A further incarnation goes on as the one before.
    GoesOnAsSuccessor,
    /// A welcome to its own epoch makes it start over.
    StartsOverInOwnEpoch,
    /// An incarnation begins before it is named.
    BeginsUnnamed,
    /// A process goes on when news name its successor.
    OutlivesSuccessor,
    /// A process that was admitted goes on asking when its name is taken.
    InsistsOnName,
    /// The token is declared before the welcome.
    DeclaresTokenEarly,
}

type Outputs = Vec<BarrierOutput<ModelReport, Order>>;

/// A message of a robot for the open tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum RobotMessage {
    Command(u32, Sent<Order>),
    Report(u32, ModelReport),
}

/// A barrier that may be wrong.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Simulator {
    barrier: Barrier<ModelReport, Order>,
    mutant: Option<Mutant>,
    epoch: Epoch,
    tick: Tick,
    /// What has come for the open tick, and which incarnations have reported in this epoch, for mutants that need it.
    messages: Vec<(RobotName, Stamp, RobotMessage)>,
    reported: BTreeSet<(RobotName, Generation)>,
}

impl Deref for Simulator {
    type Target = Barrier<ModelReport, Order>;

    fn deref(&self) -> &Self::Target {
        &self.barrier
    }
}

impl Simulator {
    pub(super) fn new(
        roster: [RobotName; 2],
        lateness: LatePolicy,
        mutant: Option<Mutant>,
    ) -> Self {
        Self {
            barrier: Barrier::new(roster, lateness, Timing::default(), 4),
            mutant,
            epoch: 0,
            tick: 0,
            messages: Vec::new(),
            reported: BTreeSet::new(),
        }
    }

    fn is(&self, mutant: Mutant) -> bool {
        self.mutant == Some(mutant)
    }

    pub(super) fn gather(&mut self, epoch: Epoch, mut lateness: LatePolicy, out: &mut Outputs) {
        self.epoch = epoch;
        self.messages.clear();
        self.reported.clear();
        if self.is(Mutant::WaitsForAbsent) {
            lateness.on_late = OnLate::Wait;
        }
        self.barrier.gather(epoch, lateness, out);
    }

    pub(super) fn open(&mut self, tick: Tick, news: BTreeSet<RobotName>, out: &mut Outputs) {
        self.tick = tick;
        self.messages.clear();
        let is_hung = |name: &&RobotName| self.is_stopped(name) && !self.is_present(name);
        let hung = self.roster().find(is_hung).cloned();
        let hung = hung.filter(|_| self.is(Mutant::LosesHung));
        let first = out.len();

        if let Some(hung) = &hung {
            self.barrier.fault(hung, Some(FaultKind::Crash));
        }
        self.barrier.open(tick, news, out);
        if let Some(hung) = &hung {
            self.barrier.fault(hung, Some(FaultKind::Hang));
        }
        self.alter(&mut out[first..], false);
    }

    pub(super) fn join(
        &mut self,
        name: &RobotName,
        instance: &str,
        out: &mut Outputs,
    ) -> Result<Admission, Refused> {
        let (before, _) = self.presence(name);
        let mut answer = self.barrier.join(name, instance, out);
        let reservation = Timer::Token(name.clone());

        if self.is(Mutant::GivesTakenName) && answer == Err(Refused::NameTaken) {
            self.barrier.token(name, false, out);
            self.barrier.timer(&reservation, out);
            answer = self.barrier.join(name, instance, out);
            self.barrier.token(name, true, out);
        }
        if self.is(Mutant::ReservesNoPlace) {
            self.barrier.timer(&reservation, out);
        }

        let mut admission = answer?;
        let is_further = before > 0 && admission.generation > before;
        if is_further && self.is(Mutant::KeepsPredecessor) {
            for (from, mut stamp, message) in std::mem::take(&mut self.messages) {
                if from == *name {
                    stamp.generation = admission.generation;
                    self.receive(&from, stamp, message, out);
                }
            }
        }
        if is_further && self.is(Mutant::CountsNoIncarnations) {
            admission.generation = before;
        }
        Ok(admission)
    }

    pub(super) fn token(&mut self, name: &RobotName, is_present: bool, out: &mut Outputs) {
        if self.is(Mutant::MissesReturn) && is_present && self.is_open() {
            return;
        }
        let first = out.len();
        self.barrier.token(name, is_present, out);
        self.alter(&mut out[first..], true);
    }

    pub(super) fn command(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        number: u32,
        command: Sent<Order>,
        out: &mut Outputs,
    ) {
        self.receive(from, stamp, RobotMessage::Command(number, command), out);
    }

    pub(super) fn report(
        &mut self,
        from: &RobotName,
        stamp: Stamp,
        mut commands: u32,
        report: ModelReport,
        out: &mut Outputs,
    ) {
        if self.is(Mutant::CountsIncompleteReports) {
            let own = (from, stamp);
            let sent = self.messages.iter();
            commands = sent.filter(|(of, at, _)| (of, *at) == own).count() as u32;
        }
        let forged = self.is(Mutant::CompletesEarly).then(|| report.clone());
        self.receive(from, stamp, RobotMessage::Report(commands, report), out);

        if let Some(report) = forged {
            let roster: Vec<RobotName> = self.roster().cloned().collect();
            for name in roster {
                let (generation, _) = self.presence(&name);
                let stamp = Stamp {
                    generation,
                    ..stamp
                };
                self.barrier.report(&name, stamp, 0, report.clone(), out);
            }
        }
    }

    fn receive(&mut self, from: &RobotName, at: Stamp, message: RobotMessage, out: &mut Outputs) {
        let mut stamp = at;
        match self.mutant {
            Some(Mutant::CountsOtherEpochs) => stamp.epoch = self.epoch,
            Some(Mutant::CountsOtherTicks) => stamp.tick = self.tick,
            Some(Mutant::CountsOtherIncarnations) => stamp.generation = self.presence(from).0,
            Some(
                Mutant::KeepsPredecessor
                | Mutant::CountsIncompleteReports
                | Mutant::CountsLateReports,
            ) if (at.epoch, at.tick) == (self.epoch, self.tick) => {
                self.messages.push((from.clone(), at, message.clone()));
            }
            _ => {}
        }

        let first = out.len();
        match message {
            RobotMessage::Command(number, command) => {
                self.barrier.command(from, stamp, number, command, out);
            }
            RobotMessage::Report(commands, report) => {
                self.barrier.report(from, stamp, commands, report, out);
            }
        }
        self.alter(&mut out[first..], false);
    }

    pub(super) fn timer(&mut self, timer: &Timer, out: &mut Outputs) {
        if self.is(Mutant::RepeatsNoClock) && *timer == Timer::Repeat {
            return;
        }
        let first = out.len();
        self.barrier.timer(timer, out);
        self.alter(&mut out[first..], true);
    }

    pub(super) fn repeat(&mut self, out: &mut Outputs) {
        let first = out.len();
        self.barrier.repeat(out);
        self.alter(&mut out[first..], true);
    }

    pub(super) fn fault(&mut self, robot: &RobotName, fault: Option<FaultKind>) {
        let is_crash = self.is(Mutant::TakesHangForCrash);

        self.barrier.fault(
            robot,
            fault.map(|kind| if is_crash { FaultKind::Crash } else { kind }),
        );
    }

    pub(super) fn end(&mut self, end: End) {
        self.barrier.end(end);
    }

    pub(super) fn is_back(&self, robot: &RobotName) -> bool {
        if self.is(Mutant::AwaitsNoRejoining) {
            return self.is_present(robot);
        }
        self.barrier.is_back(robot)
    }

    fn alter(&mut self, out: &mut [BarrierOutput<ModelReport, Order>], is_repetition: bool) {
        for output in out {
            match output {
                BarrierOutput::Grant { news, clock } => {
                    self.alter_grant(news, clock, is_repetition);
                }
                BarrierOutput::Complete(outcome) if self.is(Mutant::NamesReplacementOnce) => {
                    for (name, (report, _)) in &outcome.reports {
                        self.reported.insert((name.clone(), report.generation));
                    }
                }
                BarrierOutput::Complete(outcome) if self.is(Mutant::CountsLateReports) => {
                    for (name, _, message) in &self.messages {
                        if let RobotMessage::Report(_, report) = message {
                            let late = (report.clone(), Vec::new());
                            outcome.reports.entry(name.clone()).or_insert(late);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn alter_grant(
        &self,
        news: &mut Vec<(RobotName, IncarnationNotice)>,
        clock: &mut Clock,
        is_repetition: bool,
    ) {
        if self.is(Mutant::FlagsNoNews) {
            clock.news = 0;
        }
        if self.is(Mutant::RepeatsNoNews) && is_repetition {
            news.clear();
        }
        for (name, notice) in news {
            let is_first = notice.joined == Some(1);
            let has_reported = notice
                .joined
                .is_some_and(|joined| self.reported.contains(&(name.clone(), joined)));
            if is_first && self.is(Mutant::NamesNoNewcomer) || has_reported {
                notice.joined = None;
            }
            if self.is(Mutant::AsksNoneToRejoin) {
                notice.rejoin = None;
            }
        }
    }
}

type Actions = Vec<ParticipantOutput<ModelUpdate, (), Order, ModelReport>>;

/// A participant that may be wrong.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct MaybeWrongRobot {
    participant: Participant<ModelUpdate, (), Order, ModelReport>,
    mutant: Option<Mutant>,
    /// The tick that was run last, and news of ticks that were not run, for mutants that need it.
    last: Option<Turn<ModelUpdate>>,
    news: BTreeMap<(Epoch, Tick), ModelUpdate>,
}

impl MaybeWrongRobot {
    pub(super) fn new(timeouts: Timeouts, mutant: Option<Mutant>, out: &mut Actions) -> Self {
        if mutant == Some(Mutant::DeclaresTokenEarly) {
            out.push(ParticipantOutput::DeclareToken);
        }
        Self {
            participant: Participant::new(timeouts, out),
            mutant,
            last: None,
            news: BTreeMap::new(),
        }
    }

    fn is(&self, mutant: Mutant) -> bool {
        self.mutant == Some(mutant)
    }

    pub(super) fn admission(&self) -> Option<Admission> {
        self.participant.admission()
    }

    pub(super) fn admitted(&mut self, admission: Admission, out: &mut Actions) {
        let first = out.len();
        let is_known = self.admission() == Some(admission);
        if is_known && self.is(Mutant::StartsOverInOwnEpoch) {
            let timeouts = Timeouts {
                join: std::time::Duration::MAX,
                gone: std::time::Duration::MAX,
            };
            self.participant = Participant::new(timeouts, &mut Vec::new());
        }

        self.participant.admitted(admission, [], out);
        if is_known || self.is(Mutant::DeclaresTokenEarly) {
            out.retain(|action| *action != ParticipantOutput::DeclareToken);
        }
        self.alter(out, first);
    }

    pub(super) fn refused(&mut self, reason: Refusal, out: &mut Actions) {
        if self.is(Mutant::InsistsOnName) && self.admission().is_some() {
            self.participant.unanswered(out);
        } else {
            self.participant.refused(reason, out);
        }
    }

    pub(super) fn unanswered(&mut self, out: &mut Actions) {
        self.participant.unanswered(out);
    }

    pub(super) fn clock(&mut self, mut clock: Clock, out: &mut Actions) {
        let first = out.len();
        let own = self.admission().unwrap_or(Admission {
            epoch: Epoch::MAX,
            generation: 0,
            news_flag: 0,
        });
        if self.is(Mutant::IgnoresFlags) {
            clock.news = 0;
        }
        if self.is(Mutant::RunsEarlierClock)
            && let Some(last) = &self.last
            && (clock.epoch, clock.tick) < (last.epoch, last.tick)
        {
            out.push(ParticipantOutput::Run(Turn {
                epoch: clock.epoch,
                tick: clock.tick,
                begin: Begin::GoOn,
                news: None,
            }));
        }
        if self.is(Mutant::IgnoresNewEpoch) && clock.epoch > own.epoch {
            return;
        }
        if self.is(Mutant::BeginsUnnamed) && clock.news & own.news_flag == 0 {
            let named = IncarnationNotice {
                joined: Some(own.generation),
                rejoin: None,
            };
            let none = ModelUpdate {
                epoch: clock.epoch,
                tick: clock.tick,
                orders: Vec::new(),
            };
            self.participant
                .news(clock.epoch, clock.tick, named, none, out);
        }

        self.participant.clock(clock, out);
        // What is put here is a repetition.
        for action in &mut out[first..] {
            match (self.mutant, &mut *action, &self.last) {
                (Some(Mutant::RunsAgain), ParticipantOutput::Put(_), Some(turn)) => {
                    *action = ParticipantOutput::Run(turn.clone());
                }
                (Some(Mutant::RepeatsNoCommands), ParticipantOutput::Put(answer), _) => {
                    answer.commands.clear();
                }
                _ => {}
            }
        }
        if self.is(Mutant::RepeatsNoAnswer) {
            out.retain(|action| !matches!(action, ParticipantOutput::Put(_)));
        }
        self.alter(out, first);
    }

    pub(super) fn news(
        &mut self,
        epoch: Epoch,
        tick: Tick,
        mut notice: IncarnationNotice,
        news: ModelUpdate,
        out: &mut Actions,
    ) {
        let first = out.len();
        let own = self.admission();
        let is_named = own.is_some_and(|own| {
            let is_later = notice.joined.is_some_and(|joined| joined > own.generation);
            own.epoch == epoch && is_later
        });
        if self.is(Mutant::IgnoresRequest) {
            notice.rejoin = None;
        }
        if self.is(Mutant::OutlivesSuccessor) && is_named {
            notice.joined = None;
        }
        if self.is(Mutant::BeginsUnnamed) && !is_named {
            notice.joined = own.map(|own| own.generation);
        }
        if self.is(Mutant::MixesNewsUp) {
            self.news.insert((epoch, tick), news.clone());
        }

        self.participant.news(epoch, tick, notice, news, out);
        if self.is(Mutant::ExpectsNoWelcome) && is_named && !self.participant.has_left() {
            out.push(ParticipantOutput::Leave(Leave::Replaced));
        }
        self.alter(out, first);
    }

    pub(super) fn done(
        &mut self,
        commands: Vec<Sent<Order>>,
        report: ModelReport,
        out: &mut Actions,
    ) {
        let first = out.len();
        self.participant.done(commands, (), report, out);
        self.alter(out, first);
    }

    pub(super) fn timer(&mut self, timer: RobotTimer, out: &mut Actions) {
        self.participant.timer(timer, out);
    }

    fn alter(&mut self, out: &mut Actions, first: usize) {
        for action in &mut out[first..] {
            let ParticipantOutput::Run(turn) = action else {
                continue;
            };
            match self.mutant {
                Some(Mutant::GoesOnAsSuccessor) if turn.begin == Begin::TakeOver => {
                    turn.begin = Begin::GoOn;
                }
                Some(Mutant::MixesNewsUp) => {
                    turn.news = self.news.pop_first().map(|(_, news)| news);
                    self.news.retain(|of, _| *of > (turn.epoch, turn.tick));
                }
                Some(Mutant::RunsAgain | Mutant::RunsEarlierClock) => {
                    self.last = Some(turn.clone());
                }
                _ => {}
            }
        }
    }
}
