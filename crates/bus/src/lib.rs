//! The bus: a middleware behind seven verbs.
//!
//! A simulator embeds the router and everything else is a client of it: one path between any two, which is what keeps
//! messages in order. No multicast, no gossip, loopback unless an address says otherwise.
//!
//! There are two of them. `middleware.rs` is the real one and the only file that names it. [`MemoryNetwork`] is a star
//! of the same shape inside one process whose deliveries are chosen by a seed, for tests of everything above it.

pub mod endpoint;
mod memory;
mod middleware;
pub mod runtime;
pub mod secure;
mod settings;

use std::path::PathBuf;
use std::time::Duration;

pub use protocol::DEFAULT_ENDPOINT;

pub use memory::{Faults, MemoryNetwork, Overheard, Traffic};
pub use middleware::check_exposure;

/// Longest wait for an answer before the asker looks again whether the other side is still there.
pub const QUERY_TIMEOUT: Duration = Duration::from_secs(2);

/// A failure of the bus itself.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// No session could be opened.
    #[error("cannot {doing} {endpoint}: {reason}")]
    Open {
        /// What was tried.
        doing: &'static str,
        /// The address tried.
        endpoint: String,
        /// What the middleware says.
        reason: String,
    },
    /// A simulator would be open to a network.
    #[error(
        "{0} can be reached from other machines, and whoever reaches it may control the run and pose as any robot; \
         either secure the run (`cars secure init` says how) and listen at tls/…, or say --insecure if you trust \
         everybody who can reach it"
    )]
    Exposed(String),
    /// Somebody would connect to a secured run and has nothing to show.
    #[error(
        "{0} wants a certificate: name a file zenoh.json5 that `cars secure init` made, by --zenoh-config or \
         CARS_ZENOH_CONFIG"
    )]
    NoCertificate(String),
    /// A configuration with access control does not fit a listener without certificates.
    #[error(
        "{0} is not encrypted, so nobody could show a certificate there: a secured run listens at tls/…"
    )]
    Unencrypted(String),
    /// A session that was open cannot do what was asked.
    #[error("bus: cannot {doing} {key}: {reason}")]
    Use {
        /// What was tried.
        doing: &'static str,
        /// The key concerned.
        key: String,
        /// What the middleware says.
        reason: String,
    },
}

/// How to take part.
#[derive(Debug, Clone)]
pub enum Role {
    /// Listen at this endpoint and route for everybody: the simulator.
    Router {
        /// For example `tcp/127.0.0.1:7447`.
        listen: String,
        /// Whether other machines may reach it without certificates and access control.
        trusts_network: bool,
    },
    /// Connect to this endpoint: everybody else.
    Client {
        /// For example `tcp/127.0.0.1:7447`.
        connect: String,
        /// How long to go on trying to reach it.
        patience: Duration,
    },
    /// Only forward, between a simulator and robots on different machines. What is empty is left to the
    /// configuration file.
    Relay {
        /// Where others reach it, for example `tcp/192.0.2.1:7447`.
        listen: Vec<String>,
        /// Other relays that it reaches.
        connect: Vec<String>,
        /// Whether other machines may reach it without certificates and access control.
        trusts_network: bool,
    },
}

/// A session. Clones share it; the last one closes it.
#[derive(Debug, Clone)]
pub struct Bus {
    session: Session,
}

#[derive(Debug, Clone)]
enum Session {
    Middleware(middleware::Session),
    Memory(memory::Session),
}

/// The quality of service of a put, as zenoh calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// Whether its congestion control is block; the other one, drop, loses messages.
    pub is_blocking: bool,
    /// Whether it is express: it may overtake what was put before.
    pub is_express: bool,
    /// Whether it has the default priority; messages of different priorities overtake each other.
    pub has_default_priority: bool,
}

impl Qos {
    /// What a message needs that takes part in a tick.
    pub const IN_ORDER: Self = Self {
        is_blocking: true,
        is_express: false,
        has_default_priority: true,
    };
}

/// A declaration, alive until dropped.
pub struct Declared {
    _inner: Box<dyn Send + Sync>,
}

impl std::fmt::Debug for Declared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Declared")
    }
}

/// The same verb of either bus.
macro_rules! on {
    ($kind:ident, $bus:expr, $inner:ident => $verb:expr) => {
        match $bus {
            $kind::Middleware($inner) => $verb,
            $kind::Memory($inner) => $verb,
        }
    };
}

impl Bus {
    /// Opens a session. `overrides` is a configuration file of the middleware that replaces the built-in settings,
    /// for set-ups across machines; `configs/zenoh/` has files that say the same as the built-in ones. What the role
    /// says (mode, where to listen or connect) holds in either case.
    ///
    /// # Errors
    /// [`BusError::Open`] names the address that was tried and what went wrong.
    pub fn open(role: &Role, overrides: Option<&PathBuf>) -> Result<Self, BusError> {
        Ok(Self {
            session: Session::Middleware(middleware::Session::open(role, overrides)?),
        })
    }

    /// An identity that no other session has.
    #[must_use]
    pub fn id(&self) -> String {
        on!(Session, &self.session, session => session.id())
    }

    /// Declares that messages will be put on `key`.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn publisher(&self, key: &str) -> Result<Publisher, BusError> {
        Ok(Publisher {
            inner: match &self.session {
                Session::Middleware(session) => Putter::Middleware(session.publisher(key)?),
                Session::Memory(session) => Putter::Memory(session.publisher(key)?),
            },
        })
    }

    /// Declares that pictures and lines for observers will be put on `key`. Where an observer does not keep up, they
    /// are dropped: nobody who watches may hold the clock.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn observer_publisher(&self, key: &str) -> Result<Publisher, BusError> {
        Ok(Publisher {
            inner: match &self.session {
                Session::Middleware(session) => {
                    Putter::Middleware(session.observer_publisher(key)?)
                }
                Session::Memory(session) => Putter::Memory(session.publisher(key)?),
            },
        })
    }

    /// Puts one message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn put(&self, key: &str, message: Vec<u8>) -> Result<(), BusError> {
        on!(Session, &self.session, session => session.put(key, message))
    }

    /// Calls `handle(key, bytes)` for each message put on `keys`. It runs on the thread that reads the link: it must
    /// hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn subscribe(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8]) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.subscribe(keys, handle))
    }

    /// The same with the quality of service that each message was put with.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn subscribe_with_qos(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8], Qos) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.subscribe_with_qos(keys, handle))
    }

    /// Calls `handle` for each query asked on `keys`. It must hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn queryable(
        &self,
        keys: &str,
        handle: impl Fn(Query) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.queryable(keys, handle))
    }

    /// Asks, and waits for the one answer: `None` if nobody answers within [`QUERY_TIMEOUT`].
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn get(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
    ) -> Result<Option<Reply>, BusError> {
        self.get_within(key, parameters, body, QUERY_TIMEOUT)
    }

    /// The same with another limit, for answers that take their time.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn get_within(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<Option<Reply>, BusError> {
        on!(Session, &self.session, session => session.get_within(key, parameters, body, timeout))
    }

    /// Gets all replies of all queryables: returns when the last of them has let go of the query, at the latest after
    /// `timeout`.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn get_all(
        &self,
        key: &str,
        parameters: &str,
        timeout: Duration,
    ) -> Result<Vec<Reply>, BusError> {
        on!(Session, &self.session, session => session.get_all(key, parameters, timeout))
    }

    /// Asks, and hands the one answer to `then`, or `None` if nobody answers within [`QUERY_TIMEOUT`]. `then` runs on
    /// the thread that reads the link: it must hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn get_then(
        &self,
        key: &str,
        parameters: &str,
        then: impl FnOnce(Option<Reply>) + Send + 'static,
    ) -> Result<(), BusError> {
        on!(Session, &self.session, session => session.get_then(key, parameters, then))
    }

    /// Shows that something is there, until dropped or until this process or its link is gone. To be declared last:
    /// who sees it knows that everything declared before is in effect.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn token(&self, key: &str) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.token(key))
    }

    /// Calls `handle(key, is_there)` for each token under `keys` that is there, comes or goes.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn liveliness(
        &self,
        keys: &str,
        handle: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.liveliness(keys, handle))
    }

    /// Closes the session after everything that was put has left. A process that exits without it loses messages.
    pub fn close(&self) {
        on!(Session, &self.session, session => session.close());
    }
}

type Then = Box<dyn FnOnce(Option<Reply>) + Send>;

/// A continuation that is called exactly once: with the answer, or with `None` when the query ends without one.
struct Pending(Option<Then>);

impl Pending {
    fn new(then: impl FnOnce(Option<Reply>) + Send + 'static) -> Self {
        Self(Some(Box::new(then)))
    }

    fn settle(&mut self, answer: Option<Reply>) {
        if let Some(then) = self.0.take() {
            then(answer);
        }
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        self.settle(None);
    }
}

/// A place to put messages of one kind.
#[derive(Debug)]
pub struct Publisher {
    inner: Putter,
}

#[derive(Debug)]
enum Putter {
    Middleware(middleware::Publisher),
    Memory(memory::Publisher),
}

impl Publisher {
    /// Puts a message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed.
    pub fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        on!(Putter, &self.inner, publisher => publisher.put(message))
    }

    /// Whether anybody subscribes: pictures that nobody looks at need not be painted.
    #[must_use]
    pub fn has_subscribers(&self) -> bool {
        on!(Putter, &self.inner, publisher => publisher.has_subscribers())
    }
}

/// An answer: bytes, or the reason why there are none.
#[derive(Debug, Clone)]
pub struct Reply {
    /// Key on which it came.
    pub key: String,
    /// The message, or the responder's refusal in words.
    pub result: Result<Vec<u8>, String>,
}

/// A query that waits for an answer. One that is dropped unanswered ends at once at the asker.
#[derive(Debug)]
pub struct Query {
    inner: AnyQuery,
}

#[derive(Debug)]
enum AnyQuery {
    Middleware(middleware::Query),
    Memory(memory::Query),
}

impl Query {
    /// Key that was asked.
    #[must_use]
    pub fn key(&self) -> &str {
        on!(AnyQuery, &self.inner, query => query.key())
    }

    /// The parameter called `name`, as in `?tick=12;epoch=1`.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        on!(AnyQuery, &self.inner, query => query.parameter(name))
    }

    /// What came with it.
    #[must_use]
    pub fn body(&self) -> Vec<u8> {
        on!(AnyQuery, &self.inner, query => query.body())
    }

    /// Answers on `key`.
    pub fn reply(&self, key: &str, message: Vec<u8>) {
        on!(AnyQuery, &self.inner, query => query.reply(key, message));
    }

    /// Refuses, in words.
    pub fn reply_err(&self, reason: &str) {
        on!(AnyQuery, &self.inner, query => query.reply_err(reason));
    }
}
