//! What the middleware's threads and the host's thread share: the participants, what they want done, and their timers.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lockstep::{Action, Answer, NoState, Participant, Patience, RobotTimer, StateQuery};
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
#[derive(Debug)]
pub(super) struct Shared {
    inner: Mutex<Inner>,
    changed: Condvar,
}

#[derive(Debug)]
struct Inner {
    participants: BTreeMap<RobotName, HostParticipant>,
    actions: VecDeque<(RobotName, HostAction)>,
    timers: BTreeMap<(RobotName, RobotTimer), Instant>,
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

impl Shared {
    /// Participants for these robots, which begin by asking to join.
    pub(super) fn new(names: &[RobotName], patience: Patience) -> Self {
        let mut inner = Inner {
            participants: BTreeMap::new(),
            actions: VecDeque::new(),
            timers: BTreeMap::new(),
        };
        for name in names {
            let mut actions = Vec::new();
            let participant = Participant::new(patience, &mut actions);
            inner.participants.insert(name.clone(), participant);
            inner.file(name, actions);
        }

        Self {
            inner: Mutex::new(inner),
            changed: Condvar::new(),
        }
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
        drop(inner);
        self.changed.notify_all();
    }

    /// Feeds something to every participant, in the order of their names.
    pub(super) fn each(&self, feed: impl Fn(&mut HostParticipant, &mut Vec<HostAction>)) {
        let mut inner = self.lock();
        let names: Vec<RobotName> = inner.participants.keys().cloned().collect();
        for name in names {
            inner.feed(&name, &feed);
        }
        drop(inner);
        self.changed.notify_all();
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

    /// Waits for the next thing to be done.
    pub(super) fn next(&self) -> (RobotName, HostAction) {
        let mut inner = self.lock();
        loop {
            inner.fire();
            if let Some(next) = inner.actions.pop_front() {
                return next;
            }
            inner = self.wait(inner);
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
            inner = self.wait(inner);
        }
    }

    /// Sleeps until something arrives or a timer fires.
    fn wait<'a>(&self, inner: MutexGuard<'a, Inner>) -> MutexGuard<'a, Inner> {
        let due = inner.timers.values().min().copied();
        let Some(due) = due else {
            return self
                .changed
                .wait(inner)
                .unwrap_or_else(PoisonError::into_inner);
        };

        let patience: Duration = due.saturating_duration_since(Instant::now());
        let waited = self.changed.wait_timeout(inner, patience);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }
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
            self.feed(&name, |participant, actions| {
                participant.timer(timer, actions);
            });
        }
    }
}
