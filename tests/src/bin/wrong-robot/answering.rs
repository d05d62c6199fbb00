//! Queries of other robots, answered on the middleware's thread.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bus::Query;
use lockstep::{Participant, StateQuery};
use protocol::keys::Keys;
use protocol::messages::{CommandText, PublicState, Report, TickUpdate};
use protocol::{Epoch, encode};

use crate::wrong::Wrong;

pub(crate) type Machine = Participant<TickUpdate, PublicState, CommandText, Report>;

/// What the robot is doing when a query arrives.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    Idle,
    Computing,
    Asking,
    AwaitingNews,
}

/// What the middleware's threads share with the loop.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) machine: Arc<Mutex<Machine>>,
    pub(crate) phase: Arc<AtomicU8>,
    pub(crate) deferred: Arc<Mutex<Vec<Query>>>,
    pub(crate) has_reported: Arc<AtomicBool>,
    /// Whether it knows that somebody watches.
    pub(crate) is_watched: Arc<AtomicBool>,
    pub(crate) wrong: Wrong,
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    pub(crate) fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
        if phase == Phase::Idle {
            for query in std::mem::take(&mut *lock(&self.deferred)) {
                self.answer(query);
            }
        }
    }

    pub(crate) fn is_in(&self, phase: Phase) -> bool {
        self.phase.load(Ordering::SeqCst) == phase as u8
    }

    pub(crate) fn receive(&self, query: Query) {
        let wrong = &self.wrong;
        let is_computing = self.is_in(Phase::Computing);
        let is_asking = self.is_in(Phase::Asking);
        let is_deferred = wrong.is("query.at-once") && (is_computing || is_asking)
            || wrong.is("query.at-once:computes") && is_computing
            || wrong.is("query.at-once:waits") && is_asking
            || wrong.is("query.at-once:news") && self.is_in(Phase::AwaitingNews);

        if is_deferred {
            lock(&self.deferred).push(query);
        } else {
            self.answer(query);
        }
    }

    fn answer(&self, query: Query) {
        let tick = whole_number(&query, "tick");
        let epoch = whole_number(&query, "epoch");
        if tick == Ok(None) && self.wrong.is("determinism.seed:asked") {
            self.is_watched.store(true, Ordering::SeqCst);
        }
        if epoch.is_err() && self.wrong.is("query.unknown") {
            std::process::exit(1);
        }
        let Ok(tick) = tick else {
            return query.reply_err("tick is not a whole number");
        };
        let Ok(epoch) = epoch else {
            return query.reply_err("epoch is not a whole number");
        };

        let wanted = StateQuery {
            tick,
            epoch: epoch.and_then(|epoch| Epoch::try_from(epoch).ok()),
        };
        let machine = lock(&self.machine);
        let newest = machine.query(StateQuery::default());
        let mut found = machine.query(wanted);
        if let Ok(newest) = &newest
            && tick.is_none()
            && !self.has_reported.load(Ordering::SeqCst)
            && self.wrong.is("return.generation:newest")
        {
            let tick = Some(newest.tick);
            found = machine.query(StateQuery { tick, ..wanted });
        }
        drop(machine);

        if let Ok(state) = &found
            && let Ok(newest) = &newest
            && state.tick < newest.tick
            && self.has_reported.load(Ordering::SeqCst)
            && self.wrong.is("query.tick")
        {
            return query.reply_err("only the newest state is kept");
        }
        if found.is_err()
            && (self.wrong.is("query.tick:any")
                || tick.is_none() && self.wrong.is("query.tick:epoch"))
        {
            found = newest;
        }

        match found {
            Ok(state) => {
                let mut answer = state.answer(Keys::last_chunk(query.key()));
                if self.wrong.is("query.at-once:parts") && !self.is_in(Phase::Idle) {
                    answer.iter_mut().for_each(|answer| answer.tick += 1);
                }
                let bytes = answer.map_or_else(|| encode(&state), |answer| encode(&answer));
                let mut key = query.key().to_owned();
                if self.wrong.is("query.once:wildcard") {
                    let own = Keys::robot_of(&key).unwrap_or_default();
                    key = key.replace(&format!("/{own}/"), "/*/");
                }
                query.reply(&key, bytes.clone());
                if self.wrong.is("query.once") {
                    query.reply(&key, bytes);
                }
            }
            Err(reason) => query.reply_err(&reason.to_string()),
        }
        if self.wrong.is("query.once:holds") {
            std::mem::forget(query);
        }
    }
}

/// A parameter of a query that must be a whole number.
fn whole_number(query: &Query, name: &str) -> Result<Option<u64>, std::num::ParseIntError> {
    query.parameter(name).map(str::parse::<u64>).transpose()
}
