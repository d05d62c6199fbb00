//! The star itself: sessions, links, and the router in the middle. No threads in here; everything that calls back is
//! handed out in [`Calls`], to be called without the lock.

use std::any::Any;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::Instant;

use super::faults::{Faults, Traffic};
use super::overheard::Overheard;
use super::query::{Asked, Ending, PeerId, Query, ReplyLink};
use crate::reply::{Pending, Reply};
use protocol::random::{Stream, stream, unit};

/// What is to be called once the lock is free.
pub(super) type Calls = Vec<Box<dyn FnOnce() + Send>>;

type OnMessage = Arc<dyn Fn(&str, &[u8]) + Send + Sync>;
type OnQuestion = Arc<dyn Fn(Query) + Send + Sync>;
type OnToken = Arc<dyn Fn(&str, bool) + Send + Sync>;

/// What a session has declared.
#[derive(Clone)]
pub(super) enum Declaration {
    Publish(String, Arc<AtomicBool>),
    Subscribe(String, OnMessage),
    Serve(String, OnQuestion),
    Token(String),
    Watch(String, OnToken),
}

/// What travels on a link.
#[derive(Clone)]
pub(super) enum Message {
    Declare(u64, Declaration),
    Undeclare(u64),
    Put(Arc<str>, Arc<[u8]>),
    Ask(u64, Arc<Asked>),
    Reply(u64, Reply),
    /// No more answers.
    Done(u64),
    /// To the watcher of this number: a token came or went.
    Token(u64, String, bool),
    /// To the publisher of this number: whether anybody subscribes.
    Matching(u64, bool),
    Close,
}

/// One direction between a session and the router.
struct Link {
    queue: VecDeque<Message>,
    random: Stream,
    naps_until: Option<Instant>,
    /// Puts that are still to be lost.
    losing: u32,
}

/// A session.
struct Peer {
    up: Link,
    down: Link,
    can_break: bool,
    is_closed: bool,
    cut_until: Option<Instant>,
    /// At the session: what it has declared, in order.
    declared: BTreeMap<u64, Declaration>,
    /// At the router: what has arrived of it.
    known: BTreeMap<u64, Declaration>,
    /// At the session: queries without an answer.
    asks: BTreeMap<u64, (Instant, Pending)>,
    /// At the session: tokens that each of its watchers sees.
    seen: BTreeSet<(u64, String)>,
}

/// A query at the router.
struct Routed {
    asker: PeerId,
    waits_for: BTreeSet<PeerId>,
}

#[derive(Debug, Clone, Copy)]
enum Way {
    Up,
    Down,
}

pub(super) struct Star {
    seed: u64,
    faults: Faults,
    choice: Stream,
    peers: BTreeMap<PeerId, Peer>,
    queries: BTreeMap<u64, Routed>,
    next_id: u64,
    /// Sessions so far: a number is never given twice.
    joined: PeerId,
    /// Queries are answered through it.
    replies: Weak<dyn ReplyLink>,
    /// What is to be dropped without the lock: a callback may own queries, and a query that is dropped sends.
    rubbish: Vec<Box<dyn Any + Send>>,
    pub(super) traffic: Traffic,
    /// What the router has heard, while somebody listens in.
    pub(super) overheard: Option<Vec<Overheard>>,
    pub(super) is_over: bool,
}

/// Whether the key expression covers the key: `*` stands for one chunk.
fn covers(expression: &str, key: &str) -> bool {
    let (mut expected, mut chunks) = (expression.split('/'), key.split('/'));
    loop {
        match (expected.next(), chunks.next()) {
            (None, None) => return true,
            (Some(expected), Some(chunk)) if expected == "*" || expected == chunk => {}
            _ => return false,
        }
    }
}

impl Peer {
    fn link(&mut self, way: Way) -> &mut Link {
        match way {
            Way::Up => &mut self.up,
            Way::Down => &mut self.down,
        }
    }

    /// Its watchers see all tokens go.
    fn lose_sight(&mut self, calls: &mut Calls) {
        for (watcher, key) in std::mem::take(&mut self.seen) {
            if let Some(Declaration::Watch(_, handle)) = self.declared.get(&watcher) {
                let handle = handle.clone();
                calls.push(Box::new(move || handle(&key, false)));
            }
        }
    }

    fn subscribes_to(&self, key: &str) -> bool {
        let covers =
            |d: &Declaration| matches!(d, Declaration::Subscribe(keys, _) if covers(keys, key));
        self.known.values().any(covers)
    }

    fn serves(&self, key: &str) -> bool {
        self.known
            .values()
            .any(|d| matches!(d, Declaration::Serve(keys, _) if covers(keys, key)))
    }

    fn has_token(&self, key: &str) -> bool {
        self.known
            .values()
            .any(|d| matches!(d, Declaration::Token(own) if own == key))
    }
}

impl Overheard {
    /// What a message says to whoever listens in; `None` if it is of no interest to anybody else.
    fn of(message: &Message) -> Option<Self> {
        Some(match message {
            Message::Put(key, bytes) => Self::Put {
                key: key.to_string(),
                message: bytes.to_vec(),
            },
            Message::Ask(query, asked) => Self::Asked {
                query: *query,
                key: asked.key.clone(),
                parameters: asked.parameters.clone(),
                body: asked.body.clone(),
            },
            Message::Reply(query, answer) => Self::Answered {
                query: *query,
                result: answer.result.clone(),
            },
            Message::Declare(_, Declaration::Token(key)) => Self::Token { key: key.clone() },
            _ => return None,
        })
    }
}

impl Star {
    pub(super) fn new(seed: u64, faults: Faults, replies: Weak<dyn ReplyLink>) -> Self {
        Self {
            seed,
            faults,
            choice: stream(seed, "choice"),
            peers: BTreeMap::new(),
            queries: BTreeMap::new(),
            next_id: 0,
            joined: 0,
            replies,
            rubbish: Vec::new(),
            traffic: Traffic::default(),
            overheard: None,
            is_over: false,
        }
    }

    /// The end: all that is left, to be dropped without the lock.
    pub(super) fn clear(&mut self) -> impl Send + use<> {
        (
            std::mem::take(&mut self.peers),
            std::mem::take(&mut self.rubbish),
        )
    }

    fn id(&mut self) -> u64 {
        self.next_id += 1;
        self.next_id
    }

    // What sessions do.

    pub(super) fn join(&mut self, can_break: bool) -> PeerId {
        let number = self.joined;
        self.joined += 1;
        let link = |way: &str| Link {
            queue: VecDeque::new(),
            random: stream(self.seed, &format!("link/{number}/{way}")),
            naps_until: None,
            losing: 0,
        };
        let peer = Peer {
            up: link("up"),
            down: link("down"),
            can_break,
            is_closed: false,
            cut_until: None,
            declared: BTreeMap::new(),
            known: BTreeMap::new(),
            asks: BTreeMap::new(),
            seen: BTreeSet::new(),
        };
        self.peers.insert(number, peer);
        number
    }

    pub(super) fn send(&mut self, from: PeerId, message: Message) -> Result<(), &'static str> {
        let peer = self
            .peers
            .get_mut(&from)
            .filter(|peer| !peer.is_closed)
            .ok_or("the session is closed")?;
        if peer.cut_until.is_some() {
            self.traffic.lost += 1;
        } else {
            peer.up.queue.push_back(message);
        }
        Ok(())
    }

    pub(super) fn declare(
        &mut self,
        from: PeerId,
        declaration: Declaration,
    ) -> Result<u64, &'static str> {
        let id = self.id();
        self.send(from, Message::Declare(id, declaration.clone()))?;
        if let Some(peer) = self.peers.get_mut(&from) {
            peer.declared.insert(id, declaration);
        }
        Ok(id)
    }

    pub(super) fn undeclare(&mut self, from: PeerId, id: u64) {
        let Some(peer) = self.peers.get_mut(&from) else {
            return;
        };
        self.rubbish.push(Box::new(peer.declared.remove(&id)));
        peer.seen.retain(|(watcher, _)| *watcher != id);
        // A session that is closed withdraws everything anyway.
        let _ = self.send(from, Message::Undeclare(id));
    }

    /// Returns the continuation where the query cannot be asked.
    pub(super) fn get(
        &mut self,
        from: PeerId,
        asked: Asked,
        deadline: Instant,
        then: Pending,
    ) -> Option<Pending> {
        let id = self.id();
        let is_cut = self
            .peers
            .get(&from)
            .is_none_or(|peer| peer.cut_until.is_some() || peer.is_closed);
        if is_cut || self.send(from, Message::Ask(id, Arc::new(asked))).is_err() {
            return Some(then);
        }
        if let Some(peer) = self.peers.get_mut(&from) {
            peer.asks.insert(id, (deadline, then));
        }
        None
    }

    /// The session says no more; what it has said is delivered. Returns whoever waits for an answer.
    pub(super) fn close(&mut self, from: PeerId) -> Vec<Pending> {
        let is_closed = self.send(from, Message::Close).is_err();
        let Some(peer) = self.peers.get_mut(&from).filter(|_| !is_closed) else {
            return Vec::new();
        };
        peer.is_closed = true;
        std::mem::take(&mut peer.asks)
            .into_values()
            .map(|(_, then)| then)
            .collect()
    }

    /// The process is killed: some of what it said last never left it. Whatever of it lives on in this process finds its
    /// link broken for good.
    pub(super) fn kill(&mut self, from: PeerId, calls: &mut Calls) {
        let Some(peer) = self.peers.get_mut(&from).filter(|peer| !peer.is_closed) else {
            return;
        };
        let draw = unit(&mut peer.up.random);
        let kept = (draw * (peer.up.queue.len() + 1) as f64) as usize;
        self.traffic.lost += (peer.up.queue.len() - kept) as u64;
        peer.up.queue.truncate(kept);
        peer.lose_sight(calls);
        let ended = self.close(from);
        calls.push(Box::new(move || drop(ended)));
    }

    // What the scheduler does.

    /// When something is due that no message causes.
    pub(super) fn next_due(&self) -> Option<Instant> {
        let of_peer = |peer: &Peer| {
            let naps = [&peer.up, &peer.down]
                .into_iter()
                .filter(|link| !link.queue.is_empty());
            let naps = naps.filter_map(|link| link.naps_until).min();
            let asks = peer.asks.values().map(|(deadline, _)| *deadline).min();
            [naps, asks, peer.cut_until].into_iter().flatten().min()
        };
        self.peers.values().filter_map(of_peer).min()
    }

    /// One delivery, or what is due instead. Returns whether there was anything on a link that could move.
    pub(super) fn deliver_one(&mut self, now: Instant, calls: &mut Calls) -> bool {
        self.heal_and_expire(now, calls);
        let rubbish = std::mem::take(&mut self.rubbish);
        if !rubbish.is_empty() {
            calls.push(Box::new(move || drop(rubbish)));
        }
        let mut ready = Vec::new();
        for (number, peer) in &mut self.peers {
            for way in [Way::Up, Way::Down] {
                let link = peer.link(way);
                link.naps_until = link.naps_until.filter(|until| *until > now);
                if link.naps_until.is_none() && !link.queue.is_empty() {
                    ready.push((*number, way));
                }
            }
        }
        if ready.is_empty() {
            return false;
        }
        let chosen = (unit(&mut self.choice) * ready.len() as f64) as usize;
        let (number, way) = ready[chosen];
        if let Some(message) = self.take(number, way, now, calls) {
            self.traffic.delivered += 1;
            match way {
                Way::Up => self.route(number, message),
                Way::Down => self.receive(number, message, calls),
            }
        }
        true
    }

    /// The next message of a link, unless the link does something else with it.
    fn take(
        &mut self,
        number: PeerId,
        way: Way,
        now: Instant,
        calls: &mut Calls,
    ) -> Option<Message> {
        let faults = self.faults;
        let peer = self.peers.get_mut(&number)?;
        let can_break = peer.can_break;
        let link = peer.link(way);
        // Always the same number of draws, so that what happens to a message depends on its number alone.
        let [nap, cut, loss, duplicate, how_much] = std::array::from_fn(|_| unit(&mut link.random));
        let some_time = faults.longest.mul_f64(how_much);
        if nap < faults.nap {
            link.naps_until = Some(now + some_time);
            self.traffic.naps += 1;
            return None;
        }
        if can_break && cut < faults.cut {
            self.cut(number, now + some_time, calls);
            return None;
        }
        let message = link.queue.pop_front()?;
        if !matches!(message, Message::Put(..)) {
            return Some(message);
        }
        if can_break && link.losing == 0 && loss < faults.loss {
            link.losing = 1 + (how_much * 4.0) as u32;
        }
        if link.losing > 0 {
            link.losing -= 1;
            self.traffic.lost += 1;
            return None;
        }
        if duplicate < faults.duplicate {
            link.queue.push_back(message.clone());
            self.traffic.duplicated += 1;
        }
        Some(message)
    }

    fn heal_and_expire(&mut self, now: Instant, calls: &mut Calls) {
        for peer in self.peers.values_mut() {
            let late: Vec<u64> = peer
                .asks
                .iter()
                .filter(|(_, (deadline, _))| *deadline <= now)
                .map(|(id, _)| *id)
                .collect();
            for (_, then) in late.into_iter().filter_map(|id| peer.asks.remove(&id)) {
                calls.push(Box::new(move || drop(then)));
            }
            if peer.cut_until.is_some_and(|until| until <= now) {
                peer.cut_until = None;
                // One that was closed meanwhile comes back only to be forgotten.
                let anew = peer
                    .declared
                    .iter()
                    .map(|(id, d)| Message::Declare(*id, d.clone()));
                let anew = anew
                    .filter(|_| !peer.is_closed)
                    .chain(peer.is_closed.then_some(Message::Close));
                peer.up.queue.extend(anew);
            }
        }
    }

    /// A link breaks: both ends notice, and everything on it is lost.
    fn cut(&mut self, number: PeerId, until: Instant, calls: &mut Calls) {
        let Some(peer) = self.peers.get_mut(&number) else {
            return;
        };
        self.traffic.cuts += 1;
        self.traffic.lost += (peer.up.queue.len() + peer.down.queue.len()) as u64;
        self.rubbish.push(Box::new((
            std::mem::take(&mut peer.up.queue),
            std::mem::take(&mut peer.down.queue),
        )));
        peer.cut_until = Some(until);
        for (_, then) in std::mem::take(&mut peer.asks).into_values() {
            calls.push(Box::new(move || drop(then)));
        }
        peer.lose_sight(calls);
        for declaration in peer.declared.values() {
            if let Declaration::Publish(_, watched) = declaration {
                watched.store(false, Ordering::Relaxed);
            }
        }
        let is_closed = peer.is_closed;
        self.forget(number);
        if is_closed {
            self.rubbish.push(Box::new(self.peers.remove(&number)));
        }
    }

    /// The router gives up what it knows of a session.
    fn forget(&mut self, number: PeerId) {
        let Some(peer) = self.peers.get_mut(&number) else {
            return;
        };
        let known: Vec<u64> = peer.known.keys().copied().collect();
        known.into_iter().for_each(|id| self.withdraw(number, id));
        self.queries.retain(|_, routed| routed.asker != number);
        let waiting: Vec<u64> = self.queries.keys().copied().collect();
        waiting
            .into_iter()
            .for_each(|query| self.end_at(query, number));
    }

    /// To a session, if its link is there.
    fn tell(&mut self, number: PeerId, message: Message) {
        if let Some(peer) = self
            .peers
            .get_mut(&number)
            .filter(|peer| peer.cut_until.is_none())
        {
            peer.down.queue.push_back(message);
        }
    }

    /// A message has come up to the router.
    fn route(&mut self, from: PeerId, message: Message) {
        if let (Some(overheard), Some(heard)) = (&mut self.overheard, Overheard::of(&message)) {
            overheard.push(heard);
        }
        match message {
            Message::Put(key, bytes) => {
                for peer in self
                    .peers
                    .values_mut()
                    .filter(|peer| peer.subscribes_to(&key))
                {
                    peer.down
                        .queue
                        .push_back(Message::Put(key.clone(), bytes.clone()));
                }
            }
            Message::Ask(id, asked) => {
                let serving = self
                    .peers
                    .iter()
                    .filter(|(_, peer)| peer.serves(&asked.key));
                let waits_for: BTreeSet<PeerId> = serving.map(|(number, _)| *number).collect();
                if waits_for.is_empty() {
                    return self.tell(from, Message::Done(id));
                }
                waits_for
                    .iter()
                    .for_each(|to| self.tell(*to, Message::Ask(id, asked.clone())));
                self.queries.insert(
                    id,
                    Routed {
                        asker: from,
                        waits_for,
                    },
                );
            }
            Message::Reply(id, answer) => {
                if let Some(asker) = self.queries.get(&id).map(|routed| routed.asker) {
                    self.tell(asker, Message::Reply(id, answer));
                }
            }
            Message::Done(id) => self.end_at(id, from),
            Message::Declare(id, declaration) => self.know(from, id, declaration),
            Message::Undeclare(id) => self.withdraw(from, id),
            Message::Close => {
                self.forget(from);
                self.rubbish.push(Box::new(self.peers.remove(&from)));
            }
            Message::Token(..) | Message::Matching(..) => {
                unreachable!("only the router says these")
            }
        }
    }

    /// A session has nothing more to say to a query.
    fn end_at(&mut self, query: u64, number: PeerId) {
        let Some(routed) = self.queries.get_mut(&query) else {
            return;
        };
        if routed.waits_for.remove(&number) && routed.waits_for.is_empty() {
            let asker = routed.asker;
            self.queries.remove(&query);
            self.tell(asker, Message::Done(query));
        }
    }

    fn know(&mut self, from: PeerId, id: u64, declaration: Declaration) {
        match &declaration {
            Declaration::Token(key) if !self.is_there(key) => self.tell_watchers(key, true),
            Declaration::Watch(keys, _) => {
                let tokens = self.peers.values().flat_map(|peer| peer.known.values());
                let tokens: BTreeSet<String> = tokens
                    .filter_map(|d| match d {
                        Declaration::Token(key) if covers(keys, key) => Some(key.clone()),
                        _ => None,
                    })
                    .collect();
                tokens
                    .into_iter()
                    .for_each(|key| self.tell(from, Message::Token(id, key, true)));
            }
            Declaration::Publish(key, _) => {
                let is_watched = self.peers.values().any(|peer| peer.subscribes_to(key));
                self.tell(from, Message::Matching(id, is_watched));
            }
            _ => {}
        }
        let subscribes =
            matches!(declaration, Declaration::Subscribe(..)).then(|| declaration.clone());
        if let Some(peer) = self.peers.get_mut(&from) {
            peer.known.insert(id, declaration);
        }
        if let Some(Declaration::Subscribe(keys, _)) = subscribes {
            self.tell_publishers(&keys);
        }
    }

    fn withdraw(&mut self, from: PeerId, id: u64) {
        let declaration = self
            .peers
            .get_mut(&from)
            .and_then(|peer| peer.known.remove(&id));
        match declaration {
            Some(Declaration::Token(key)) if !self.is_there(&key) => {
                self.tell_watchers(&key, false);
            }
            Some(Declaration::Subscribe(keys, handle)) => {
                self.rubbish.push(Box::new(handle));
                self.tell_publishers(&keys);
            }
            other => self.rubbish.push(Box::new(other)),
        }
    }

    fn is_there(&self, token: &str) -> bool {
        self.peers.values().any(|peer| peer.has_token(token))
    }

    fn tell_watchers(&mut self, token: &str, is_there: bool) {
        for peer in self.peers.values_mut() {
            for (id, declaration) in &peer.known {
                if matches!(declaration, Declaration::Watch(keys, _) if covers(keys, token)) {
                    peer.down
                        .queue
                        .push_back(Message::Token(*id, token.to_owned(), is_there));
                }
            }
        }
    }

    /// Subscribers of `keys` came or went.
    fn tell_publishers(&mut self, keys: &str) {
        let mut told = Vec::new();
        for (number, peer) in &self.peers {
            for (id, declaration) in &peer.known {
                if let Declaration::Publish(key, _) = declaration
                    && covers(keys, key)
                {
                    let is_watched = self.peers.values().any(|peer| peer.subscribes_to(key));
                    told.push((*number, Message::Matching(*id, is_watched)));
                }
            }
        }
        told.into_iter()
            .for_each(|(number, message)| self.tell(number, message));
    }

    /// A message has come down to a session.
    fn receive(&mut self, number: PeerId, message: Message, calls: &mut Calls) {
        let Some(peer) = self.peers.get_mut(&number) else {
            return;
        };
        match message {
            Message::Put(key, bytes) => {
                for declaration in peer.declared.values() {
                    if let Declaration::Subscribe(keys, handle) = declaration
                        && covers(keys, &key)
                    {
                        let (handle, key, bytes) = (handle.clone(), key.clone(), bytes.clone());
                        calls.push(Box::new(move || handle(&key, &bytes)));
                    }
                }
            }
            Message::Ask(query, asked) => {
                let Some(link) = self.replies.upgrade() else {
                    return;
                };
                let ending = Arc::new(Ending {
                    link,
                    peer: number,
                    query,
                });
                for declaration in peer.declared.values() {
                    if let Declaration::Serve(keys, handle) = declaration
                        && covers(keys, &asked.key)
                    {
                        let query = Query {
                            asked: asked.clone(),
                            ending: ending.clone(),
                        };
                        let handle = handle.clone();
                        calls.push(Box::new(move || handle(query)));
                    }
                }
                // Where nobody serves it any more, it ends with this.
                calls.push(Box::new(move || drop(ending)));
            }
            Message::Reply(id, answer) => {
                if let Some((_, mut then)) = peer.asks.remove(&id) {
                    calls.push(Box::new(move || then.settle(Some(answer))));
                }
            }
            Message::Done(id) => {
                if let Some((_, then)) = peer.asks.remove(&id) {
                    calls.push(Box::new(move || drop(then)));
                }
            }
            Message::Token(watcher, key, is_there) => {
                let Some(Declaration::Watch(_, handle)) = peer.declared.get(&watcher) else {
                    return;
                };
                let seen = (watcher, key.clone());
                let is_news = if is_there {
                    peer.seen.insert(seen)
                } else {
                    peer.seen.remove(&seen)
                };
                if is_news {
                    let handle = handle.clone();
                    calls.push(Box::new(move || handle(&key, is_there)));
                }
            }
            Message::Matching(id, is_watched) => {
                if let Some(Declaration::Publish(_, watched)) = peer.declared.get(&id) {
                    watched.store(is_watched, Ordering::Relaxed);
                }
            }
            Message::Declare(..) | Message::Undeclare(..) | Message::Close => {
                unreachable!("only sessions say these")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_one_chunk() {
        assert!(covers("cars/*/clock", "cars/demo/clock"));
        assert!(covers("a/*", "a/b") && !covers("a/*", "a/b/c") && !covers("a/*", "a"));
        assert!(!covers("a/b", "a/c") && covers("a/b", "a/b"));
    }
}
