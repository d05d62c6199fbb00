//! A bus inside one process whose deliveries are chosen by a seed: for tests of what is above it, under schedules that
//! a real network shows once in a year.
//!
//! It has the shape of the real one: a star. Every session has a link to the router and one back; a message goes up
//! one and down others. What the middleware guarantees holds here, too:
//!
//! - a link keeps its order, and so declarations are in effect before the token that follows them is seen;
//! - between links there is no order: the next delivery is chosen by the seed among all links that have something;
//! - nothing is lost unless a link breaks. Then everything on it is lost, what is said meanwhile is lost, queries end
//!   without an answer, tokens go; and when it heals, the session declares everything anew, in its old order.
//!
//! Beyond what the middleware does, a message may come a second time, late, and a few may be lost without anybody
//! noticing ([`Faults::duplicate`], [`Faults::loss`]): the contract promises to survive that as well.
//!
//! The seed chooses; when threads get to send is the machine's. So a seed repeats the faults of each link exactly (they
//! are drawn by the number of the message on it) and the schedule nearly.

mod faults;
mod overheard;
mod query;
mod star;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub use faults::{Faults, Traffic};
pub use overheard::Overheard;
pub(crate) use query::Query;

use crate::declared::Declared;
use crate::error::BusError;
use crate::qos::Qos;
use crate::reply::{Pending, QUERY_TIMEOUT, Reply};
use query::{Asked, PeerId, ReplyLink};
use star::{Calls, Declaration, Message, Star};

/// A network inside this process. Its sessions work until it is dropped.
#[derive(Debug)]
pub struct MemoryNetwork {
    shared: Arc<Shared>,
    scheduler: Option<JoinHandle<()>>,
}

/// What the sessions and the scheduler share.
struct Shared {
    star: Mutex<Star>,
    changed: Condvar,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Shared")
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Star> {
        self.star.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a message up, where the session is open; tells the scheduler.
    fn send(&self, peer: PeerId, message: Message) -> Result<(), &'static str> {
        let sent = self.lock().send(peer, message);
        self.changed.notify_one();
        sent
    }
}

impl ReplyLink for Shared {
    fn reply(&self, from: PeerId, query: u64, answer: Reply) -> Result<(), &'static str> {
        self.send(from, Message::Reply(query, answer))
    }

    fn done(&self, from: PeerId, query: u64) -> Result<(), &'static str> {
        self.send(from, Message::Done(query))
    }
}

impl MemoryNetwork {
    /// A network whose choices come from `seed`.
    #[must_use]
    pub fn new(seed: u64, faults: Faults) -> Self {
        let shared = Arc::new_cyclic(|shared: &Weak<Shared>| Shared {
            star: Mutex::new(Star::new(seed, faults, shared.clone())),
            changed: Condvar::new(),
        });
        let own = shared.clone();
        let scheduler = std::thread::spawn(move || deliver_all(&own, faults.pause));
        Self {
            shared,
            scheduler: Some(scheduler),
        }
    }

    /// A new session; `can_break` for one whose link may break.
    pub(super) fn session(&self, can_break: bool) -> Session {
        let peer = self.shared.lock().join(can_break);
        let open = Arc::new(Open {
            shared: self.shared.clone(),
            peer,
        });
        Session { open }
    }

    /// Kills the process behind a session.
    pub(super) fn kill_session(&self, session: &Session) {
        let mut calls = Calls::new();
        self.shared.lock().kill(session.open.peer, &mut calls);
        self.shared.changed.notify_one();
        calls.into_iter().for_each(|call| call());
    }

    /// Everything that came to the router since this was called last; the first call begins to listen in.
    #[must_use]
    pub fn overhear(&self) -> Vec<Overheard> {
        self.shared
            .lock()
            .overheard
            .replace(Vec::new())
            .unwrap_or_default()
    }

    /// What it has done so far.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.shared.lock().traffic
    }
}

impl Drop for MemoryNetwork {
    fn drop(&mut self) {
        self.shared.lock().is_over = true;
        self.shared.changed.notify_one();
        if let Some(scheduler) = self.scheduler.take() {
            // It panics only where a callback does, and then the test has failed in its own thread.
            let _ = scheduler.join();
        }
        // Callbacks may own queries, and those the network: nothing would ever be freed. Not under the lock.
        let rest = self.shared.lock().clear();
        drop(rest);
    }
}

/// The scheduler: one delivery after the other.
fn deliver_all(shared: &Shared, pause: Duration) {
    let mut star = shared.lock();
    while !star.is_over {
        let mut calls: Calls = Vec::new();
        let is_busy = star.deliver_one(Instant::now(), &mut calls);
        if !is_busy && calls.is_empty() {
            let due = star.next_due();
            star = match due.map(|due| due.saturating_duration_since(Instant::now())) {
                Some(wait) => {
                    shared
                        .changed
                        .wait_timeout(star, wait)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
                None => shared
                    .changed
                    .wait(star)
                    .unwrap_or_else(PoisonError::into_inner),
            };
            continue;
        }
        drop(star);
        // Callbacks run without the lock: they send.
        calls.into_iter().for_each(|call| call());
        if !pause.is_zero() {
            std::thread::sleep(pause);
        }
        star = shared.lock();
    }
}

/// A session. Clones share it; the last one closes it.
#[derive(Debug, Clone)]
pub(super) struct Session {
    open: Arc<Open>,
}

#[derive(Debug)]
struct Open {
    shared: Arc<Shared>,
    peer: PeerId,
}

impl Open {
    fn close(&self) {
        let ended = self.shared.lock().close(self.peer);
        self.shared.changed.notify_one();
        // Whoever waits for an answer is told without the lock.
        drop(ended);
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        self.close();
    }
}

/// Withdraws a declaration when it is dropped.
struct Guard {
    shared: Arc<Shared>,
    peer: PeerId,
    id: u64,
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.shared.lock().undeclare(self.peer, self.id);
        self.shared.changed.notify_one();
    }
}

fn legal(doing: &'static str, key: &str) -> Result<(), BusError> {
    let is_legal = |chunk: &str| !chunk.is_empty() && (chunk == "*" || !chunk.contains('*'));
    if key.split('/').all(is_legal) {
        return Ok(());
    }
    let reason =
        "a key has chunks between slashes; of wildcards it may have `*` for a whole one".to_owned();
    Err(BusError::Use {
        doing,
        key: key.to_owned(),
        reason,
    })
}

impl Session {
    pub(super) fn id(&self) -> String {
        format!("memory-{}", self.open.peer)
    }

    fn send(&self, doing: &'static str, key: &str, message: Message) -> Result<(), BusError> {
        legal(doing, key)?;
        let sent = self.open.shared.send(self.open.peer, message);
        sent.map_err(|reason| BusError::Use {
            doing,
            key: key.to_owned(),
            reason: reason.to_owned(),
        })
    }

    fn declare(
        &self,
        doing: &'static str,
        key: &str,
        declaration: Declaration,
    ) -> Result<Declared, BusError> {
        legal(doing, key)?;
        let Open { shared, peer } = &*self.open;
        let declared = shared.lock().declare(*peer, declaration);
        shared.changed.notify_one();
        let failed = |reason: &str| BusError::Use {
            doing,
            key: key.to_owned(),
            reason: reason.to_owned(),
        };
        let id = declared.map_err(failed)?;
        Ok(Declared::new(Guard {
            shared: shared.clone(),
            peer: *peer,
            id,
        }))
    }

    pub(super) fn publisher(&self, key: &str) -> Result<Publisher, BusError> {
        let watched = Arc::new(AtomicBool::new(false));
        let declared = self.declare(
            "publish on",
            key,
            Declaration::Publish(key.to_owned(), watched.clone()),
        )?;
        Ok(Publisher {
            session: self.clone(),
            key: key.to_owned(),
            watched,
            _declared: declared,
        })
    }

    pub(super) fn put(&self, key: &str, message: Vec<u8>) -> Result<(), BusError> {
        self.send("put on", key, Message::Put(key.into(), message.into()))
    }

    pub(super) fn subscribe(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8]) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        self.declare(
            "subscribe to",
            keys,
            Declaration::Subscribe(keys.to_owned(), Arc::new(handle)),
        )
    }

    pub(super) fn subscribe_with_qos(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8], Qos) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        self.subscribe(keys, move |key, bytes| handle(key, bytes, Qos::IN_ORDER))
    }

    pub(super) fn queryable(
        &self,
        keys: &str,
        handle: impl Fn(Query) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        self.declare(
            "serve",
            keys,
            Declaration::Serve(keys.to_owned(), Arc::new(handle)),
        )
    }

    pub(super) fn get_within(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<Option<Reply>, BusError> {
        let (sender, answers) = channel();
        // Whoever asks waits below, so there is somebody to receive.
        self.start(
            key,
            parameters,
            body,
            timeout,
            Pending::new(move |answer| drop(sender.send(answer))),
        )?;
        Ok(answers.recv().ok().flatten())
    }

    /// The one reply that this network passes on.
    pub(super) fn get_all(
        &self,
        key: &str,
        parameters: &str,
        timeout: Duration,
    ) -> Result<Vec<Reply>, BusError> {
        let reply = self.get_within(key, parameters, None, timeout)?;

        Ok(reply.into_iter().collect())
    }

    pub(super) fn get_then(
        &self,
        key: &str,
        parameters: &str,
        then: impl FnOnce(Option<Reply>) + Send + 'static,
    ) -> Result<(), BusError> {
        self.start(key, parameters, None, QUERY_TIMEOUT, Pending::new(then))
    }

    fn start(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
        then: Pending,
    ) -> Result<(), BusError> {
        legal("ask", key)?;
        let (key, parameters) = (key.to_owned(), parameters.to_owned());
        let asked = Asked {
            key,
            parameters,
            body: body.unwrap_or_default(),
        };
        let unasked =
            self.open
                .shared
                .lock()
                .get(self.open.peer, asked, Instant::now() + timeout, then);
        self.open.shared.changed.notify_one();
        // Where the link is cut, the query ends here, without the lock.
        drop(unasked);
        Ok(())
    }

    pub(super) fn token(&self, key: &str) -> Result<Declared, BusError> {
        self.declare("declare", key, Declaration::Token(key.to_owned()))
    }

    pub(super) fn liveliness(
        &self,
        keys: &str,
        handle: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        self.declare(
            "watch",
            keys,
            Declaration::Watch(keys.to_owned(), Arc::new(handle)),
        )
    }

    pub(super) fn close(&self) {
        self.open.close();
    }
}

#[derive(Debug)]
pub(super) struct Publisher {
    session: Session,
    key: String,
    watched: Arc<AtomicBool>,
    _declared: Declared,
}

impl Publisher {
    pub(super) fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        self.session.put(&self.key, message)
    }

    pub(super) fn has_subscribers(&self) -> bool {
        self.watched.load(Ordering::Relaxed)
    }
}
