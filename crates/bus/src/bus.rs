//! Sessions, publishers and queries of either bus.

use std::path::PathBuf;
use std::time::Duration;

use crate::declared::Declared;
use crate::error::BusError;
use crate::memory::{self, MemoryNetwork};
use crate::middleware;
use crate::qos::Qos;
use crate::reply::{QUERY_TIMEOUT, Reply};
use crate::role::Role;

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
    /// for set-ups across machines; `configs/zenoh/` has files with the built-in settings. The role determines the mode
    /// and where to listen or connect in either case.
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
    /// are dropped: an observer must not hold the clock.
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

    /// The same with another quality of service than [`Qos::IN_ORDER`]. A network in memory has no other.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn put_with_qos(&self, key: &str, message: Vec<u8>, qos: Qos) -> Result<(), BusError> {
        match &self.session {
            Session::Middleware(session) => session.put_with_qos(key, message, qos),
            Session::Memory(session) => session.put(key, message),
        }
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

    /// Calls `handle` for each query on `keys`. It must hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn queryable(
        &self,
        keys: &str,
        handle: impl Fn(Query) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        match &self.session {
            Session::Middleware(session) => session.queryable(keys, move |query| {
                handle(Query {
                    inner: AnyQuery::Middleware(query),
                });
            }),
            Session::Memory(session) => session.queryable(keys, move |query| {
                handle(Query {
                    inner: AnyQuery::Memory(query),
                });
            }),
        }
    }

    /// Sends a query and waits for the one answer: `None` if none arrives within [`QUERY_TIMEOUT`].
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

    /// Sends a query and hands the one answer to `then`, or `None` if none arrives within [`QUERY_TIMEOUT`]. `then`
    /// runs on the thread that reads the link: it must hand over and return.
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

    /// Declares a liveliness token, until dropped or until this process or its link ends. To be declared last: when
    /// others see it, everything declared before is in effect.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn token(&self, key: &str) -> Result<Declared, BusError> {
        on!(Session, &self.session, session => session.token(key))
    }

    /// Calls `handle(key, is_there)` for each token under `keys` that exists, is declared or is undeclared.
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

    /// Whether there are subscribers: a picture without a subscriber need not be painted.
    #[must_use]
    pub fn has_subscribers(&self) -> bool {
        on!(Putter, &self.inner, publisher => publisher.has_subscribers())
    }
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

impl MemoryNetwork {
    /// A session whose link never breaks: the simulator's, which is one process with the router.
    #[must_use]
    pub fn router(&self) -> Bus {
        Bus {
            session: Session::Memory(self.session(false)),
        }
    }

    /// A session of any other participant.
    #[must_use]
    pub fn client(&self) -> Bus {
        Bus {
            session: Session::Memory(self.session(true)),
        }
    }

    /// Kills the process behind a session: some of what it sent last is lost, and it sends nothing more.
    pub fn kill(&self, bus: &Bus) {
        if let Session::Memory(session) = &bus.session {
            self.kill_session(session);
        }
    }
}
