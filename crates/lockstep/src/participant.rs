//! A robot's side: from the request to join to the end of the run, tick by tick.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, End, Refusal};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::IncarnationNotice;
use crate::exchange::Sent;
use crate::member::Admission;
use crate::rules::{Rule, Rules};
use crate::states::{NoState, StateQuery, States};

/// How long a participant waits for what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Timeouts {
    /// How long to try to be admitted.
    pub join: Duration,
    /// How long to wait for a simulator that is gone: it has ended, or the link to it is down, which look the same from here.
    pub gone: Duration,
}

/// Pause between two requests to join.
const JOIN_AGAIN: Duration = Duration::from_millis(100);
/// Pause between two queries to a robot that does not answer.
const QUERY_AGAIN: Duration = Duration::from_millis(500);
/// After this long without an answer people are told for whom the robot waits.
const WAITING_AFTER: Duration = Duration::from_millis(250);
/// Most news that are kept while their clock is not here, of the epoch and of later ones each. Only the newest clock is ever
/// run.
const MAX_NEWS: usize = 4;
/// A robot that was not queried for this many ticks is followed no more.
const UNUSED_TICKS: Tick = 64;

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
pub enum Action<N, S, C, R> {
    /// Ask the simulator to be admitted; answer by [`Participant::admitted`], [`Participant::refused`] or
    /// [`Participant::unanswered`].
    Join,
    /// Declare the liveliness token.
    DeclareToken,
    /// Run the robot for a tick; answer by [`Participant::done`].
    Run(Turn<N>),
    /// Put what came of a tick, in this order: the commands, the state, the report.
    Put(Box<Answer<S, C, R>>),
    /// Query the state of another robot as of this tick, and subscribe to it; answer by [`Participant::heard`].
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
    /// Call [`Participant::timer`] after this time.
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
pub struct Answer<S, C, R> {
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

/// Where a participant stands.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Standing {
    /// It has asked to join, for the first time or again.
    Joining,
    /// It was admitted.
    Admitted,
    /// It has left.
    Left,
}

/// A query to another robot that has no answer yet.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Asking {
    of: RobotName,
    has_told: bool,
}

/// News as they arrived.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Arrived<N> {
    joined: Option<Generation>,
    news: N,
}

/// A robot's side of the lock-step. `N` is the content of its news, `S` of a state, `C` of a command, `R` of a report.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Participant<N, S, C, R> {
    timeouts: Timeouts,
    standing: Standing,
    admission: Option<Admission>,
    /// Whether the last answer to its request was that the name is taken.
    is_name_taken: bool,
    has_token: bool,
    /// Whether it has run a tick as the incarnation that it was admitted as, in the epoch that it was admitted to.
    is_seated: bool,
    /// The newest clock that has not been run, of the epoch that it was admitted to.
    pending: Option<Clock>,
    /// The newest clock of a later epoch. Only a welcome to that epoch shows that it has begun.
    later: Option<Clock>,
    /// News of ticks that have not been run.
    news: BTreeMap<(Epoch, Tick), Arrived<N>>,
    /// The tick that the robot is running.
    running: Option<(Epoch, Tick)>,
    /// Whether the robot still runs a tick as what it is no more: its result is thrown away.
    is_discarding: bool,
    /// What came of the last tick.
    answer: Option<Box<Answer<S, C, R>>>,
    /// Whether the answer has not been put, because the robot was joining again.
    is_held_back: bool,
    states: States<S>,
    asking: Option<Asking>,
    /// States of other robots, with the tick when each was last asked for.
    others: BTreeMap<RobotName, States<S>>,
    followed: BTreeMap<RobotName, Tick>,
    is_simulator_gone: bool,
    rules: Rules,
}

type Out<N, S, C, R> = Vec<Action<N, S, C, R>>;

impl<N: Clone, S: Clone, C: Clone, R: Clone> Participant<N, S, C, R> {
    /// A robot that asks to join.
    #[must_use]
    pub fn new(timeouts: Timeouts, out: &mut Out<N, S, C, R>) -> Self {
        Self::with_rules(timeouts, Rules::default(), out)
    }

    pub(crate) fn with_rules(timeouts: Timeouts, rules: Rules, out: &mut Out<N, S, C, R>) -> Self {
        // A token that is declared before the welcome would keep the robot's own request from being admitted.
        let has_token = !rules.hold(Rule::TokenAfterWelcome);
        if has_token {
            out.push(Action::DeclareToken);
        }
        out.push(Action::SetTimer(RobotTimer::JoinPatience, timeouts.join));
        out.push(Action::Join);

        Self {
            timeouts,
            standing: Standing::Joining,
            admission: None,
            is_name_taken: false,
            has_token,
            is_seated: false,
            pending: None,
            later: None,
            news: BTreeMap::new(),
            running: None,
            is_discarding: false,
            answer: None,
            is_held_back: false,
            states: States::default(),
            asking: None,
            others: BTreeMap::new(),
            followed: BTreeMap::new(),
            is_simulator_gone: false,
            rules,
        }
    }

    /// The simulator has admitted the robot. `states` are the last ones of its predecessor, oldest first: other robots may
    /// still query them.
    pub fn admitted(
        &mut self,
        admission: Admission,
        states: impl IntoIterator<Item = (Tick, S)>,
        out: &mut Out<N, S, C, R>,
    ) {
        if self.standing != Standing::Joining {
            return;
        }

        let before = self.admission.replace(admission);
        self.standing = Standing::Admitted;
        self.take_later(admission.epoch);
        let is_unchanged = before.is_some_and(|before| {
            let is_of_epoch = before.epoch == admission.epoch;
            let is_of_generation = before.generation == admission.generation;
            is_of_epoch && (is_of_generation || !self.rules.hold(Rule::StartsOver))
        });
        if is_unchanged && self.rules.hold(Rule::GoesOnInOwnEpoch) {
            if std::mem::take(&mut self.is_held_back) {
                self.put(out);
            }
        } else {
            self.start_over();
            for (tick, state) in states {
                self.states.add(admission.epoch, tick, state);
            }
        }

        if !self.has_token {
            self.has_token = true;
            out.push(Action::DeclareToken);
        }
        self.run_if_possible(out);
    }

    /// The simulator has refused the robot.
    pub fn refused(&mut self, reason: Refusal, out: &mut Out<N, S, C, R>) {
        if self.standing != Standing::Joining {
            return;
        }

        // A process that was admitted before is refused its own name only if another one has taken its place.
        let was_admitted = self.admission.is_some() && self.rules.hold(Rule::EndsWhenTaken);
        if reason == Refusal::NameTaken && was_admitted {
            self.leave(Leave::Replaced, out);
        } else if reason == Refusal::NameTaken {
            // A predecessor that was killed keeps the name until its lease is over.
            self.is_name_taken = true;
            out.push(Action::SetTimer(RobotTimer::Join, JOIN_AGAIN));
        } else {
            self.leave(Leave::Refused(reason), out);
        }
    }

    /// No simulator has answered the request to join.
    pub fn unanswered(&mut self, out: &mut Out<N, S, C, R>) {
        if self.standing == Standing::Joining {
            out.push(Action::SetTimer(RobotTimer::Join, JOIN_AGAIN));
        }
    }

    /// A clock arrived.
    pub fn clock(&mut self, clock: Clock, out: &mut Out<N, S, C, R>) {
        if self.standing == Standing::Left {
            return;
        }
        // Before anything else is looked at, whatever its tick.
        if let Some(end) = clock.end {
            self.leave(Leave::End(end), out);
            return;
        }
        let Some(admission) = self.admission else {
            return; // The clock is repeated when the token is declared.
        };

        let at = (clock.epoch, clock.tick);
        if clock.epoch > admission.epoch {
            if self.rules.hold(Rule::JoinsNewEpoch) {
                self.note_later(clock);
                self.join_again(out);
            }
            return;
        }
        if clock.epoch < admission.epoch && self.rules.hold(Rule::IgnoresLate) {
            return;
        }
        if self.running == Some(at) {
            return; // It is being answered.
        }
        // A clock that was answered comes again because something of the answer was lost. The whole answer is put again, from memory:
        // the robot must not run a tick twice, since its random numbers and its state have moved on.
        if let Some(answer) = &self.answer
            && at <= (answer.epoch, answer.tick)
            && self.rules.hold(Rule::AnswersOnce)
        {
            if at == (answer.epoch, answer.tick) && self.running.is_none() {
                self.repeat(out);
            }
            return;
        }
        let is_newest = self
            .pending
            .is_none_or(|pending| at >= (pending.epoch, pending.tick))
            && self.running.is_none_or(|running| at > running);
        if is_newest || !self.rules.hold(Rule::RunsNewest) {
            self.pending = Some(clock);
            self.run_if_possible(out);
        }
    }

    /// News arrived for the tick that they name, and name these incarnations.
    pub fn news(
        &mut self,
        epoch: Epoch,
        tick: Tick,
        notice: IncarnationNotice,
        news: N,
        out: &mut Out<N, S, C, R>,
    ) {
        let Some(admission) = self.admission else {
            return;
        };
        if self.standing == Standing::Left || epoch < admission.epoch {
            return;
        }
        let IncarnationNotice { joined, rejoin } = notice;
        // While it joins again, a higher generation may become its own.
        let is_joining = self.standing == Standing::Joining && self.rules.hold(Rule::AwaitsWelcome);
        let is_replaced =
            joined.is_some_and(|generation| generation > admission.generation) && !is_joining;
        if epoch == admission.epoch && is_replaced && self.rules.hold(Rule::EndsWhenReplaced) {
            self.leave(Leave::Replaced, out);
            return;
        }
        let must_rejoin = rejoin == Some(admission.generation);
        if epoch == admission.epoch && must_rejoin && self.rules.hold(Rule::JoinsWhenAsked) {
            self.join_again(out);
        }
        let is_answered = self
            .answer
            .as_ref()
            .is_some_and(|answer| (epoch, tick) <= (answer.epoch, answer.tick));
        if is_answered || self.running.is_some_and(|running| (epoch, tick) <= running) {
            return;
        }

        self.news.insert((epoch, tick), Arrived { joined, news });
        // Those of later epochs, which only a welcome confirms, take no room from the others.
        let mut later = self.news.split_off(&(admission.epoch, Tick::MAX));
        for kept in [&mut self.news, &mut later] {
            while kept.len() > MAX_NEWS {
                kept.pop_first();
            }
        }
        self.news.extend(later);
        self.run_if_possible(out);
    }

    /// The robot has done the tick that it was to run.
    pub fn done(&mut self, commands: Vec<Sent<C>>, state: S, report: R, out: &mut Out<N, S, C, R>) {
        if std::mem::take(&mut self.is_discarding) {
            self.run_if_possible(out);
            return;
        }
        let (Some((epoch, tick)), Some(admission)) = (self.running.take(), self.admission) else {
            return;
        };
        self.asking = None;
        if self.standing == Standing::Left {
            return;
        }

        // The state can be queried before the report is put: a robot that runs the next tick already may ask for it.
        self.states.add(epoch, tick, state.clone());
        self.answer = Some(Box::new(Answer {
            epoch,
            tick,
            generation: admission.generation,
            commands,
            state,
            report,
        }));
        // While it joins again, nobody knows whether the answer is still of its epoch and incarnation: the welcome decides.
        self.is_held_back = self.standing == Standing::Joining;
        if !self.is_held_back {
            self.put(out);
        }
        self.run_if_possible(out);
    }

    /// Answers another robot's query, at once: also while this robot runs or waits.
    ///
    /// # Errors
    /// [`NoState`] says why there is no answer.
    pub fn query(&self, query: StateQuery) -> Result<S, NoState> {
        self.states.answer(query)
    }

    /// The state of another robot as of the tick before the one that runs: `None` until it is here. The first call begins a
    /// query.
    pub fn ask(&mut self, of: &RobotName, out: &mut Out<N, S, C, R>) -> Option<S> {
        let (epoch, tick) = self.running?;
        let query = StateQuery {
            tick: Some(tick),
            epoch: Some(epoch),
        };
        self.followed.insert(of.clone(), tick);
        let found = self
            .others
            .get(of)
            .and_then(|states| states.answer(query).ok());
        if found.is_some() {
            self.asking = None;
            return found;
        }

        if self.asking.as_ref().is_none_or(|asking| asking.of != *of) {
            self.asking = Some(Asking {
                of: of.clone(),
                has_told: false,
            });
            out.push(Action::Query {
                of: of.clone(),
                tick,
                epoch,
            });
            out.push(Action::SetTimer(RobotTimer::Query, QUERY_AGAIN));
            out.push(Action::SetTimer(RobotTimer::Waiting, WAITING_AFTER));
        }
        None
    }

    /// Another robot's state arrived, queried or followed.
    pub fn heard(&mut self, of: RobotName, epoch: Epoch, tick: Tick, state: S) {
        // Only states near the present tick are ever asked for. One of a tick after that under way shows that the clock has
        // gone on without this robot. It must not take the place of the state that this tick may still ask for.
        let is_near = match (self.running, &self.answer) {
            (Some(running), _) => {
                (epoch, tick) == running || (epoch, tick.saturating_add(1)) == running
            }
            (None, Some(answer)) => epoch == answer.epoch && tick.abs_diff(answer.tick) <= 1,
            (None, None) => false,
        };
        if is_near {
            self.others.entry(of).or_default().add(epoch, tick, state);
        }
    }

    /// Whether the tick that runs is of no use any more: the run is over, a newer clock is here, the process leaves, or it is
    /// another incarnation now.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.standing == Standing::Left || self.is_discarding || self.pending.is_some()
    }

    /// The simulator's liveliness token was declared or undeclared.
    pub fn simulator(&mut self, is_present: bool, out: &mut Out<N, S, C, R>) {
        let was_gone = std::mem::replace(&mut self.is_simulator_gone, !is_present);
        if !is_present && !was_gone {
            out.push(Action::SetTimer(RobotTimer::Gone, self.timeouts.gone));
        }
    }

    /// A timer that was set has fired.
    pub fn timer(&mut self, timer: RobotTimer, out: &mut Out<N, S, C, R>) {
        if self.standing == Standing::Left {
            return;
        }

        match timer {
            RobotTimer::Join if self.standing == Standing::Joining => out.push(Action::Join),
            RobotTimer::JoinPatience if self.admission.is_none() => {
                let leave = if self.is_name_taken {
                    Leave::Refused(Refusal::NameTaken)
                } else {
                    Leave::NoSimulator
                };
                self.leave(leave, out);
            }
            RobotTimer::Gone if self.is_simulator_gone => self.leave(Leave::SimulatorGone, out),
            RobotTimer::Query => self.query_again(out),
            RobotTimer::Waiting => self.tell_waiting(out),
            _ => {}
        }
    }

    /// The process wants to leave.
    pub fn stop(&mut self, out: &mut Out<N, S, C, R>) {
        self.leave(Leave::Stopped, out);
    }

    /// Whether it has left.
    #[must_use]
    pub fn has_left(&self) -> bool {
        self.standing == Standing::Left
    }

    /// Whether it waits for an answer to its request to join: another process does not have its place, as far as it knows.
    #[must_use]
    pub fn is_unanswered(&self) -> bool {
        self.admission.is_none() && !self.is_name_taken
    }

    /// What it was admitted to.
    #[must_use]
    pub fn admission(&self) -> Option<Admission> {
        self.admission
    }

    fn leave(&mut self, leave: Leave, out: &mut Out<N, S, C, R>) {
        if self.standing != Standing::Left {
            self.standing = Standing::Left;
            out.push(Action::Leave(leave));
        }
    }

    /// The same process, in the next epoch or as a further incarnation. The welcome decides which, if any.
    fn join_again(&mut self, out: &mut Out<N, S, C, R>) {
        if self.standing != Standing::Joining {
            self.standing = Standing::Joining;
            out.push(Action::Join);
        }
    }

    /// Keeps the newest clock of a later epoch.
    fn note_later(&mut self, clock: Clock) {
        let is_newest = self
            .later
            .is_none_or(|later| (clock.epoch, clock.tick) >= (later.epoch, later.tick));
        if is_newest || !self.rules.hold(Rule::RunsNewest) {
            self.later = Some(clock);
        }
    }

    /// The welcome shows which epoch it is: a clock of a still later one is ignored, and so are its news. Both are repeated.
    fn take_later(&mut self, epoch: Epoch) {
        if let Some(clock) = self.later.take()
            && clock.epoch == epoch
        {
            self.pending = Some(clock);
        }
        self.news.retain(|of, _| of.0 <= epoch);
    }

    /// Forgets what it was.
    fn start_over(&mut self) {
        self.is_seated = false;
        // The robot cannot be interrupted in the middle of a tick: what comes of it is discarded by `done`, and until then no other
        // tick begins.
        self.is_discarding |= self.running.take().is_some();
        self.asking = None;
        self.answer = None;
        self.is_held_back = false;
        // A query that names no epoch means the present one.
        self.states.clear();
    }

    /// Runs the pending clock if everything that belongs to it is here and it is this robot's turn.
    fn run_if_possible(&mut self, out: &mut Out<N, S, C, R>) {
        let (Some(clock), Some(admission)) = (self.pending, self.admission) else {
            return;
        };
        let is_busy = self.running.is_some() || self.is_discarding;
        if self.standing != Standing::Admitted || is_busy {
            return;
        }
        let at = (clock.epoch, clock.tick);
        if clock.epoch < admission.epoch && self.rules.hold(Rule::IgnoresLate) {
            self.pending = None;
            return;
        }
        let has_news = clock.news & admission.news_flag != 0;
        let is_here = self.news.contains_key(&at);
        if has_news && !is_here && self.rules.hold(Rule::WaitsForNews) {
            return; // They were lost: both are repeated.
        }

        // The clock is taken before anything else: a repetition that arrives from now on finds the tick running, and not pending.
        self.pending = None;
        let arrived = if self.rules.hold(Rule::MatchesNews) {
            self.news.remove(&at)
        } else {
            self.news.pop_first().map(|(_, arrived)| arrived)
        };
        self.news.retain(|of, _| *of > at);
        let joined = arrived.as_ref().and_then(|arrived| arrived.joined);
        // A clock of tick 0 may be from before this incarnation: only the first one takes part in it without being named.
        let is_first = admission.generation == 1;
        let is_named =
            joined == Some(admission.generation) || !self.rules.hold(Rule::WaitsToBeNamed);
        let begin = if self.is_seated {
            Begin::GoOn
        } else if clock.tick == 0 && (is_first || is_named) {
            Begin::Init
        } else if is_named {
            Begin::TakeOver
        } else {
            return; // Its turn comes with the news that name it.
        };

        self.is_seated = true;
        self.running = Some(at);
        self.unfollow_unused(clock.tick, out);
        out.push(Action::Run(Turn {
            epoch: clock.epoch,
            tick: clock.tick,
            begin,
            news: arrived.map(|arrived| arrived.news),
        }));
    }

    fn unfollow_unused(&mut self, tick: Tick, out: &mut Out<N, S, C, R>) {
        let unused: Vec<RobotName> = self
            .followed
            .iter()
            .filter(|(_, last)| tick.abs_diff(**last) >= UNUSED_TICKS)
            .map(|(name, _)| name.clone())
            .collect();

        for name in unused {
            self.followed.remove(&name);
            self.others.remove(&name);
            out.push(Action::Unfollow(name));
        }
    }

    /// Puts the answer of the last tick.
    fn put(&self, out: &mut Out<N, S, C, R>) {
        if let Some(answer) = &self.answer {
            out.push(Action::Put(answer.clone()));
        }
    }

    /// A clock came again that was answered: a message was lost.
    fn repeat(&self, out: &mut Out<N, S, C, R>) {
        let Some(answer) = &self.answer else { return };
        if !self.rules.hold(Rule::RepeatsReport) {
            return;
        }

        let mut again = answer.clone();
        if !self.rules.hold(Rule::RepeatsCommands) {
            again.commands.clear();
        }
        out.push(Action::Put(again));
    }

    fn query_again(&mut self, out: &mut Out<N, S, C, R>) {
        let (Some(asking), Some((epoch, tick))) = (&self.asking, self.running) else {
            return;
        };
        out.push(Action::Query {
            of: asking.of.clone(),
            tick,
            epoch,
        });
        out.push(Action::SetTimer(RobotTimer::Query, QUERY_AGAIN));
    }

    fn tell_waiting(&mut self, out: &mut Out<N, S, C, R>) {
        let (Some(asking), Some((epoch, tick))) = (&mut self.asking, self.running) else {
            return;
        };
        if !std::mem::replace(&mut asking.has_told, true) {
            out.push(Action::PutWaiting {
                tick,
                epoch,
                on: asking.of.clone(),
            });
        }
    }
}
