//! The bus: the middleware behind seven verbs, with the settings that a lock-step system needs.
//!
//! A simulator embeds the router and everything else is a client of it: one path between any two, which is what keeps
//! messages in order. No multicast, no gossip, loopback unless an address says otherwise.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use zenoh::bytes::ZBytes;
use zenoh::handlers::FifoChannelHandler;
use zenoh::key_expr::KeyExpr;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Config, Session, Wait};

use crate::endpoint::{is_local, is_tls};

/// Where a simulator listens and others connect unless told otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Longest wait for an answer before the asker looks again whether the other side is still there.
pub const QUERY_TIMEOUT: Duration = Duration::from_secs(2);

/// What else may be the matter with an encrypted endpoint.
const TLS_HINT: &str =
    " (are both certificates of the same `cars secure init`, valid, and the simulator's for this host?)";

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
    #[error("{0} is not encrypted, so nobody could show a certificate there: a secured run listens at tls/…")]
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
}

/// A session. Clones share it; the last one closes it.
#[derive(Debug, Clone)]
pub struct Bus {
    session: Session,
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

fn used<T>(doing: &'static str, key: &str, result: zenoh::Result<T>) -> Result<T, BusError> {
    result.map_err(|error| BusError::Use { doing, key: key.to_owned(), reason: error.to_string() })
}

impl Bus {
    /// Opens a session. `overrides` is a configuration file of the middleware that replaces the built-in settings,
    /// for set-ups across machines.
    ///
    /// # Errors
    /// [`BusError::Open`] names the address that was tried and what went wrong.
    pub fn open(role: &Role, overrides: Option<&PathBuf>) -> Result<Self, BusError> {
        let (doing, endpoint) = match role {
            Role::Router { listen, trusts_network } => {
                check_exposure(listen, overrides, *trusts_network)?;
                ("listen at", listen)
            }
            Role::Client { connect, .. } => {
                if is_tls(connect) && overrides.is_none() {
                    return Err(BusError::NoCertificate(connect.clone()));
                }
                ("reach the simulator at", connect)
            }
        };
        let failed = |reason: String| BusError::Open { doing, endpoint: endpoint.clone(), reason };
        let config = configuration(role, overrides).map_err(&failed)?;
        // The middleware tries again without a word when certificates do not fit.
        let hint = if is_tls(endpoint) { TLS_HINT } else { "" };
        let session = zenoh::open(config).wait().map_err(|error| failed(format!("{error}{hint}")))?;
        Ok(Self { session })
    }

    /// An identity that no other session has.
    #[must_use]
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Declares that messages will be put on `key`.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn publisher(&self, key: &str) -> Result<Publisher, BusError> {
        // The middleware's default would drop under pressure, and a lock-step system cannot afford a lost message.
        self.declare_publisher(key, CongestionControl::Block)
    }

    /// Declares that pictures and lines for observers will be put on `key`. Where an observer does not keep up, they
    /// are dropped: nobody who watches may hold the clock.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn observer_publisher(&self, key: &str) -> Result<Publisher, BusError> {
        self.declare_publisher(key, CongestionControl::Drop)
    }

    fn declare_publisher(&self, key: &str, congestion: CongestionControl) -> Result<Publisher, BusError> {
        let declared = self.session.declare_publisher(key.to_owned()).congestion_control(congestion).wait();
        let inner = used("publish on", key, declared)?;
        let watched = Arc::new(AtomicBool::new(false));
        let seen = watched.clone();
        let listener = inner
            .matching_listener()
            .callback(move |status| seen.store(status.matching(), Ordering::Relaxed))
            .background()
            .wait();
        used("watch subscribers of", key, listener)?;
        let matching = used("watch subscribers of", key, inner.matching_status().wait())?.matching();
        watched.fetch_or(matching, Ordering::Relaxed);
        Ok(Publisher { inner, watched })
    }

    /// Puts one message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn put(&self, key: &str, message: Vec<u8>) -> Result<(), BusError> {
        let put = self.session.put(key, message).congestion_control(CongestionControl::Block).wait();
        used("put on", key, put)
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
        let declared = self
            .session
            .declare_subscriber(keys)
            .callback(move |sample: Sample| handle(sample.key_expr().as_str(), &sample.payload().to_bytes()))
            .wait();
        Ok(Declared { _inner: Box::new(used("subscribe to", keys, declared)?) })
    }

    /// Calls `handle` for each question asked on `keys`. It must hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn serve(
        &self,
        keys: &str,
        handle: impl Fn(Question) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .declare_queryable(keys)
            .callback(move |query: Query| handle(Question { query }))
            .wait();
        Ok(Declared { _inner: Box::new(used("serve", keys, declared)?) })
    }

    /// Asks, and waits for the one answer: `None` if nobody answers within [`QUERY_TIMEOUT`].
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn ask(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
    ) -> Result<Option<AnswerOf>, BusError> {
        self.ask_within(key, parameters, body, QUERY_TIMEOUT)
    }

    /// The same with another limit, for answers that take their time.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn ask_within(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<Option<AnswerOf>, BusError> {
        let replies: FifoChannelHandler<Reply> = used(
            "ask",
            key,
            self.get(key, parameters, body, timeout)?.with(zenoh::handlers::FifoChannel::new(8)).wait(),
        )?;
        while let Ok(reply) = replies.recv() {
            if let Some(answer) = AnswerOf::read(reply) {
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    /// Asks, and hands the one answer to `then`, or `None` if nobody answers within [`QUERY_TIMEOUT`]. `then` runs on
    /// the thread that reads the link: it must hand over and return.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn ask_then(
        &self,
        key: &str,
        parameters: &str,
        then: impl FnOnce(Option<AnswerOf>) + Send + 'static,
    ) -> Result<(), BusError> {
        let pending = std::sync::Mutex::new(Pending(Some(Box::new(then))));
        let asked = self
            .get(key, parameters, None, QUERY_TIMEOUT)?
            .callback(move |reply: Reply| {
                if let (Some(answer), Ok(mut pending)) = (AnswerOf::read(reply), pending.lock()) {
                    pending.settle(Some(answer));
                }
            })
            .wait();
        used("ask", key, asked)
    }

    fn get(
        &self,
        key: &str,
        parameters: &str,
        body: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<zenoh::session::SessionGetBuilder<'_, 'static, zenoh::handlers::DefaultHandler>, BusError>
    {
        let key_expr = used("ask", key, KeyExpr::new(key.to_owned()))?;
        Ok(self
            .session
            .get(zenoh::query::Selector::owned(key_expr, parameters.to_owned()))
            .payload(body.map_or_else(ZBytes::new, ZBytes::from))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Block)
            .timeout(timeout))
    }

    /// Shows that something is there, until dropped or until this process or its link is gone. To be declared last:
    /// who sees it knows that everything declared before is in effect.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key is not legal.
    pub fn token(&self, key: &str) -> Result<Declared, BusError> {
        let declared = self.session.liveliness().declare_token(key.to_owned()).wait();
        Ok(Declared { _inner: Box::new(used("declare", key, declared)?) })
    }

    /// Calls `handle(key, is_there)` for each token under `keys` that is there, comes or goes.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed or the key expression is not legal.
    pub fn watch(
        &self,
        keys: &str,
        handle: impl Fn(&str, bool) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .liveliness()
            .declare_subscriber(keys)
            .history(true)
            .callback(move |sample: Sample| {
                handle(sample.key_expr().as_str(), sample.kind() == SampleKind::Put);
            })
            .wait();
        Ok(Declared { _inner: Box::new(used("watch", keys, declared)?) })
    }

    /// Closes the session after everything that was put has left. A process that exits without it loses messages.
    pub fn close(&self) {
        if let Err(error) = self.session.close().wait() {
            tracing::debug!(%error, "closing the session");
        }
    }
}

type Then = Box<dyn FnOnce(Option<AnswerOf>) + Send>;

/// A continuation that is called exactly once: with the answer, or with `None` when the query ends without one.
struct Pending(Option<Then>);

impl Pending {
    fn settle(&mut self, answer: Option<AnswerOf>) {
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
    inner: zenoh::pubsub::Publisher<'static>,
    watched: Arc<AtomicBool>,
}

impl Publisher {
    /// Puts a message.
    ///
    /// # Errors
    /// [`BusError::Use`] if the session is closed.
    pub fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        used("put on", self.inner.key_expr().as_str(), self.inner.put(message).wait())
    }

    /// Whether anybody subscribes: pictures that nobody looks at need not be painted.
    #[must_use]
    pub fn is_watched(&self) -> bool {
        self.watched.load(Ordering::Relaxed)
    }
}

/// An answer: bytes, or the reason why there are none.
#[derive(Debug, Clone)]
pub struct AnswerOf {
    /// Key on which it came.
    pub key: String,
    /// The message, or the responder's refusal in words.
    pub result: Result<Vec<u8>, String>,
}

impl AnswerOf {
    /// `None` for the middleware's own notice that time is up.
    fn read(reply: Reply) -> Option<Self> {
        match reply.into_result() {
            Ok(sample) => Some(Self {
                key: sample.key_expr().to_string(),
                result: Ok(sample.payload().to_bytes().into_owned()),
            }),
            Err(error) => {
                let text = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned();
                (text != "Timeout").then_some(Self { key: String::new(), result: Err(text) })
            }
        }
    }
}

/// A question that waits for an answer. One that is dropped unanswered ends at once at the asker.
#[derive(Debug)]
pub struct Question {
    query: Query,
}

impl Question {
    /// Key that was asked.
    #[must_use]
    pub fn key(&self) -> &str {
        self.query.key_expr().as_str()
    }

    /// The parameter called `name`, as in `?tick=12;epoch=1`.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.parameters().get(name)
    }

    /// What came with it.
    #[must_use]
    pub fn body(&self) -> Vec<u8> {
        self.query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default()
    }

    /// Answers on `key`.
    pub fn answer(&self, key: &str, message: Vec<u8>) {
        if let Err(error) = self.query.reply(key.to_owned(), message).wait() {
            tracing::debug!(%error, key, "an answer could not be sent");
        }
    }

    /// Refuses, in words.
    pub fn refuse(&self, reason: &str) {
        if let Err(error) = self.query.reply_err(reason.to_owned()).wait() {
            tracing::debug!(%error, "a refusal could not be sent");
        }
    }
}

/// One of the middleware's settings.
pub(crate) struct Setting {
    /// Its path.
    pub(crate) key: &'static str,
    /// Its value, as JSON5.
    pub(crate) value: &'static str,
    /// Why it is what it is.
    pub(crate) why: &'static str,
}

const fn setting(key: &'static str, value: &'static str, why: &'static str) -> Setting {
    Setting { key, value, why }
}

/// What was measured to suit a lock-step system, for everybody.
pub(crate) const SETTINGS: [Setting; 10] = [
    setting("scouting/delay", "0", "A router waits half a second for scouting that is switched off below."),
    setting("scouting/multicast/enabled", "false", "Nobody is looked for: the endpoint says where to go."),
    setting("scouting/gossip/enabled", "false", "One path between any two keeps messages in order."),
    setting(
        "transport/link/tx/lease",
        "2000",
        "A process that hangs or a link that is cut is noticed within this time, milliseconds.",
    ),
    setting("transport/link/tx/keep_alive", "4", "Signs of life within that time."),
    setting(
        "transport/link/tx/queue/congestion_control/block/wait_before_close",
        "500000",
        "A receiver that does not read holds the sender for at most this long, microseconds.",
    ),
    setting("transport/link/rx/max_message_size", "4194304", "Bytes; nothing here is nearly as long."),
    setting("transport/unicast/accept_pending", "1000", "Hundreds of robots may connect at the same moment."),
    setting("transport/unicast/max_sessions", "2000", "No more sessions than this."),
    setting(
        "transport/unicast/accept_timeout",
        "2000",
        "Who connects and says nothing is in nobody's way for long.",
    ),
];

/// What holds for those who connect, in addition.
pub(crate) const CLIENT_SETTINGS: [Setting; 3] = [
    setting("mode", "\"client\"", "Everything goes by the simulator, which checks it."),
    setting(
        "connect/retry",
        "{ period_init_ms: 100, period_max_ms: 500, period_increase_factor: 2 }",
        "Milliseconds between two attempts to connect.",
    ),
    setting(
        "transport/unicast/open_timeout",
        "1000",
        "A connection attempt into a cut link must not outlive the cut by ten seconds.",
    ),
];

/// What holds for the simulator, in addition.
pub(crate) const ROUTER_SETTINGS: [Setting; 1] =
    [setting("mode", "\"router\"", "Everybody connects here, and nobody to anybody else.")];

/// Setting of an encrypted listener: who connects must have shown a certificate within this time, milliseconds.
const HANDSHAKE_TIMEOUT: &str = "tls_handshake_timeout_ms=2000";

/// The built-in settings, or those of a file, and the endpoint, which is never the file's affair.
fn configuration(role: &Role, overrides: Option<&PathBuf>) -> Result<Config, String> {
    let mut config = match overrides {
        Some(file) => Config::from_file(file).map_err(|error| format!("{}: {error}", file.display()))?,
        None => Config::default(),
    };
    let mut set = |key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|error| format!("setting {key} = {value}: {error}"))
    };
    let own = match role {
        Role::Router { listen, .. } => {
            let separator = if listen.contains('#') { ';' } else { '#' };
            let listen = if is_tls(listen) {
                format!("{listen}{separator}{HANDSHAKE_TIMEOUT}")
            } else {
                listen.clone()
            };
            set("listen/endpoints", &format!("[{listen:?}]"))?;
            &ROUTER_SETTINGS[..]
        }
        Role::Client { connect, patience } => {
            set("connect/endpoints", &format!("[{connect:?}]"))?;
            set("connect/timeout_ms", &patience.as_millis().to_string())?;
            &CLIENT_SETTINGS[..]
        }
    };
    let common = SETTINGS.iter().filter(|_| overrides.is_none());
    for Setting { key, value, .. } in own.iter().chain(common) {
        set(key, value)?;
    }
    Ok(config)
}

/// Refuses to listen where strangers could connect, unless they need certificates, or `trusts_network`.
///
/// # Errors
/// [`BusError::Exposed`] says what it would mean, and what to do. [`BusError::Unencrypted`] if the configuration has
/// access control and the endpoint no certificates: it would refuse everybody.
pub fn check_exposure(
    listen: &str,
    overrides: Option<&PathBuf>,
    trusts_network: bool,
) -> Result<(), BusError> {
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

/// What a configuration file asks of those who connect.
#[derive(Default)]
struct Guards {
    wants_certificates: bool,
    has_access_control: bool,
}

fn guards(file: &Path) -> Result<Guards, String> {
    let config = Config::from_file(file).map_err(|error| format!("{}: {error}", file.display()))?;
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
    use crate::secure::{Credentials, client_config, simulator_config};
    use crate::{RobotName, keys::Keys};

    fn credentials() -> Credentials<'static> {
        Credentials { ca: "a CA", certificate: "a certificate", key: "a key", validity: "some time" }
    }

    fn robots() -> Vec<RobotName> {
        ["Butler", "r-2_d.2"].map(|name| RobotName::new(name).unwrap()).to_vec()
    }

    fn assert_settings(config: &Config, settings: &[Setting]) {
        for Setting { key, value, .. } in settings.iter().filter(|setting| !setting.key.ends_with("retry")) {
            assert_eq!(config.get_json(key).unwrap(), *value, "{key}");
        }
        assert_eq!(config.get_json("transport/link/tls/enable_mtls").unwrap(), "true");
    }

    #[test]
    fn generated_configurations_are_complete() {
        let client = client_config("Butler", &credentials());
        let config = Config::from_json5(&client).unwrap();
        assert_settings(&config, &SETTINGS);
        assert_settings(&config, &CLIENT_SETTINGS);
        assert!(config.get_json("connect/retry").unwrap().contains("\"period_init_ms\":100"));
        let simulator = simulator_config(&Keys::of_any_run(), &robots(), &credentials());
        let config = Config::from_json5(&simulator).unwrap();
        assert_settings(&config, &SETTINGS);
        assert_settings(&config, &ROUTER_SETTINGS);
        assert_eq!(config.get_json("access_control/default_permission").unwrap(), "\"deny\"");
        let subjects = config.get_json("access_control/subjects").unwrap();
        for name in ["Butler", "r-2_d.2", "operator", "console"] {
            assert!(subjects.contains(&format!("\"cert_common_names\":[\"{name}\"]")), "{subjects}");
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
        let guarded =
            write("guarded.json5", &simulator_config(&Keys::of_any_run(), &robots(), &credentials()));
        let encrypted = write("encrypted.json5", "{transport: {link: {tls: {enable_mtls: true}}}}");
        let refused =
            |listen: &str, file: Option<&PathBuf>, trusts: bool| match check_exposure(listen, file, trusts) {
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
        assert_eq!(refused("tls/0.0.0.0:7447", Some(&encrypted), false), "exposed");
        assert_eq!(refused("tls/0.0.0.0:7447", Some(&guarded), false), "");
        assert_eq!(refused(all, Some(&guarded), true), "unencrypted");
        assert_eq!(refused(DEFAULT_ENDPOINT, Some(&guarded), false), "unencrypted");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
