//! A robot's side: from the request to join to the end of the run, tick by tick.
//!
//! Two states say where it is, and each kind of input looks at both: [`JoinState`], whether it was admitted and as
//! what, and [`TickState`], what it does as that. A clock may come again, late or of another epoch, and news without
//! their clock; the robot runs each tick at most once, in order, and only with the news that belong to it.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, Refusal};
use protocol::{Epoch, RobotName, Tick};

use crate::actions::{Begin, Leave, ParticipantOutput, RobotTimer, TickAnswer, Timeouts, Turn};
use crate::exchange::{IncarnationNotice, Sent};
use crate::member::Admission;
use crate::states::{NoState, RecentStates, StateQuery};

/// Pause between two requests to join.
const JOIN_AGAIN: Duration = Duration::from_millis(100);
/// Pause between two queries to a robot that does not answer.
const QUERY_AGAIN: Duration = Duration::from_millis(500);
/// After this long without an answer people are told for whom the robot waits.
const WAITING_AFTER: Duration = Duration::from_millis(250);
/// Most news that are kept while their clock is not here, of the epoch and of later ones each. Only the newest clock
/// is ever run.
const MAX_NEWS: usize = 4;
/// A robot that was not queried for this many ticks is followed no more.
const UNUSED_TICKS: Tick = 64;

/// Whether a robot was admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum JoinState {
    /// It has asked to join for the first time.
    Joining {
        /// Whether it was answered that the name is taken.
        is_name_taken: bool,
    },
    /// It was admitted.
    Joined(Admission),
    /// It was admitted as this, and has asked to join again: it does not know whether it still is.
    Rejoining {
        admission: Admission,
        /// The newest clock of a later epoch. Only a welcome to that epoch shows that it has begun.
        later: Option<Clock>,
        /// Whether a tick was done meanwhile, whose answer counts only if nothing has changed.
        holds_answer: bool,
    },
    /// It has left; before, it may have been admitted.
    Left(Option<Admission>),
}

/// What a robot does as the incarnation that it was admitted as, in the epoch that it was admitted to.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum TickState<S, C, R> {
    /// It has not run a tick as that yet.
    NotBegun,
    /// The same, and the tick that it ran before is not done: it cannot be interrupted, so what comes of it is thrown
    /// away.
    Discarding,
    /// It runs a tick. The answer of the one before is not kept: the clock of this tick shows that it has arrived, or
    /// is not waited for any more.
    Running {
        at: (Epoch, Tick),
        asking: Option<Asking>,
    },
    /// It has done a tick, whose answer is kept in case that it is lost.
    Answered(Box<TickAnswer<S, C, R>>),
}

/// A query to another robot that has no answer yet.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Asking {
    of: RobotName,
    has_told: bool,
}

/// News as they arrived.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct ArrivedNews<N> {
    notice: IncarnationNotice,
    news: N,
}

/// A robot's side of the lock-step. `N` is the content of its news, `S` of a state, `C` of a command, `R` of a
/// report.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Participant<N, S, C, R> {
    timeouts: Timeouts,
    join: JoinState,
    tick: TickState<S, C, R>,
    /// The newest clock that has not been run, of the epoch that it was admitted to.
    pending: Option<Clock>,
    /// News of ticks that have not been run.
    news: BTreeMap<(Epoch, Tick), ArrivedNews<N>>,
    states: RecentStates<S>,
    /// States of other robots, with the tick when each was last asked for.
    others: BTreeMap<RobotName, RecentStates<S>>,
    followed: BTreeMap<RobotName, Tick>,
    is_simulator_gone: bool,
}

type Out<N, S, C, R> = Vec<ParticipantOutput<N, S, C, R>>;

impl<N: Clone, S: Clone, C: Clone, R: Clone> Participant<N, S, C, R> {
    /// A robot that asks to join.
    #[must_use]
    pub fn new(timeouts: Timeouts, out: &mut Out<N, S, C, R>) -> Self {
        out.push(ParticipantOutput::SetTimer(
            RobotTimer::JoinPatience,
            timeouts.join,
        ));
        out.push(ParticipantOutput::Join);

        Self {
            timeouts,
            join: JoinState::Joining {
                is_name_taken: false,
            },
            tick: TickState::NotBegun,
            pending: None,
            news: BTreeMap::new(),
            states: RecentStates::default(),
            others: BTreeMap::new(),
            followed: BTreeMap::new(),
            is_simulator_gone: false,
        }
    }

    /// The simulator has admitted the robot. `states` are the last ones of its predecessor, oldest first: other
    /// robots may still query them.
    pub fn admitted(
        &mut self,
        admission: Admission,
        states: impl IntoIterator<Item = (Tick, S)>,
        out: &mut Out<N, S, C, R>,
    ) {
        let (before, later, holds_answer) = match self.join {
            JoinState::Joining { .. } => (None, None, false),
            JoinState::Rejoining {
                admission,
                later,
                holds_answer,
            } => (Some(admission), later, holds_answer),
            // The answer to a request that was repeated.
            JoinState::Joined(_) | JoinState::Left(_) => return,
        };
        self.join = JoinState::Joined(admission);

        // The welcome shows which epoch it is: a clock of a still later one is ignored, and so are its news. Both are
        // repeated. Without a clock of this epoch, the one that is pending stays if it is of this epoch.
        let is_present = |clock: &Clock| clock.epoch == admission.epoch;
        self.pending = later
            .filter(is_present)
            .or(self.pending.filter(|clock| clock.epoch >= admission.epoch));
        self.news.retain(|of, _| of.0 <= admission.epoch);

        let is_unchanged = before.is_some_and(|before| {
            (before.epoch, before.generation) == (admission.epoch, admission.generation)
        });
        if !is_unchanged {
            self.start_over();
            for (tick, state) in states {
                self.states.add(admission.epoch, tick, state);
            }
        } else if holds_answer {
            self.put_answer(out);
        }

        // Only now: a token that is declared before the welcome would keep the robot's own request from being
        // admitted. It stays declared for as long as the process lives.
        if before.is_none() {
            out.push(ParticipantOutput::DeclareToken);
        }

        // What was admitted may be lost again already, and its news be faster than the welcome. They are not kept: a welcome
        // with the same generation must not make it ask for ever.
        let arrived = self.news.len();
        self.news.retain(|of, arrived| {
            of.0 != admission.epoch || arrived.notice.rejoin != Some(admission.generation)
        });
        if self.news.len() < arrived {
            self.join_again(out);
        }
        self.run_if_possible(out);
    }

    /// The simulator has refused the robot.
    pub fn refused(&mut self, reason: Refusal, out: &mut Out<N, S, C, R>) {
        match (&mut self.join, reason) {
            (JoinState::Joined(_) | JoinState::Left(_), _) => {}
            (JoinState::Joining { is_name_taken }, Refusal::NameTaken) => {
                // A predecessor that was killed keeps the name until its lease is over.
                *is_name_taken = true;
                out.push(ParticipantOutput::SetTimer(RobotTimer::Join, JOIN_AGAIN));
            }
            // A process that was admitted before is refused its own name only if another one has taken its place.
            (JoinState::Rejoining { .. }, Refusal::NameTaken) => self.leave(Leave::Replaced, out),
            (_, reason) => self.leave(Leave::Refused(reason), out),
        }
    }

    /// No simulator has answered the request to join.
    pub fn unanswered(&mut self, out: &mut Out<N, S, C, R>) {
        if self.is_asking_to_join() {
            out.push(ParticipantOutput::SetTimer(RobotTimer::Join, JOIN_AGAIN));
        }
    }

    /// A clock arrived.
    pub fn clock(&mut self, clock: Clock, out: &mut Out<N, S, C, R>) {
        if self.has_left() {
            return;
        }
        // Before anything else is looked at, whatever its tick.
        if let Some(end) = clock.end {
            self.leave(Leave::End(end), out);
            return;
        }
        let Some(admission) = self.admission() else {
            return; // It is repeated when the token is declared, which is after the welcome.
        };
        let at = (clock.epoch, clock.tick);
        if clock.epoch > admission.epoch {
            self.join_again(out);
            if let JoinState::Rejoining { later, .. } = &mut self.join
                && later.is_none_or(|later| at >= (later.epoch, later.tick))
            {
                *later = Some(clock);
            }
            return;
        }
        if clock.epoch < admission.epoch {
            return;
        }

        match &self.tick {
            TickState::Running { at: running, .. } if at <= *running => return,
            // A clock that was answered comes again because something of the answer was lost. The whole answer is put
            // again, from memory: the robot must not run a tick twice, since its random numbers and its state have
            // moved on.
            TickState::Answered(answer) if at <= answer.at() => {
                if at == answer.at() {
                    self.put_answer(out);
                }
                return;
            }
            _ => {}
        }
        // One that is pending comes again because its news were lost. A newer one takes its place: then the clock has
        // gone on, and the robot misses what is between.
        let pending = self.pending;
        if pending.is_none_or(|pending| at >= (pending.epoch, pending.tick)) {
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
        let Some(admission) = self.admission() else {
            return;
        };
        if self.has_left() || epoch < admission.epoch {
            return;
        }
        let IncarnationNotice { joined, rejoin } = notice;
        if epoch == admission.epoch {
            // While it joins again, a higher generation may become its own.
            let is_joined = matches!(self.join, JoinState::Joined(_));
            if is_joined && joined.is_some_and(|joined| joined > admission.generation) {
                self.leave(Leave::Replaced, out);
                return;
            }
            if rejoin == Some(admission.generation) {
                self.join_again(out);
            }
        }

        // The news come before their clock on one link, but either may be lost and be repeated, so they wait for each
        // other here. Those of a tick that runs or is answered are repetitions.
        let is_over = match &self.tick {
            TickState::NotBegun | TickState::Discarding => false,
            TickState::Running { at, .. } => (epoch, tick) <= *at,
            TickState::Answered(answer) => (epoch, tick) <= answer.at(),
        };
        if is_over {
            return;
        }
        self.news
            .insert((epoch, tick), ArrivedNews { notice, news });
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
        let is_discarded = matches!(self.tick, TickState::Discarding);
        if is_discarded || self.has_left() {
            // Until now no other tick could begin: a clock may have come meanwhile.
            self.tick = TickState::NotBegun;
            self.run_if_possible(out);
            return;
        }
        let (TickState::Running { at, .. }, Some(admission)) = (&self.tick, self.admission())
        else {
            return;
        };

        // The state can be queried before the report is put: a robot that runs the next tick already may ask for it.
        let (epoch, tick) = *at;
        self.states.add(epoch, tick, state.clone());
        self.tick = TickState::Answered(Box::new(TickAnswer {
            epoch,
            tick,
            generation: admission.generation,
            commands,
            state,
            report,
        }));
        // While it joins again, it is not known whether the answer is still of its epoch and incarnation: the welcome
        // decides.
        if let JoinState::Rejoining { holds_answer, .. } = &mut self.join {
            *holds_answer = true;
        } else {
            self.put_answer(out);
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

    /// The state of another robot as of the tick before the one that runs: `None` until it is here. The first call
    /// begins a query.
    pub fn ask(&mut self, of: &RobotName, out: &mut Out<N, S, C, R>) -> Option<S> {
        let TickState::Running { at, asking } = &mut self.tick else {
            return None;
        };
        let (epoch, tick) = *at;
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
            *asking = None;
            return found;
        }

        if asking.as_ref().is_none_or(|asking| asking.of != *of) {
            *asking = Some(Asking {
                of: of.clone(),
                has_told: false,
            });
            out.push(ParticipantOutput::Query {
                of: of.clone(),
                tick,
                epoch,
            });
            out.push(ParticipantOutput::SetTimer(RobotTimer::Query, QUERY_AGAIN));
            out.push(ParticipantOutput::SetTimer(
                RobotTimer::Waiting,
                WAITING_AFTER,
            ));
        }
        None
    }

    /// Another robot's state arrived, queried or followed.
    pub fn heard(&mut self, of: RobotName, epoch: Epoch, tick: Tick, state: S) {
        // Only states near the present tick are ever asked for. One of a tick after that under way shows that the
        // clock has gone on without this robot. It must not take the place of the state that this tick may still ask
        // for.
        let is_near = match &self.tick {
            TickState::NotBegun | TickState::Discarding => false,
            TickState::Running { at, .. } => {
                (epoch, tick) == *at || (epoch, tick.saturating_add(1)) == *at
            }
            TickState::Answered(answer) => epoch == answer.epoch && tick.abs_diff(answer.tick) <= 1,
        };

        if is_near {
            self.others.entry(of).or_default().add(epoch, tick, state);
        }
    }

    /// Whether the tick that runs is of no use any more: the run is over, a newer clock is here, the process leaves,
    /// or it is another incarnation now.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        let is_discarding = matches!(self.tick, TickState::Discarding);

        self.has_left() || is_discarding || self.pending.is_some()
    }

    /// The simulator's liveliness token was declared or undeclared.
    pub fn simulator(&mut self, is_present: bool, out: &mut Out<N, S, C, R>) {
        let was_gone = std::mem::replace(&mut self.is_simulator_gone, !is_present);
        if !is_present && !was_gone {
            out.push(ParticipantOutput::SetTimer(
                RobotTimer::Gone,
                self.timeouts.gone,
            ));
        }
    }

    /// A timer that was set has fired.
    pub fn timer(&mut self, timer: RobotTimer, out: &mut Out<N, S, C, R>) {
        if self.has_left() {
            return;
        }

        // A timer is never withdrawn: it decides nothing that the state does not bear out.
        match (timer, &self.join) {
            (RobotTimer::Join, _) if self.is_asking_to_join() => out.push(ParticipantOutput::Join),
            (RobotTimer::JoinPatience, JoinState::Joining { is_name_taken }) => {
                let leave = if *is_name_taken {
                    Leave::Refused(Refusal::NameTaken)
                } else {
                    Leave::NoSimulator
                };
                self.leave(leave, out);
            }
            (RobotTimer::Gone, _) if self.is_simulator_gone => {
                self.leave(Leave::SimulatorGone, out);
            }
            (RobotTimer::Query | RobotTimer::Waiting, _) => self.still_asking(timer, out),
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
        matches!(self.join, JoinState::Left(_))
    }

    /// Whether it waits for an answer to its first request to join: another process does not have its place, as far
    /// as it knows.
    #[must_use]
    pub fn is_unanswered(&self) -> bool {
        let unanswered = JoinState::Joining {
            is_name_taken: false,
        };

        self.join == unanswered
    }

    /// What it was admitted to.
    #[must_use]
    pub fn admission(&self) -> Option<Admission> {
        match self.join {
            JoinState::Joining { .. } => None,
            JoinState::Joined(admission) | JoinState::Rejoining { admission, .. } => {
                Some(admission)
            }
            JoinState::Left(admission) => admission,
        }
    }

    fn is_asking_to_join(&self) -> bool {
        matches!(
            self.join,
            JoinState::Joining { .. } | JoinState::Rejoining { .. }
        )
    }

    fn leave(&mut self, leave: Leave, out: &mut Out<N, S, C, R>) {
        if !self.has_left() {
            self.join = JoinState::Left(self.admission());
            out.push(ParticipantOutput::Leave(leave));
        }
    }

    /// The same process, in the next epoch or as a further incarnation. The welcome decides which, if any: that it
    /// was asked to may be old, and a clock of a later epoch a stray one. Until then it answers no clock but the one
    /// that it runs.
    fn join_again(&mut self, out: &mut Out<N, S, C, R>) {
        if let JoinState::Joined(admission) = self.join {
            self.join = JoinState::Rejoining {
                admission,
                later: None,
                holds_answer: false,
            };
            out.push(ParticipantOutput::Join);
        }
    }

    /// Forgets what it was.
    fn start_over(&mut self) {
        // The robot cannot be interrupted in the middle of a tick: what comes of it is discarded by `done`, and until
        // then no other tick begins.
        self.tick = match self.tick {
            TickState::Running { .. } | TickState::Discarding => TickState::Discarding,
            TickState::NotBegun | TickState::Answered(_) => TickState::NotBegun,
        };
        // A query that names no epoch means the present one.
        self.states.clear();
    }

    /// Runs the pending clock if everything that belongs to it is here and it is this robot's turn.
    fn run_if_possible(&mut self, out: &mut Out<N, S, C, R>) {
        let (JoinState::Joined(admission), Some(clock)) = (self.join, self.pending) else {
            return;
        };
        let has_begun = match self.tick {
            TickState::Running { .. } | TickState::Discarding => return,
            TickState::NotBegun => false,
            TickState::Answered(_) => true,
        };
        let at = (clock.epoch, clock.tick);
        let has_news = clock.news & admission.news_flag != 0;
        if has_news && !self.news.contains_key(&at) {
            return; // They were lost: both are repeated.
        }

        // The clock is taken before anything else: a repetition that arrives from now on finds the tick running, and
        // not pending.
        self.pending = None;
        let arrived = self.news.remove(&at);
        self.news = self.news.split_off(&at);
        let joined = arrived.as_ref().and_then(|arrived| arrived.notice.joined);
        // A clock of tick 0 may be from before this incarnation: only the first one takes part in it without being
        // named.
        let is_first = admission.generation == 1;
        let is_named = joined == Some(admission.generation);
        let begin = if has_begun {
            Begin::GoOn
        } else if clock.tick == 0 && (is_first || is_named) {
            Begin::Init
        } else if is_named {
            Begin::TakeOver
        } else {
            return; // Its turn comes with the news that name it, and with their clock: this one is not kept.
        };

        self.tick = TickState::Running { at, asking: None };
        self.unfollow_unused(clock.tick, out);
        out.push(ParticipantOutput::Run(Turn {
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
            out.push(ParticipantOutput::Unfollow(name));
        }
    }

    /// Puts the answer of the last tick, for the first time or again.
    fn put_answer(&self, out: &mut Out<N, S, C, R>) {
        if let TickState::Answered(answer) = &self.tick {
            out.push(ParticipantOutput::Put(answer.clone()));
        }
    }

    /// A timer of the query to another robot has fired, which may have been answered since.
    fn still_asking(&mut self, timer: RobotTimer, out: &mut Out<N, S, C, R>) {
        let TickState::Running {
            at: (epoch, tick),
            asking: Some(asking),
        } = &mut self.tick
        else {
            return;
        };
        let (epoch, tick, of) = (*epoch, *tick, asking.of.clone());

        if timer == RobotTimer::Query {
            out.push(ParticipantOutput::Query { of, tick, epoch });
            out.push(ParticipantOutput::SetTimer(RobotTimer::Query, QUERY_AGAIN));
        } else if !std::mem::replace(&mut asking.has_told, true) {
            out.push(ParticipantOutput::PutWaiting {
                tick,
                epoch,
                on: of,
            });
        }
    }
}
