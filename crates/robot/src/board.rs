//! What the robots of a process show to askers: their last two reported states, and queries that came early.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bus::Query;
use protocol::keys::{Keys, STATE};
use protocol::messages::PublicState;
use protocol::{Epoch, RobotName, Tick, encode};

/// Questions that are kept until the state they ask for exists; more are refused.
const MAX_EARLY: usize = 1024;

/// Shared between the robots' loop, which writes states, and the link, which asks for them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Board {
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug, Default)]
struct Inner {
    /// The last two states of each robot, newest last. During a tick the others must see the state before it,
    /// however far the robot already is.
    states: BTreeMap<RobotName, VecDeque<Arc<PublicState>>>,
    early: Vec<Query>,
}

/// What a board says to a query.
enum Verdict {
    Answer(Arc<PublicState>),
    Early,
    Never(String),
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        // A panic while the lock was held leaves whole states behind: they are replaced, never changed.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A robot of this process; others are not asked about here.
    pub(crate) fn host(&self, robot: &RobotName) {
        self.lock().states.entry(robot.clone()).or_default();
    }

    /// Shows a new state, and answers who asked for it too early.
    pub(crate) fn show(&self, robot: &RobotName, state: Arc<PublicState>) {
        let mut inner = self.lock();
        let states = inner.states.entry(robot.clone()).or_default();
        states.retain(|old| old.epoch == state.epoch && old.tick < state.tick);
        states.push_back(state);
        if states.len() > 2 {
            states.pop_front();
        }
        let early = std::mem::take(&mut inner.early);
        for query in early {
            inner.respond(query);
        }
    }

    /// The state that `robot`, one of this process, reported for `tick`.
    pub(crate) fn get(
        &self,
        robot: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Option<Arc<PublicState>> {
        let inner = self.lock();
        inner
            .states
            .get(robot)?
            .iter()
            .find(|state| (state.epoch, state.tick) == (epoch, tick))
            .cloned()
    }

    /// Answers a query now, or when there is something to answer.
    pub(crate) fn ask(&self, query: Query) {
        self.lock().respond(query);
    }
}

impl Inner {
    fn respond(&mut self, query: Query) {
        match self.judge(&query) {
            Verdict::Answer(state) => reply(&query, &state),
            Verdict::Early if self.early.len() < MAX_EARLY => self.early.push(query),
            Verdict::Early => query.reply_err("too many queries are waiting already"),
            Verdict::Never(reason) => query.reply_err(&reason),
        }
    }

    fn judge(&self, query: &Query) -> Verdict {
        let never = |reason: &str| Verdict::Never(reason.to_owned());
        let Some(states) = Keys::robot_of(query.key()).and_then(|name| self.states.get(name))
        else {
            return never("ask one robot by its name");
        };
        let Some(newest) = states.back() else {
            return Verdict::Early;
        };
        let Some(tick) = query.parameter("tick") else {
            return Verdict::Answer(newest.clone());
        };
        let Ok(tick) = tick.parse::<Tick>() else {
            return never("parameter tick: not a whole number");
        };
        if let Some(epoch) = query.parameter("epoch") {
            match epoch.parse::<Epoch>() {
                Ok(epoch) if epoch == newest.epoch => {}
                Ok(epoch) if epoch > newest.epoch => return Verdict::Early,
                Ok(_) => return never("that epoch is over"),
                Err(_) => return never("parameter epoch: not a whole number"),
            }
        }
        // Asked during tick t, everybody answers with the state reported for t - 1.
        match states
            .iter()
            .find(|state| state.tick.checked_add(1) == Some(tick))
        {
            Some(state) => Verdict::Answer(state.clone()),
            None if tick.checked_sub(2) == Some(newest.tick) => Verdict::Early,
            None if tick > newest.tick => never("that tick is far away"),
            None => never("that tick is over"),
        }
    }
}

fn reply(query: &Query, state: &PublicState) {
    let what = Keys::last_chunk(query.key());
    match state.answer(what) {
        _ if what == STATE => query.reply(query.key(), encode(state)),
        Some(answer) => query.reply(query.key(), encode(&answer)),
        None => query.reply_err(&format!("there is no query called {what}")),
    }
}
