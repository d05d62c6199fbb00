//! The participants of a process, and their timers: shared by the middleware's thread, which feeds them what arrives, and the
//! host, which carries out what they want done.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bus::{Inbox, WorkerThread};
use lockstep::{
    NoState, Participant, ParticipantOutput, RobotTimer, StateQuery, TickAnswer, Timeouts,
};
use protocol::messages::{CommandText, PublicState, TickUpdate};
use protocol::{Epoch, RobotName, Tick};

/// A report as it is put, so that a repetition is the same to the byte.
type Encoded = Arc<[u8]>;
type HostParticipant = Participant<TickUpdate, Arc<PublicState>, CommandText, Encoded>;
/// What a participant of a host wants done.
pub(super) type HostAction = ParticipantOutput<TickUpdate, Arc<PublicState>, CommandText, Encoded>;
/// What came of a tick.
pub(super) type HostAnswer = TickAnswer<Arc<PublicState>, CommandText, Encoded>;
/// What the participants want done, in the order in which they wanted it.
pub(super) type Actions = Inbox<(RobotName, HostAction)>;

/// How often a robot goes on trying to join a simulator that is there but has not admitted it: it may be under load, or the
/// robots are many.
const EXTENSIONS: u32 = 9;

/// Bytes that the middleware's thread may put in one go: a quarter of the queue of a link, two batches of 64 KiB.
const MAX_PUT_ON_ARRIVAL: usize = 32 * 1024;
/// Bytes of a message beside its content, generously.
const OVERHEAD: usize = 512;

/// Which actions a thread may carry out. The middleware's must neither wait for an answer nor declare anything; and what it puts
/// must fit into the queue of the link, because to empty that is its own duty.
#[derive(Debug)]
pub(super) enum Allowance {
    /// All of them.
    Unlimited,
    /// Ticks, and messages of this many bytes.
    Bytes(usize),
}

impl Allowance {
    /// That of a thread that begins to work.
    pub(super) fn of(thread: WorkerThread) -> Self {
        match thread {
            WorkerThread::Owner => Self::Unlimited,
            WorkerThread::Arrival => Self::Bytes(MAX_PUT_ON_ARRIVAL),
        }
    }

    /// Whether an action may be carried out. What it puts is deducted.
    pub(super) fn takes(&mut self, action: &HostAction) -> bool {
        let Self::Bytes(left) = self else {
            return true;
        };
        match action {
            ParticipantOutput::Run(_) => true,
            ParticipantOutput::Put(answer) => {
                let rest = left.checked_sub(size_of(answer));
                *left = rest.unwrap_or(*left);
                rest.is_some()
            }
            _ => false,
        }
    }
}

/// Bytes that are put for an answer, at most. The state has the same content as the report.
fn size_of(answer: &HostAnswer) -> usize {
    let mut bytes = 2 * (answer.report.len() + OVERHEAD);
    for sent in &answer.commands {
        let payload = sent.command.payload.as_ref();
        bytes += payload.map_or(0, |payload| payload.as_json().len());
        bytes += sent.command.command.len() + OVERHEAD;
    }

    bytes
}

/// What a robot knows that waits for another robot's state.
pub(super) enum Asked {
    /// The state.
    Found(Arc<PublicState>),
    /// The tick is of no use any more.
    Interrupted,
    /// Nothing yet.
    Pending,
}

/// The participants of a process.
pub(super) struct Participants {
    actions: Actions,
    inner: Mutex<Inner>,
}

struct Inner {
    actions: Actions,
    participants: BTreeMap<RobotName, HostParticipant>,
    timers: BTreeMap<(RobotName, RobotTimer), Instant>,
    /// Whether the simulator's token is declared.
    has_simulator: bool,
    /// How long a robot tries to join, and how often that was extended because the simulator is there.
    join_patience: Duration,
    extensions: BTreeMap<RobotName, u32>,
    /// The newest tick whose panels are asked for.
    shown: Option<(Epoch, Tick)>,
}

impl Participants {
    /// Participants for these robots, which begin by asking to join.
    pub(super) fn new(names: &[RobotName], timeouts: Timeouts, actions: Actions) -> Self {
        let mut inner = Inner {
            actions: actions.clone(),
            participants: BTreeMap::new(),
            timers: BTreeMap::new(),
            has_simulator: false,
            join_patience: timeouts.join,
            extensions: BTreeMap::new(),
            shown: None,
        };
        for name in names {
            let mut first = Vec::new();
            let participant = Participant::new(timeouts, &mut first);
            inner.participants.insert(name.clone(), participant);
            inner.file(name, first);
        }

        Self {
            actions,
            inner: Mutex::new(inner),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // Participants are changed by their own methods only, which do not panic half-way.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The panels of a tick are asked for.
    pub(super) fn show(&self, epoch: Epoch, tick: Tick) {
        self.lock().shown = Some((epoch, tick));
    }

    /// Whether the panels of a tick are asked for.
    pub(super) fn shows(&self, epoch: Epoch, tick: Tick) -> bool {
        self.lock().shown == Some((epoch, tick))
    }

    /// Feeds something to one participant.
    pub(super) fn with(
        &self,
        name: &RobotName,
        feed: impl FnOnce(&mut HostParticipant, &mut Vec<HostAction>),
    ) {
        self.lock().feed(name, feed);
        self.wake();
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
        // One lock for all of them: no other message comes between two robots.
        let mut inner = self.lock();
        let names: Vec<RobotName> = inner.participants.keys().cloned().collect();
        for name in names {
            inner.feed(&name, &feed);
        }
        drop(inner);
        self.wake();
    }

    /// Wakes the thread that is to carry out what was filed: the one of a robot that waits, the middleware's, or the host's own.
    /// The participants are unlocked before, so that no thread wakes only to wait for them.
    fn wake(&self) {
        let is_for_arrival = self
            .actions
            .peek(|(_, action)| Allowance::of(WorkerThread::Arrival).takes(action));
        match is_for_arrival {
            Some(true) => self.actions.arrive(),
            Some(false) => self.actions.wake(),
            // A robot may wait for a state that was filed, or for the end of its tick.
            None => self.actions.notify(),
        }
    }

    /// The simulator's token was declared or undeclared.
    pub(super) fn simulator(&self, is_present: bool) {
        // Noted first: a robot whose patience ends in between leaves or goes on by what is true now.
        self.lock().has_simulator = is_present;
        self.each(|participant, actions| participant.simulator(is_present, actions));
    }

    /// Whether the simulator's token is declared.
    pub(super) fn has_simulator(&self) -> bool {
        self.lock().has_simulator
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

    /// Asks for another robot's state during a tick of `name`.
    pub(super) fn ask(&self, name: &RobotName, of: &RobotName) -> Asked {
        let mut inner = self.lock();
        let mut asked = Asked::Interrupted;
        // What arrives after this look is noted in the queue of actions, so that the wait that follows
        // ends at once.
        inner.feed(name, |participant, actions| {
            asked = match participant.ask(of, actions) {
                Some(state) => Asked::Found(state),
                None if participant.is_interrupted() => Asked::Interrupted,
                None => Asked::Pending,
            };
        });
        asked
    }

    /// When a timer fires next.
    pub(super) fn next_timer(&self) -> Option<Instant> {
        self.lock().timers.values().min().copied()
    }

    /// Fires the timers that are due.
    pub(super) fn fire_timers(&self) {
        let mut inner = self.lock();
        let now = Instant::now();

        // One after the other: what a timer sets off may replace another one that is due.
        while let Some((name, timer)) = inner
            .timers
            .iter()
            .find(|(_, due)| **due <= now)
            .map(|(key, _)| key.clone())
        {
            inner.timers.remove(&(name.clone(), timer));
            if timer == RobotTimer::JoinPatience && inner.extends(&name) {
                continue;
            }
            inner.feed(&name, |participant, actions| {
                participant.timer(timer, actions);
            });
        }
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

    /// Queues actions under the lock under which the participant wanted them: so they are carried out in that order.
    fn file(&mut self, name: &RobotName, actions: Vec<HostAction>) {
        for action in actions {
            let ParticipantOutput::SetTimer(timer, after) = action else {
                self.actions.push((name.clone(), action));
                continue;
            };

            let key = (name.clone(), timer);
            match Instant::now().checked_add(after) {
                Some(due) => {
                    self.timers.insert(key, due);
                    self.actions.work_at(due);
                }
                // A time that cannot be represented does not come.
                None => drop(self.timers.remove(&key)),
            }
        }
    }

    /// Whether a robot that has not been admitted in time goes on trying: the simulator is there.
    fn extends(&mut self, name: &RobotName) -> bool {
        let participant = self.participants.get(name);
        let is_unanswered = participant.is_some_and(Participant::is_unanswered);
        let extensions = self.extensions.entry(name.clone()).or_default();
        // One that was answered knows why it waits: another process has its name, and patience has a
        // limit then.
        if !is_unanswered || !self.has_simulator || *extensions == EXTENSIONS {
            return false;
        }

        *extensions += 1;
        let waited_s = self.join_patience.as_secs_f64() * f64::from(*extensions);
        tracing::warn!(
            "the simulator is there and has not admitted {name} for {waited_s} s: it is under load, or its access \
             control does not know {name}"
        );
        let again = ParticipantOutput::SetTimer(RobotTimer::JoinPatience, self.join_patience);
        self.file(name, vec![again]);
        true
    }
}
