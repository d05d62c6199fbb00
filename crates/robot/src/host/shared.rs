//! What the middleware's thread and the host's own share: the participants, what they want done, and their timers.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use lockstep::{Action, Answer, NoState, Participant, RobotTimer, StateQuery, Timeouts};
use protocol::RobotName;
use protocol::messages::{CommandText, News, PublicState};

/// A report as it is put, so that a repetition is the same to the byte.
type Encoded = Arc<[u8]>;
type HostParticipant = Participant<News, Arc<PublicState>, CommandText, Encoded>;
/// What a participant of a host wants done.
pub(super) type HostAction = Action<News, Arc<PublicState>, CommandText, Encoded>;
/// What came of a tick.
pub(super) type HostAnswer = Answer<Arc<PublicState>, CommandText, Encoded>;

/// The participants of a process.
pub(super) struct Shared {
    inner: Mutex<Inner>,
    /// Wakes the host's own thread.
    has_work: Condvar,
    /// Wakes a robot that waits for another robot's answer.
    has_news: Condvar,
    /// Runs ticks on the middleware's thread, where the robots allow it.
    on_arrival: OnceLock<OnArrival>,
}

/// Has the middleware's thread carry out what it may. Returns whether it will.
type OnArrival = Box<dyn Fn() -> bool + Send + Sync>;

#[derive(Debug)]
struct Inner {
    participants: BTreeMap<RobotName, HostParticipant>,
    actions: VecDeque<(RobotName, HostAction)>,
    timers: BTreeMap<(RobotName, RobotTimer), Instant>,
    /// When the host's own thread wakes by itself, while it sleeps.
    sleeps_until: Option<Instant>,
    /// Whether a robot waits for another robot's answer. Its thread carries out what the others want meanwhile.
    is_robot_waiting: bool,
    /// Whether the host is to look why it cannot go on.
    is_over: bool,
    /// Whether the simulator's token is declared.
    has_simulator: bool,
    /// How long a robot tries to join, and how often that was extended because the simulator is there.
    join_patience: Duration,
    extensions: BTreeMap<RobotName, u32>,
}

/// How often a robot goes on trying to join a simulator that is there but has not admitted it: it may be under load, or the
/// robots are many.
const EXTENSIONS: u32 = 9;

/// Which thread asks for something to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Thread {
    /// The host's own.
    Own,
    /// The middleware's: it must neither wait for an answer nor declare anything; and what it puts must fit into the queue of
    /// the link, because to empty that is its own duty.
    Middleware {
        /// Bytes that it may still put.
        budget: usize,
    },
}

/// Bytes that the middleware's thread may put in one go: a quarter of the queue of a link, two batches of 64 KiB.
const BUDGET: usize = 32 * 1024;
/// Bytes of a message beside its content, generously.
const OVERHEAD: usize = 512;

impl Thread {
    /// The middleware's thread, when it begins.
    pub(super) fn middleware() -> Self {
        Self::Middleware { budget: BUDGET }
    }

    /// Whether it may carry this out. What it puts is deducted from its budget.
    fn takes(&mut self, action: &HostAction) -> bool {
        let Self::Middleware { budget } = self else {
            return true;
        };
        match action {
            Action::Run(_) => true,
            Action::Put(answer) => {
                let left = budget.checked_sub(size_of(answer));
                *budget = left.unwrap_or(*budget);
                left.is_some()
            }
            _ => false,
        }
    }
}

/// Bytes that are put for an answer, at most. The state has the same content as the report.
fn size_of(answer: &HostAnswer) -> usize {
    let mut bytes = 2 * (answer.report.len() + OVERHEAD);
    for sent in &answer.commands {
        bytes += sent.command.command.len() + OVERHEAD;
    }

    bytes
}

/// The answer to a robot that waits for another robot's state.
pub(super) enum Waited {
    /// The state.
    Found(Arc<PublicState>),
    /// The tick is of no use any more.
    Interrupted,
    /// Something else is to be carried out meanwhile.
    Act(RobotName, HostAction),
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

impl Shared {
    /// Participants for these robots, which begin by asking to join.
    pub(super) fn new(names: &[RobotName], timeouts: Timeouts) -> Self {
        let mut inner = Inner {
            participants: BTreeMap::new(),
            actions: VecDeque::new(),
            timers: BTreeMap::new(),
            sleeps_until: None,
            is_robot_waiting: false,
            is_over: false,
            has_simulator: false,
            join_patience: timeouts.join,
            extensions: BTreeMap::new(),
        };
        for name in names {
            let mut actions = Vec::new();
            let participant = Participant::new(timeouts, &mut actions);
            inner.participants.insert(name.clone(), participant);
            inner.file(name, actions);
        }

        Self {
            inner: Mutex::new(inner),
            has_work: Condvar::new(),
            has_news: Condvar::new(),
            on_arrival: OnceLock::new(),
        }
    }

    /// From now on `on_arrival` runs ticks on the middleware's thread.
    pub(super) fn run_on_arrival(&self, on_arrival: OnArrival) {
        // There is one host, and it sets this once.
        let _set_once = self.on_arrival.set(on_arrival);
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // Participants are changed by their own methods only, which do not panic half-way.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Feeds something to one participant.
    pub(super) fn with(
        &self,
        name: &RobotName,
        feed: impl FnOnce(&mut HostParticipant, &mut Vec<HostAction>),
    ) {
        let mut inner = self.lock();
        inner.feed(name, feed);
        self.wake(inner);
    }

    /// The same, on a thread that carries out what comes of it itself.
    pub(super) fn file(
        &self,
        name: &RobotName,
        feed: impl FnOnce(&mut HostParticipant, &mut Vec<HostAction>),
    ) {
        self.lock().feed(name, feed);
    }

    /// Feeds something to every participant, in the order of their names.
    pub(super) fn each(&self, feed: impl Fn(&mut HostParticipant, &mut Vec<HostAction>)) {
        let mut inner = self.lock();
        let names: Vec<RobotName> = inner.participants.keys().cloned().collect();
        for name in names {
            inner.feed(&name, &feed);
        }
        self.wake(inner);
    }

    /// Wakes the thread that is to carry out what was filed: the one of a robot that waits, the middleware's, or the host's own.
    fn wake(&self, inner: MutexGuard<'_, Inner>) {
        let is_robot_waiting = inner.is_robot_waiting;
        let next = inner.actions.front();
        let is_for_middleware = next.is_some_and(|(_, action)| Thread::middleware().takes(action));
        let has_actions = !inner.actions.is_empty();
        let has_earlier_timer = inner.has_earlier_timer();
        // The lock is given back before anyone is woken, so that no thread wakes only to wait for it. Nothing is lost in between: each
        // thread looks into the queue before it sleeps, under the lock.
        drop(inner);

        if is_robot_waiting {
            self.has_news.notify_all();
            return;
        }
        let on_arrival = self.on_arrival.get().filter(|_| is_for_middleware);
        let is_run = on_arrival.is_some_and(|run| run());
        if has_earlier_timer || has_actions && !is_run {
            self.has_work.notify_one();
        }
    }

    /// The simulator's token was declared or undeclared.
    pub(super) fn simulator(&self, is_present: bool) {
        self.lock().has_simulator = is_present;
        self.each(|participant, actions| participant.simulator(is_present, actions));
    }

    /// Whether the simulator's token is declared.
    pub(super) fn has_simulator(&self) -> bool {
        self.lock().has_simulator
    }

    /// Wakes the host's own thread because the host cannot go on.
    pub(super) fn end(&self) {
        self.lock().is_over = true;
        self.has_work.notify_one();
    }

    /// Answers a query for the state of a robot of this process.
    pub(super) fn state(
        &self,
        name: &RobotName,
        query: StateQuery,
    ) -> Result<Arc<PublicState>, String> {
        let inner = self.lock();
        let participant = inner
            .participants
            .get(name)
            .ok_or_else(|| "get one robot by its name".to_owned())?;

        participant
            .query(query)
            .map_err(|reason: NoState| reason.to_string())
    }

    /// Whether a robot is one of this process.
    pub(super) fn has(&self, name: &RobotName) -> bool {
        self.lock().participants.contains_key(name)
    }

    /// Takes the next thing to be done that is for this thread. What is for the host's own thread wakes that.
    pub(super) fn next(&self, thread: &mut Thread) -> Option<(RobotName, HostAction)> {
        let mut inner = self.lock();
        if *thread == Thread::Own {
            inner.fire();
        }
        let (_, action) = inner.actions.front()?;
        if thread.takes(action) {
            return inner.actions.pop_front();
        }

        self.has_work.notify_one();
        None
    }

    /// Leaves to the host's own thread what came while the middleware's was at work.
    pub(super) fn leave_rest(&self) {
        let inner = self.lock();
        if !inner.actions.is_empty() || inner.has_earlier_timer() {
            self.has_work.notify_one();
        }
    }

    /// The host's own thread sleeps until there is something to do.
    pub(super) fn sleep(&self) {
        let mut inner = self.lock();
        // Looked at under the same lock under which actions are filed: none can be filed between the look and the sleep.
        if inner.actions.is_empty() && !inner.is_over {
            inner.sleeps_until = inner.next_timer();
            inner = wait(&self.has_work, inner);
            inner.sleeps_until = None;
        }
    }

    /// Waits for another robot's state during a tick of `name`, or for something to be carried out meanwhile.
    pub(super) fn wait_for(&self, name: &RobotName, of: &RobotName) -> Waited {
        let mut inner = self.lock();
        loop {
            inner.fire();
            let mut found = None;
            let mut is_interrupted = true;
            inner.feed(name, |participant, actions| {
                found = participant.ask(of, actions);
                is_interrupted = participant.is_interrupted();
            });
            if let Some(state) = found {
                return Waited::Found(state);
            }
            if is_interrupted {
                return Waited::Interrupted;
            }

            // Other robots of the process run later, on this thread.
            let is_io = |action: &HostAction| !matches!(action, Action::Run(_) | Action::Leave(_));
            let index = inner.actions.iter().position(|(_, action)| is_io(action));
            if let Some((name, action)) = index.and_then(|index| inner.actions.remove(index)) {
                return Waited::Act(name, action);
            }
            inner.is_robot_waiting = true;
            inner = bus::runtime::block(|| wait(&self.has_news, inner));
            inner.is_robot_waiting = false;
        }
    }
}

/// Sleeps until something arrives or a timer fires.
fn wait<'a>(condition: &Condvar, inner: MutexGuard<'a, Inner>) -> MutexGuard<'a, Inner> {
    let Some(due) = inner.next_timer() else {
        return condition
            .wait(inner)
            .unwrap_or_else(PoisonError::into_inner);
    };

    let timeout: Duration = due.saturating_duration_since(Instant::now());
    let waited = condition.wait_timeout(inner, timeout);
    waited.unwrap_or_else(PoisonError::into_inner).0
}

impl Inner {
    fn feed(
        &mut self,
        name: &RobotName,
        feed: impl FnOnce(&mut HostParticipant, &mut Vec<HostAction>),
    ) {
        let Some(participant) = self.participants.get_mut(name) else {
            return;
        };
        let mut actions = Vec::new();
        feed(participant, &mut actions);
        self.file(name, actions);
    }

    fn file(&mut self, name: &RobotName, actions: Vec<HostAction>) {
        for action in actions {
            let Action::SetTimer(timer, after) = action else {
                self.actions.push_back((name.clone(), action));
                continue;
            };
            let key = (name.clone(), timer);
            match Instant::now().checked_add(after) {
                Some(due) => self.timers.insert(key, due),
                None => self.timers.remove(&key),
            };
        }
    }

    /// When a timer fires next.
    fn next_timer(&self) -> Option<Instant> {
        self.timers.values().min().copied()
    }

    /// Whether a timer fires before the host's own thread wakes by itself.
    fn has_earlier_timer(&self) -> bool {
        match (self.next_timer(), self.sleeps_until) {
            (Some(due), Some(planned)) => due < planned,
            (Some(_), None) => true,
            (None, _) => false,
        }
    }

    /// Whether a robot that has not been admitted in time goes on trying: the simulator is there.
    fn extends(&mut self, name: &RobotName) -> bool {
        let participant = self.participants.get(name);
        let is_unanswered = participant.is_some_and(Participant::is_unanswered);
        let extensions = self.extensions.entry(name.clone()).or_default();
        if !is_unanswered || !self.has_simulator || *extensions == EXTENSIONS {
            return false;
        }

        *extensions += 1;
        let waited_s = self.join_patience.as_secs_f64() * f64::from(*extensions);
        tracing::warn!(
            "the simulator is there and has not admitted {name} for {waited_s} s: it is under load, or its access \
             control does not know {name}"
        );
        self.file(
            name,
            vec![Action::SetTimer(
                RobotTimer::JoinPatience,
                self.join_patience,
            )],
        );
        true
    }

    /// Fires the timers that are due.
    fn fire(&mut self) {
        let now = Instant::now();
        while let Some((name, timer)) = self
            .timers
            .iter()
            .find(|(_, due)| **due <= now)
            .map(|(key, _)| key.clone())
        {
            self.timers.remove(&(name.clone(), timer));
            if timer == RobotTimer::JoinPatience && self.extends(&name) {
                continue;
            }
            self.feed(&name, |participant, actions| {
                participant.timer(timer, actions);
            });
        }
    }
}
