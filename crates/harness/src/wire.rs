//! The kit's end of the wire in one run: what it declares there, and what arrives.

use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, QUERY_TIMEOUT, Qos, Query, Reply};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Command, JoinRequest};
use protocol::{RobotName, decode, encode};

use crate::report::RuleFailure;

/// Messages that may queue up before the robot's link is slowed down.
const QUEUE: usize = 65_536;
/// How often a query is repeated whose time was up.
const ATTEMPTS: usize = 4;

/// All that a robot can put or ask.
pub(crate) enum WireEvent {
    Join(Query),
    Report {
        key: String,
        bytes: Vec<u8>,
        at: Instant,
        qos: Qos,
    },
    State {
        bytes: Vec<u8>,
        qos: Qos,
    },
    Command {
        key: String,
        bytes: Vec<u8>,
        qos: Qos,
    },
    Waiting {
        key: String,
        bytes: Vec<u8>,
        qos: Qos,
    },
    Token {
        robot: String,
        is_present: bool,
    },
    /// Something was put on, or a token declared at, a key that is not the robot's.
    Foreign(String),
    /// A query of the kit, by its number, has its reply.
    Reply(usize, Option<Reply>),
}

/// A robot asks to take part.
pub struct Joining {
    /// The query, which the answer ends.
    pub query: Query,
    /// The key of the query.
    pub key: String,
    /// The request, or why it cannot be read.
    pub request: Result<JoinRequest, String>,
}

impl Joining {
    /// Reads the request.
    pub fn new(query: Query) -> Self {
        let key = query.key().to_owned();
        let request = decode(&key, "a robot", &query.body()).map_err(|error| error.to_string());
        Self {
            query,
            key,
            request,
        }
    }
}

/// The declarations of one run, and the queue of what arrives.
pub(crate) struct Wire {
    bus: Bus,
    keys: Keys,
    queue: SyncSender<WireEvent>,
    events: Receiver<WireEvent>,
    clock: Publisher,
    declared: Vec<Declared>,
    simulator: Option<Declared>,
    queries: usize,
}

impl Wire {
    /// Declares all that a simulator declares, its token last.
    pub(crate) fn open(bus: &Bus, keys: &Keys) -> Result<Self, BusError> {
        let (queue, events) = std::sync::mpsc::sync_channel(QUEUE);
        let declared = listen(bus, keys, &queue)?;
        let clock = bus.publisher(&keys.clock())?;
        let simulator = bus.token(&keys.alive_sim())?;

        Ok(Self {
            bus: bus.clone(),
            keys: keys.clone(),
            queue,
            events,
            clock,
            declared,
            simulator: Some(simulator),
            queries: 0,
        })
    }

    /// Keeps further declarations until the run is over.
    pub(crate) fn keep(&mut self, declared: impl IntoIterator<Item = Declared>) {
        self.declared.extend(declared);
    }

    /// Puts a command on a key from which the medium takes it.
    pub(crate) fn put_command(&self, key: &str, command: &Command) -> Result<(), RuleFailure> {
        self.bus.put(key, encode(command))?;
        Ok(())
    }

    /// Deletes the keys of the clock and of a robot's news, as a tool may do.
    pub(crate) fn delete(&self, robot: &RobotName) -> Result<(), RuleFailure> {
        for key in [self.keys.clock(), self.keys.news(robot)] {
            self.bus.delete(&key)?;
        }
        Ok(())
    }

    /// Watches what a robot may not put: the states of these others, whom the kit plays.
    pub(crate) fn guard<'n>(
        &mut self,
        others: impl IntoIterator<Item = &'n RobotName>,
    ) -> Result<(), BusError> {
        for other in others {
            let key = self.keys.query(other, STATE);
            let declared = watch(&self.bus, &key, &self.queue)?;
            self.declared.push(declared);
        }
        Ok(())
    }

    /// The next that arrives.
    pub(crate) fn receive(&self, patience: Duration) -> Option<WireEvent> {
        self.events.recv_timeout(patience).ok()
    }

    /// Subscribes to the state that a robot puts.
    pub(crate) fn follow(&mut self, robot: &RobotName) -> Result<(), BusError> {
        let sender = self.queue.clone();
        let key = self.keys.query(robot, STATE);
        let states = self.bus.subscribe_with_qos(&key, move |_, bytes, qos| {
            let _over = sender.send(WireEvent::State {
                bytes: bytes.into(),
                qos,
            });
        })?;
        self.declared.push(states);
        Ok(())
    }

    /// Puts a clock, or something else on the key of clocks.
    pub(crate) fn put_clock(&self, bytes: Vec<u8>) -> Result<(), RuleFailure> {
        Ok(self.clock.put(bytes)?)
    }

    /// Puts news for a robot, or something else on the key of its news.
    pub(crate) fn put_news(&self, robot: &RobotName, bytes: Vec<u8>) -> Result<(), RuleFailure> {
        Ok(self.bus.put(&self.keys.news(robot), bytes)?)
    }

    /// Undeclares the simulator's liveliness token, or declares it again.
    pub(crate) fn show_simulator(&mut self, is_present: bool) -> Result<(), RuleFailure> {
        self.simulator = None;
        if is_present {
            self.simulator = Some(self.bus.token(&self.keys.alive_sim())?);
        }
        Ok(())
    }

    /// Queries a robot; `None` if no queryable replies. A query whose time is up is sent again: a robot that has the key
    /// and a loaded machine may be late, and a key without a queryable is known at once.
    pub(crate) fn ask(&self, key: &str, parameters: &str) -> Result<Option<Reply>, RuleFailure> {
        for _ in 0..ATTEMPTS {
            let begun = Instant::now();
            let reply = self.bus.get(key, parameters, None)?;
            if reply.is_some() || begun.elapsed() < QUERY_TIMEOUT {
                return Ok(reply);
            }
        }
        Ok(None)
    }

    /// Queries a key without waiting. The reply arrives as an event with the number that this returns.
    pub(crate) fn begin_query(
        &mut self,
        key: &str,
        parameters: &str,
    ) -> Result<usize, RuleFailure> {
        let number = self.queries;
        self.queries += 1;
        let sender = self.queue.clone();
        self.bus.get_then(key, parameters, move |reply| {
            let _over = sender.send(WireEvent::Reply(number, reply));
        })?;
        Ok(number)
    }
}

/// Notices what is put on keys of others. What the kit puts there itself is of its own session.
fn watch(bus: &Bus, keys: &str, queue: &SyncSender<WireEvent>) -> Result<Declared, BusError> {
    let sender = queue.clone();
    bus.subscribe_to_others(keys, move |key| {
        let _over = sender.send(WireEvent::Foreign(key.to_owned()));
    })
}

/// Subscribes to all that the robots of a run put, and receives their requests. A send fails only when the harness is over.
fn listen(
    bus: &Bus,
    keys: &Keys,
    queue: &SyncSender<WireEvent>,
) -> Result<Vec<Declared>, BusError> {
    let sender = queue.clone();
    let reports = bus.subscribe_with_qos(&keys.reports(), move |key, bytes, qos| {
        let _over = sender.send(WireEvent::Report {
            key: key.into(),
            bytes: bytes.into(),
            at: Instant::now(),
            qos,
        });
    })?;

    // On the robot's outbox, or on the keys of the targets.
    let mut commands = Vec::new();
    for keys in [keys.outboxes(), keys.commands()] {
        let sender = queue.clone();
        commands.push(bus.subscribe_with_qos(&keys, move |key, bytes, qos| {
            let _over = sender.send(WireEvent::Command {
                key: key.into(),
                bytes: bytes.into(),
                qos,
            });
        })?);
    }

    let sender = queue.clone();
    let waiting = bus.subscribe_with_qos(&keys.all_waiting(), move |key, bytes, qos| {
        let _over = sender.send(WireEvent::Waiting {
            key: key.into(),
            bytes: bytes.into(),
            qos,
        });
    })?;

    let sender = queue.clone();
    let joins = bus.queryable(&keys.joins(), move |query| {
        let _over = sender.send(WireEvent::Join(query));
    })?;

    let sender = queue.clone();
    let tokens = bus.liveliness(&keys.alive_robots(), move |key, is_present| {
        let _over = sender.send(WireEvent::Token {
            robot: Keys::last_chunk(key).to_owned(),
            is_present,
        });
    })?;

    let sender = queue.clone();
    let viewers = bus.liveliness(&keys.alive_viewer(), move |key, _| {
        let _over = sender.send(WireEvent::Foreign(key.to_owned()));
    })?;
    for foreign in [
        keys.clock(),
        keys.all_news(),
        keys.world(),
        keys.log(),
        keys.faults(),
    ] {
        commands.push(watch(bus, &foreign, queue)?);
    }

    commands.extend([reports, waiting, joins, tokens, viewers]);
    Ok(commands)
}
