//! Sessions, publishers and queries, and the configuration of the middleware: the only file of the project that names it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use protocol::RunName;
use zenoh::bytes::ZBytes;
use zenoh::handlers::FifoChannelHandler;
use zenoh::key_expr::KeyExpr;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh::{Config, Wait};

use crate::declared::Declared;
use crate::endpoint::{self, bound_handshakes, is_local, is_tls, texts, with_setting};
use crate::error::BusError;
use crate::protection::check_key_file;
use crate::qos::Qos;
use crate::reason::reason;
use crate::reply::{Pending, QUERY_TIMEOUT, Reply};
use crate::role::Role;
use crate::runtime::{block, check_threads};
use crate::settings::{CLIENT_MODE, MiddlewareSetting, PATIENT_SETTINGS, ROUTER_MODE, SETTINGS};

/// What else may be the matter with an encrypted endpoint.
const TLS_HINT: &str = " (are both certificates of the same `cars secure init`, valid, and the simulator's for this host?)";

/// A session. Clones share it; the last one closes it.
#[derive(Debug, Clone)]
pub struct Bus {
    session: zenoh::Session,
}

/// A message of more bytes may fill the queue of its link, which holds two batches of 64 KiB.
const LARGE: usize = 16 * 1024;

/// Sends a message. To send a large one may block until the link has taken most of it, and on the middleware's thread that is
/// to wait for oneself, unless another one empties the queue.
fn send<T>(message: Vec<u8>, send: impl FnOnce(Vec<u8>) -> T) -> T {
    if message.len() > LARGE {
        block(|| send(message))
    } else {
        send(message)
    }
}

fn used<T>(doing: &'static str, key: &str, result: zenoh::Result<T>) -> Result<T, BusError> {
    result.map_err(|error| BusError::Use {
        doing,
        key: key.to_owned(),
        reason: reason(&error),
    })
}

impl Bus {
    /// Opens a session. `overrides` is a configuration file of the middleware that replaces the built-in settings,
    /// for set-ups across machines; `configs/zenoh/` has files with the built-in settings. The role determines the mode
    /// and where to listen or connect in either case.
    ///
    /// # Errors
    /// [`BusError::Open`] names the address that was tried and what went wrong; other errors were found before it was tried.
    pub fn open(role: &Role, overrides: Option<&PathBuf>) -> Result<Self, BusError> {
        Self::open_with(role, overrides, &[])
    }

    /// Opens a session with the built-in settings between processes of one machine, none of whose links is ever cut: however
    /// loaded the machine is, none breaks because a process is slow.
    ///
    /// # Errors
    /// The same as those of [`Self::open`].
    pub fn open_patient(role: &Role) -> Result<Self, BusError> {
        Self::open_with(role, None, &PATIENT_SETTINGS)
    }

    fn open_with(
        role: &Role,
        overrides: Option<&PathBuf>,
        further: &[MiddlewareSetting],
    ) -> Result<Self, BusError> {
        for endpoint in role.endpoints() {
            endpoint::check(endpoint).map_err(BusError::BadEndpoint)?;
        }
        if let Some(file) = overrides {
            check_key_files(file)?;
        }
        let (doing, endpoint) = match role {
            Role::Router {
                listen,
                trusts_network,
            } => {
                check_exposure(listen, overrides, *trusts_network)?;
                ("listen at", listen.clone())
            }
            Role::Client { connect, .. } => {
                if is_tls(connect) && overrides.is_none() {
                    return Err(BusError::NoCertificate(connect.clone()));
                }
                ("reach the simulator at", connect.clone())
            }
            Role::Relay {
                listen,
                trusts_network,
                ..
            } => {
                let failed = |reason| BusError::Open {
                    doing: "listen at",
                    endpoint: listen.join(", "),
                    reason,
                };
                for endpoint in relay_listens(listen, overrides).map_err(failed)? {
                    check_exposure(&endpoint, overrides, *trusts_network)?;
                }
                ("listen at", listen.join(", "))
            }
        };

        let failed = |reason: String| BusError::Open {
            doing,
            endpoint: endpoint.clone(),
            reason,
        };
        // What can be refused is refused before there is a session. Threads are checked, too, because the
        // middleware panics where it cannot start one.
        let config = configuration(role, overrides, further).map_err(&failed)?;
        check_threads().map_err(BusError::NoThreads)?;
        // The middleware tries again without a word when certificates do not fit.
        let hint = if is_tls(&endpoint) { TLS_HINT } else { "" };
        let session = zenoh::open(config)
            .wait()
            .map_err(|error| failed(reason(&error) + hint))?;

        Ok(Self { session })
    }

    /// The id of the session, unique among all.
    #[must_use]
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Declares a publisher on `key`. Its messages are never dropped.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn publisher(&self, key: &str) -> Result<Publisher, BusError> {
        // The middleware's default would drop under pressure, and a lock-step system cannot afford a lost message.
        self.declare_publisher(key, CongestionControl::Block)
    }

    /// The same of a publisher that knows whether it has subscribers. Each one costs: the middleware starts a task for each of a
    /// session's watched publishers that a declared subscriber matches. So there may be a few for each robot of a process, and not
    /// one for each pair of robots.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn watched_publisher(&self, key: &str) -> Result<WatchedPublisher, BusError> {
        WatchedPublisher::new(self.publisher(key)?)
    }

    /// Declares a publisher of what only observers subscribe to. Its messages are dropped where an observer does not keep
    /// up: an observer must not hold the clock.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn observer_publisher(&self, key: &str) -> Result<WatchedPublisher, BusError> {
        WatchedPublisher::new(self.declare_publisher(key, CongestionControl::Drop)?)
    }

    fn declare_publisher(
        &self,
        key: &str,
        congestion: CongestionControl,
    ) -> Result<Publisher, BusError> {
        let declared = self
            .session
            .declare_publisher(key.to_owned())
            .congestion_control(congestion)
            .wait();
        let inner = used("publish on", key, declared)?;

        Ok(Publisher { inner })
    }

    /// Puts one message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn put(&self, key: &str, message: Vec<u8>) -> Result<(), BusError> {
        let put = send(message, |message| {
            self.session
                .put(key, message)
                .congestion_control(CongestionControl::Block)
                .wait()
        });
        used("put on", key, put)
    }

    /// Deletes a key: its subscribers get a sample without a payload.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn delete(&self, key: &str) -> Result<(), BusError> {
        let deleted = self
            .session
            .delete(key)
            .congestion_control(CongestionControl::Block)
            .wait();
        used("delete", key, deleted)
    }

    /// Puts one message with another quality of service than [`Qos::IN_ORDER`].
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn put_with_qos(&self, key: &str, message: Vec<u8>, qos: Qos) -> Result<(), BusError> {
        let congestion_control = if qos.is_blocking {
            CongestionControl::Block
        } else {
            CongestionControl::Drop
        };
        let priority = if qos.has_default_priority {
            Priority::default()
        } else {
            Priority::Background
        };

        let put = self
            .session
            .put(key, message)
            .congestion_control(congestion_control)
            .express(qos.is_express)
            .priority(priority)
            .wait();
        used("put on", key, put)
    }

    /// Declares a subscriber: calls `handle(key, bytes)` for each message put on `keys`, on the thread that reads the link.
    /// `handle` must not block.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn subscribe(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8]) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        self.subscribe_with_qos(keys, move |key, bytes, _| handle(key, bytes))
    }

    /// Like [`Self::subscribe`], without what this session puts itself.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn subscribe_to_others(
        &self,
        keys: &str,
        handle: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .declare_subscriber(keys)
            .allowed_origin(Locality::Remote)
            .callback(move |sample: Sample| handle(sample.key_expr().as_str()))
            .wait();

        let declared = used("subscribe to", keys, declared)?;
        Ok(Declared::new(declared))
    }

    /// Whether another session subscribes to a key.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn is_subscribed_by_others(&self, key: &str) -> Result<bool, BusError> {
        let declared = self
            .session
            .declare_publisher(key.to_owned())
            .allowed_destination(Locality::Remote)
            .wait();
        let publisher = used("look for subscribers of", key, declared)?;
        let status = publisher.matching_status().wait();

        Ok(used("look for subscribers of", key, status)?.matching())
    }

    /// Like [`Self::subscribe`], with the quality of service of each message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn subscribe_with_qos(
        &self,
        keys: &str,
        handle: impl Fn(&str, &[u8], Qos) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .declare_subscriber(keys)
            .callback(move |sample: Sample| {
                let qos = Qos {
                    is_blocking: sample.congestion_control() == CongestionControl::Block,
                    is_express: sample.express(),
                    has_default_priority: sample.priority() == Priority::default(),
                };
                handle(
                    sample.key_expr().as_str(),
                    &sample.payload().to_bytes(),
                    qos,
                );
            })
            .wait();

        let declared = used("subscribe to", keys, declared)?;
        Ok(Declared::new(declared))
    }

    /// Declares a queryable: calls `handle` for each query on `keys`, on the thread that reads the link. `handle` must not
    /// block. A queryable of a single key has that key also for a query with wildcards ([`Query::key`]).
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn queryable(
        &self,
        keys: &str,
        handle: impl Fn(Query) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let own: Option<Arc<str>> = (!keys.contains('*')).then(|| keys.into());
        let declared = self
            .session
            .declare_queryable(keys)
            .callback(move |query: zenoh::query::Query| {
                let own = own.clone();
                handle(Query { query, own });
            })
            .wait();
        let declared = used("serve", keys, declared)?;
        Ok(Declared::new(declared))
    }

    /// Sends a query and waits for the one reply: `None` if none arrives within [`QUERY_TIMEOUT`].
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

    /// Like [`Self::get`], with another timeout.
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
        let replies = self.replies(key, parameters, body, timeout)?;
        while let Ok(reply) = replies.recv() {
            if let Some(answer) = Reply::read(reply) {
                return Ok(Some(answer));
            }
        }

        Ok(None)
    }

    /// Sends a query and returns the replies of all queryables, when the last of them has dropped the query, or after
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
        let replies = self.replies(key, parameters, None, timeout)?;
        let mut all = Vec::new();
        while let Ok(reply) = replies.recv() {
            all.extend(Reply::read(reply));
        }

        Ok(all)
    }

    /// Sends a query to all queryables, and receives their replies.
    fn replies(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<FifoChannelHandler<zenoh::query::Reply>, BusError> {
        let replies = self
            .query(key, parameters, body, timeout)?
            .with(zenoh::handlers::FifoChannel::new(64))
            .wait();
        used("ask", key, replies)
    }

    /// Sends a query and calls `then` with the one reply, or with `None` if none arrives within [`QUERY_TIMEOUT`]. `then`
    /// runs on the thread that reads the link and must not block.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn get_then(
        &self,
        key: &str,
        parameters: &str,
        then: impl FnOnce(Option<Reply>) + Send + 'static,
    ) -> Result<(), BusError> {
        let pending = std::sync::Mutex::new(Pending::new(then));
        let asked = self
            .query(key, parameters, None, QUERY_TIMEOUT)?
            .callback(move |reply: zenoh::query::Reply| {
                // The first reply settles it. Where none comes, the callback is dropped, and with it
                // `pending`, which then settles without one.
                if let (Some(answer), Ok(mut pending)) = (Reply::read(reply), pending.lock()) {
                    pending.settle(Some(answer));
                }
            })
            .wait();

        used("ask", key, asked)
    }

    /// A query to all queryables, without what happens to the replies.
    fn query(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<
        zenoh::session::SessionGetBuilder<'_, 'static, zenoh::handlers::DefaultHandler>,
        BusError,
    > {
        let key_expr = used("ask", key, KeyExpr::new(key.to_owned()))?;

        Ok(self
            .session
            .get(zenoh::query::Selector::owned(
                key_expr,
                parameters.to_owned(),
            ))
            .payload(body.map_or_else(ZBytes::new, ZBytes::from))
            // The middleware must neither choose a queryable nor hold replies back until it has all.
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Block)
            .timeout(timeout))
    }

    /// Declares a liveliness token, until it is dropped or this process or its link ends. Declare it last: when other
    /// sessions see it, everything declared before is in effect.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn token(&self, key: &str) -> Result<Declared, BusError> {
        let declared = self
            .session
            .liveliness()
            .declare_token(key.to_owned())
            .wait();
        let declared = used("declare", key, declared)?;
        Ok(Declared::new(declared))
    }

    /// Declares a liveliness subscriber: calls `handle(key, is_declared)` for each token on `keys` that exists, is declared
    /// or is undeclared.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn liveliness(
        &self,
        keys: &str,
        handle: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .liveliness()
            .declare_subscriber(keys)
            // Tokens that were declared before this subscriber are reported, too: nothing depends on
            // which side starts first.
            .history(true)
            .callback(move |sample: Sample| {
                handle(sample.key_expr().as_str(), sample.kind() == SampleKind::Put);
            })
            .wait();

        let declared = used("watch", keys, declared)?;
        Ok(Declared::new(declared))
    }

    /// Closes the session after everything that was put has been sent. A process that exits without it loses messages.
    pub fn close(&self) {
        if let Err(error) = self.session.close().wait() {
            tracing::debug!(%error, "closing the session");
        }
    }
}

/// A declared publisher of one key.
#[derive(Debug)]
pub struct Publisher {
    inner: zenoh::pubsub::Publisher<'static>,
}

impl Publisher {
    /// Puts a message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed.
    pub fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        let put = send(message, |message| self.inner.put(message).wait());
        used("put on", self.inner.key_expr().as_str(), put)
    }
}

/// A declared publisher of one key that knows whether it has subscribers.
#[derive(Debug)]
pub struct WatchedPublisher {
    publisher: Publisher,
    watched: Arc<AtomicBool>,
}

impl WatchedPublisher {
    fn new(publisher: Publisher) -> Result<Self, BusError> {
        let inner = &publisher.inner;
        let key = inner.key_expr().as_str();

        // The listener first, then the status: a subscriber that comes in between is seen by one of
        // them. It is a hint, so the order of memory does not matter.
        let watched = Arc::new(AtomicBool::new(false));
        let seen = watched.clone();
        let listener = inner
            .matching_listener()
            .callback(move |status| seen.store(status.matching(), Ordering::Relaxed))
            .background()
            .wait();
        used("watch subscribers of", key, listener)?;
        let matching =
            used("watch subscribers of", key, inner.matching_status().wait())?.matching();
        watched.fetch_or(matching, Ordering::Relaxed);

        Ok(Self { publisher, watched })
    }

    /// Puts a message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed.
    pub fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        self.publisher.put(message)
    }

    /// Whether there are subscribers.
    #[must_use]
    pub fn has_subscribers(&self) -> bool {
        self.watched.load(Ordering::Relaxed)
    }
}

impl Reply {
    /// `None` for the middleware's own notice that time is up.
    fn read(reply: zenoh::query::Reply) -> Option<Self> {
        match reply.into_result() {
            Ok(sample) => Some(Self {
                key: sample.key_expr().to_string(),
                result: Ok(sample.payload().to_bytes().into_owned()),
            }),
            Err(error) => {
                let text = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned();
                (text != "Timeout").then_some(Self {
                    key: String::new(),
                    result: Err(text),
                })
            }
        }
    }
}

/// A query that waits for a reply. One that is dropped without a reply ends at once at the session that sent it.
#[derive(Debug)]
pub struct Query {
    query: zenoh::query::Query,
    /// The key of the queryable, if it is a single one.
    own: Option<Arc<str>>,
}

impl Query {
    /// The key that is asked for here: that of the queryable, or of the query if the queryable has several. A get with
    /// wildcards reaches several queryables. Their replies are told apart by their keys, and the middleware's default
    /// consolidation keeps one reply of each key.
    #[must_use]
    pub fn key(&self) -> &str {
        match &self.own {
            Some(own) => own,
            None => self.query.key_expr().as_str(),
        }
    }

    /// The parameter called `name`, as in `?tick=12;epoch=1`.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.parameters().get(name)
    }

    /// The payload; empty if there is none.
    #[must_use]
    pub fn body(&self) -> Vec<u8> {
        self.query
            .payload()
            .map(|payload| payload.to_bytes().into_owned())
            .unwrap_or_default()
    }

    /// Replies on `key`.
    pub fn reply(&self, key: &str, message: Vec<u8>) {
        let replied = send(message, |message| {
            self.query.reply(key.to_owned(), message).wait()
        });
        if let Err(error) = replied {
            tracing::debug!(%error, key, "an answer could not be sent");
        }
    }

    /// Replies with an error, in words.
    pub fn reply_err(&self, reason: &str) {
        if let Err(error) = self.query.reply_err(reason.to_owned()).wait() {
            tracing::debug!(%error, "a refusal could not be sent");
        }
    }
}

/// Setting of an encrypted listener: who connects must have shown a certificate within this time, milliseconds.
const HANDSHAKE_TIMEOUT: &str = "tls_handshake_timeout_ms=2000";

/// The built-in settings, or those of a file, and what the role says, which is never the file's affair.
fn configuration(
    role: &Role,
    overrides: Option<&PathBuf>,
    further: &[MiddlewareSetting],
) -> Result<Config, String> {
    let mut config = match overrides {
        Some(file) => from_file(file)?,
        None => Config::default(),
    };
    let mut set = |key: &str, value: &str| {
        config
            .insert_json5(key, value)
            .map_err(|error| format!("setting {key} = {value}: {}", reason(&error)))
    };
    // A file replaces the settings below, but never mode and endpoints: which role a process has is
    // said on its command line.
    let mode = match role {
        Role::Router { listen, .. } => {
            set("listen/endpoints", &format!("[{:?}]", listener(listen)))?;
            ROUTER_MODE
        }
        Role::Client { connect, patience } => {
            set("connect/endpoints", &format!("[{connect:?}]"))?;
            set("connect/timeout_ms", &patience.as_millis().to_string())?;
            CLIENT_MODE
        }
        Role::Relay {
            listen, connect, ..
        } => {
            let listen: Vec<String> = listen.iter().map(|endpoint| listener(endpoint)).collect();
            for (key, endpoints) in [
                ("listen/endpoints", &listen),
                ("connect/endpoints", connect),
            ] {
                if !endpoints.is_empty() {
                    set(key, &format!("{endpoints:?}"))?;
                }
            }
            ROUTER_MODE
        }
    };
    let common = SETTINGS.iter().filter(|_| overrides.is_none());
    let all = [&mode].into_iter().chain(common).chain(further);
    for MiddlewareSetting { key, value, .. } in all {
        set(key, value)?;
    }

    // After the file, so that it holds for timeouts of the file as well.
    let handshakes = [
        ("connect/endpoints", "transport/unicast/open_timeout"),
        ("listen/endpoints", "transport/unicast/accept_timeout"),
    ];
    for (endpoints, timeout) in handshakes {
        leave_timeout_to_links(&mut config, endpoints, timeout)?;
    }

    Ok(config)
}

/// How much longer the middleware waits than its links, milliseconds.
const BACKSTOP_MS: u64 = 30_000;

/// Makes the links bound their handshakes by one of the middleware's timeouts, and the middleware itself wait for longer. When
/// its own timeout is over it drops an attempt in whatever state it is: one that has just succeeded leaves a session that
/// sends and never reads, and the other side refuses all others of this process as long as that one is connected.
fn leave_timeout_to_links(
    config: &mut Config,
    endpoints: &str,
    timeout: &str,
) -> Result<(), String> {
    let limit_ms = read(config, timeout)?;
    let limit_ms = limit_ms
        .as_u64()
        .ok_or_else(|| format!("{timeout} is no number: {limit_ms}"))?;
    let mut listed = read(config, endpoints)?;

    if bound_handshakes(&mut listed, limit_ms) {
        let waits_ms = limit_ms.saturating_add(BACKSTOP_MS);
        for (key, value) in [
            (endpoints, listed.to_string()),
            (timeout, waits_ms.to_string()),
        ] {
            config
                .insert_json5(key, &value)
                .map_err(|error| format!("setting {key} = {value}: {}", reason(&error)))?;
        }
    }

    Ok(())
}

/// A setting, as JSON.
fn read(config: &Config, key: &str) -> Result<serde_json::Value, String> {
    let text = config.get_json(key).map_err(|error| error.to_string())?;

    serde_json::from_str(&text).map_err(|error| format!("{key}: {error}"))
}

fn from_file(file: &Path) -> Result<Config, String> {
    Config::from_file(file).map_err(|error| format!("{}: {}", file.display(), reason(&error)))
}

/// Settings with private keys: the keys themselves, or the names of files.
const KEYS: [(&str, &str); 2] = [
    (
        "transport/link/tls/connect_private_key_base64",
        "transport/link/tls/connect_private_key",
    ),
    (
        "transport/link/tls/listen_private_key_base64",
        "transport/link/tls/listen_private_key",
    ),
];

/// Checks who may read and change the private keys of a configuration file. One that cannot be read is reported where it is used.
fn check_key_files(file: &Path) -> Result<(), BusError> {
    let Ok(config) = from_file(file) else {
        return Ok(());
    };
    let text = |key: &str| match read(&config, key) {
        Ok(serde_json::Value::String(text)) => Some(text),
        _ => None,
    };

    if KEYS.iter().any(|(key, _)| text(key).is_some()) {
        check_key_file(file)?;
    }
    for (_, named) in KEYS {
        if let Some(key_file) = text(named) {
            check_key_file(Path::new(&key_file))?;
        }
    }
    Ok(())
}

/// An endpoint to listen at, with what an encrypted one needs in addition.
fn listener(endpoint: &str) -> String {
    if is_tls(endpoint) {
        with_setting(endpoint, HANDSHAKE_TIMEOUT)
    } else {
        endpoint.to_owned()
    }
}

/// Where a relay listens: what the command line says, or else its configuration file.
fn relay_listens(listen: &[String], overrides: Option<&PathBuf>) -> Result<Vec<String>, String> {
    let Some(file) = overrides.filter(|_| listen.is_empty()) else {
        return Ok(listen.to_vec());
    };
    let mut said = read(&from_file(file)?, "listen/endpoints")?;
    let mut endpoints = Vec::new();
    texts(&mut said, &mut endpoints);
    Ok(endpoints.into_iter().map(std::mem::take).collect())
}

/// Refuses to listen where strangers could connect, unless they need certificates, or `trusts_network`.
///
/// # Errors
/// [`BusError::BadEndpoint`] if it cannot be listened at. [`BusError::Exposed`] says what it would mean, and what to do. [`BusError::Unencrypted`] if the configuration has
/// access control and the endpoint no certificates: it would refuse every client.
pub fn check_exposure(
    listen: &str,
    overrides: Option<&PathBuf>,
    trusts_network: bool,
) -> Result<(), BusError> {
    endpoint::check(listen).map_err(BusError::BadEndpoint)?;
    let guards = match overrides {
        Some(file) => guards(file).map_err(|reason| BusError::Open {
            doing: "listen at",
            endpoint: listen.to_owned(),
            reason,
        })?,
        None => Guards::default(),
    };

    if guards.has_access_control && !is_tls(listen) {
        return Err(BusError::Unencrypted(listen.to_owned()));
    }

    let is_guarded = guards.has_access_control && guards.wants_certificates;
    if is_local(listen) || is_guarded || trusts_network {
        return Ok(());
    }

    Err(BusError::Exposed(listen.to_owned()))
}

/// Checks that the access control of a configuration file, if there is one, admits a run.
///
/// # Errors
/// [`BusError::OtherRun`] if it admits other runs only: no robot could join.
pub fn check_run(file: &Path, run: &RunName) -> Result<(), BusError> {
    let Ok(config) = from_file(file) else {
        return Ok(()); // Reported where it is used.
    };
    let Ok(serde_json::Value::Array(rules)) = read(&config, "access_control/rules") else {
        return Ok(());
    };

    let mut admitted = BTreeSet::new();
    for rule in rules {
        let keys = rule.get("key_exprs").and_then(serde_json::Value::as_array);
        for key in keys.into_iter().flatten().filter_map(|key| key.as_str()) {
            match key
                .strip_prefix("cars/")
                .and_then(|rest| rest.split('/').next())
            {
                Some(name) if name != "*" && name != "**" => admitted.insert(name.to_owned()),
                // A key of any run, or one that is not understood: there is nothing to refuse for
                // certain.
                _ => return Ok(()),
            };
        }
    }
    if admitted.is_empty() || admitted.contains(run.as_str()) {
        return Ok(());
    }
    Err(BusError::OtherRun {
        file: file.display().to_string(),
        run: run.to_string(),
        admitted: admitted.into_iter().collect::<Vec<_>>().join(", "),
    })
}

/// What a configuration file asks of those who connect.
#[derive(Default)]
struct Guards {
    wants_certificates: bool,
    has_access_control: bool,
}

fn guards(file: &Path) -> Result<Guards, String> {
    let config = from_file(file)?;
    // A setting that is not there guards nothing.
    let is = |key: &str, value: &str| config.get_json(key).is_ok_and(|found| found == value);
    Ok(Guards {
        wants_certificates: is("transport/link/tls/enable_mtls", "true"),
        has_access_control: is("access_control/enabled", "true")
            && is("access_control/default_permission", "\"deny\""),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DEFAULT_ENDPOINT;
    use crate::secure::{Credentials, client_config, simulator_config};
    use protocol::{RobotName, keys::Keys};

    fn credentials() -> Credentials<'static> {
        Credentials {
            ca: "a CA",
            certificate: "a certificate",
            key: "a key",
            validity: "some time",
        }
    }

    fn robots() -> Vec<RobotName> {
        ["Butler", "r-2_d.2"]
            .map(|name| RobotName::new(name).unwrap())
            .to_vec()
    }

    fn assert_settings(config: &Config, settings: &[MiddlewareSetting]) {
        for MiddlewareSetting { key, value, .. } in settings
            .iter()
            .filter(|setting| !setting.key.ends_with("retry"))
        {
            assert_eq!(config.get_json(key).unwrap(), *value, "{key}");
        }
        assert_eq!(
            config.get_json("transport/link/tls/enable_mtls").unwrap(),
            "true"
        );
    }

    #[test]
    fn generated_configurations_are_complete() {
        let client = client_config("Butler", &credentials());
        let config = Config::from_json5(&client).unwrap();
        assert_settings(&config, &SETTINGS);
        assert_settings(&config, &[CLIENT_MODE]);
        assert!(
            config
                .get_json("connect/retry")
                .unwrap()
                .contains("\"period_init_ms\":100")
        );
        let simulator = simulator_config(&Keys::of_any_run(), &robots(), &credentials());
        let config = Config::from_json5(&simulator).unwrap();
        assert_settings(&config, &SETTINGS);
        assert_settings(&config, &[ROUTER_MODE]);
        assert_eq!(
            config
                .get_json("access_control/default_permission")
                .unwrap(),
            "\"deny\""
        );
        let subjects = config.get_json("access_control/subjects").unwrap();
        for name in ["Butler", "r-2_d.2", "operator", "console"] {
            assert!(
                subjects.contains(&format!("\"cert_common_names\":[\"{name}\"]")),
                "{subjects}"
            );
        }
    }

    #[test]
    fn links_that_can_bound_handshakes_do() {
        for (connect, endpoint, open_timeout) in [
            (
                "tcp/[::1]:7447",
                "tcp/[::1]:7447#handshake_ms=1000",
                "31000",
            ),
            (
                "unixsock-stream/hall.sock",
                "unixsock-stream/hall.sock",
                "1000",
            ),
        ] {
            let role = Role::Client {
                connect: connect.to_owned(),
                patience: QUERY_TIMEOUT,
            };
            let config = configuration(&role, None, &[]).unwrap();
            assert_eq!(
                config.get_json("connect/endpoints").unwrap(),
                format!("[{endpoint:?}]")
            );
            assert_eq!(
                config.get_json("transport/unicast/open_timeout").unwrap(),
                open_timeout
            );
        }
    }

    #[test]
    fn a_listener_for_strangers_needs_certificates_and_access_control_or_a_word() {
        let folder = std::env::temp_dir().join(format!("cars-exposure-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, text: &str| {
            let file = folder.join(name);
            std::fs::write(&file, text).unwrap();
            file
        };
        let guarded = write(
            "guarded.json5",
            &simulator_config(&Keys::of_any_run(), &robots(), &credentials()),
        );
        let encrypted = write(
            "encrypted.json5",
            "{transport: {link: {tls: {enable_mtls: true}}}}",
        );
        let refused = |listen: &str, file: Option<&PathBuf>, trusts: bool| match check_exposure(
            listen, file, trusts,
        ) {
            Ok(()) => "",
            Err(BusError::Exposed(_)) => "exposed",
            Err(BusError::Unencrypted(_)) => "unencrypted",
            Err(error) => panic!("{error}"),
        };
        let all = "tcp/0.0.0.0:7447";
        assert_eq!(refused(DEFAULT_ENDPOINT, None, false), "");
        assert_eq!(refused(all, None, false), "exposed");
        assert_eq!(refused(all, None, true), "");
        assert_eq!(refused("tls/0.0.0.0:7447", None, false), "exposed");
        assert_eq!(
            refused("tls/0.0.0.0:7447", Some(&encrypted), false),
            "exposed"
        );
        assert_eq!(refused("tls/0.0.0.0:7447", Some(&guarded), false), "");
        assert_eq!(refused(all, Some(&guarded), true), "unencrypted");
        assert_eq!(
            refused(DEFAULT_ENDPOINT, Some(&guarded), false),
            "unencrypted"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn certificates_of_another_run_are_refused() {
        let folder = std::env::temp_dir().join(format!("cars-other-run-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("zenoh.json5");
        let run = |name: &str| RunName::new(name).unwrap();

        let one = simulator_config(&Keys::new(&run("one")), &robots(), &credentials());
        std::fs::write(&file, one).unwrap();
        assert!(check_run(&file, &run("one")).is_ok());
        let refused = check_run(&file, &run("two")).unwrap_err().to_string();
        assert!(
            refused.contains("for run one, and this is run two"),
            "{refused}"
        );

        let any = simulator_config(&Keys::of_any_run(), &robots(), &credentials());
        std::fs::write(&file, any).unwrap();
        assert!(check_run(&file, &run("two")).is_ok());
        std::fs::write(&file, client_config("Butler", &credentials())).unwrap();
        assert!(check_run(&file, &run("two")).is_ok());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// `configs/zenoh/` says what is built in, so that who changes one thing there changes nothing else.
    #[test]
    fn the_configuration_files_say_what_is_built_in() {
        let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/zenoh"));
        let here = || "tcp/127.0.0.1:7447".to_owned();
        for (file, role) in [
            (
                "simulator.json5",
                Role::Router {
                    listen: here(),
                    trusts_network: false,
                },
            ),
            (
                "robot.json5",
                Role::Client {
                    connect: here(),
                    patience: QUERY_TIMEOUT,
                },
            ),
            (
                "router.json5",
                Role::Relay {
                    listen: Vec::new(),
                    connect: Vec::new(),
                    trusts_network: false,
                },
            ),
        ] {
            let built_in = configuration(&role, None, &[]).unwrap();
            let from_file = configuration(&role, Some(&folder.join(file)), &[]).unwrap();
            for MiddlewareSetting { key, .. } in SETTINGS.iter().chain(&[ROUTER_MODE]) {
                assert_eq!(
                    from_file.get_json(key).ok(),
                    built_in.get_json(key).ok(),
                    "{key} in {file} and as it is built in"
                );
                assert!(
                    built_in.get_json(key).is_ok_and(|value| value != "null"),
                    "{key} is set"
                );
            }
        }
    }
}
