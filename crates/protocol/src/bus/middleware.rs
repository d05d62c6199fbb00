//! The middleware: the only file of the project that names it, with the settings that a lock-step system needs.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use zenoh::bytes::ZBytes;
use zenoh::handlers::FifoChannelHandler;
use zenoh::key_expr::KeyExpr;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Config, Wait};

use super::{AnswerOf, BusError, Declared, Pending, QUERY_TIMEOUT, Role};

/// A session of the middleware. Clones share it; the last one closes it.
#[derive(Debug, Clone)]
pub(super) struct Session {
    session: zenoh::Session,
}

fn used<T>(doing: &'static str, key: &str, result: zenoh::Result<T>) -> Result<T, BusError> {
    result.map_err(|error| BusError::Use { doing, key: key.to_owned(), reason: error.to_string() })
}

impl Session {
    pub(super) fn open(role: &Role, overrides: Option<&PathBuf>) -> Result<Self, BusError> {
        let (doing, endpoint) = match role {
            Role::Router { listen } => ("listen at", listen.clone()),
            Role::Client { connect, .. } => ("reach the simulator at", connect.clone()),
            Role::Relay { listen, .. } => ("listen at", listen.join(", ")),
        };
        let failed = |reason: String| BusError::Open { doing, endpoint: endpoint.clone(), reason };
        let config = configuration(role, overrides).map_err(&failed)?;
        let session = zenoh::open(config).wait().map_err(|error| failed(error.to_string()))?;
        Ok(Self { session })
    }

    pub(super) fn id(&self) -> String {
        self.session.zid().to_string()
    }

    pub(super) fn publisher(&self, key: &str) -> Result<Publisher, BusError> {
        // The middleware's default would drop under pressure, and a lock-step system cannot afford a lost message.
        self.declare_publisher(key, CongestionControl::Block)
    }

    pub(super) fn observer_publisher(&self, key: &str) -> Result<Publisher, BusError> {
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

    pub(super) fn put(&self, key: &str, message: Vec<u8>) -> Result<(), BusError> {
        let put = self.session.put(key, message).congestion_control(CongestionControl::Block).wait();
        used("put on", key, put)
    }

    pub(super) fn subscribe(
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

    pub(super) fn serve(
        &self,
        keys: &str,
        handle: impl Fn(super::Question) + Send + Sync + 'static,
    ) -> Result<Declared, BusError> {
        let declared = self
            .session
            .declare_queryable(keys)
            .callback(move |query: Query| {
                handle(super::Question { inner: super::Query::Middleware(Question { query }) });
            })
            .wait();
        Ok(Declared { _inner: Box::new(used("serve", keys, declared)?) })
    }

    pub(super) fn ask_within(
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

    pub(super) fn ask_then(
        &self,
        key: &str,
        parameters: &str,
        then: impl FnOnce(Option<AnswerOf>) + Send + 'static,
    ) -> Result<(), BusError> {
        let pending = std::sync::Mutex::new(Pending::new(then));
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

    pub(super) fn token(&self, key: &str) -> Result<Declared, BusError> {
        let declared = self.session.liveliness().declare_token(key.to_owned()).wait();
        Ok(Declared { _inner: Box::new(used("declare", key, declared)?) })
    }

    pub(super) fn watch(
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

    pub(super) fn close(&self) {
        if let Err(error) = self.session.close().wait() {
            tracing::debug!(%error, "closing the session");
        }
    }
}

#[derive(Debug)]
pub(super) struct Publisher {
    inner: zenoh::pubsub::Publisher<'static>,
    watched: Arc<AtomicBool>,
}

impl Publisher {
    pub(super) fn put(&self, message: Vec<u8>) -> Result<(), BusError> {
        used("put on", self.inner.key_expr().as_str(), self.inner.put(message).wait())
    }

    pub(super) fn is_watched(&self) -> bool {
        self.watched.load(Ordering::Relaxed)
    }
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

#[derive(Debug)]
pub(super) struct Question {
    query: Query,
}

impl Question {
    pub(super) fn key(&self) -> &str {
        self.query.key_expr().as_str()
    }

    pub(super) fn parameter(&self, name: &str) -> Option<&str> {
        self.query.parameters().get(name)
    }

    pub(super) fn body(&self) -> Vec<u8> {
        self.query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default()
    }

    pub(super) fn answer(&self, key: &str, message: Vec<u8>) {
        if let Err(error) = self.query.reply(key.to_owned(), message).wait() {
            tracing::debug!(%error, key, "an answer could not be sent");
        }
    }

    pub(super) fn refuse(&self, reason: &str) {
        if let Err(error) = self.query.reply_err(reason.to_owned()).wait() {
            tracing::debug!(%error, "a refusal could not be sent");
        }
    }
}

/// The settings that were measured to suit a lock-step system, on top of the middleware's defaults.
fn configuration(role: &Role, overrides: Option<&PathBuf>) -> Result<Config, String> {
    let mut config = match overrides {
        Some(file) => Config::from_file(file).map_err(|error| error.to_string())?,
        None => Config::default(),
    };
    let mut set = |key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|error| format!("setting {key} = {value}: {error}"))
    };
    match role {
        Role::Router { listen } => {
            set("mode", "\"router\"")?;
            set("listen/endpoints", &format!("[{listen:?}]"))?;
        }
        Role::Client { connect, patience } => {
            set("mode", "\"client\"")?;
            set("connect/endpoints", &format!("[{connect:?}]"))?;
            set("connect/timeout_ms", &patience.as_millis().to_string())?;
        }
        Role::Relay { listen, connect } => {
            set("mode", "\"router\"")?;
            for (key, endpoints) in [("listen/endpoints", listen), ("connect/endpoints", connect)] {
                if !endpoints.is_empty() {
                    set(key, &format!("{endpoints:?}"))?;
                }
            }
        }
    }
    if overrides.is_some() {
        return Ok(config);
    }
    for (key, value) in SETTINGS {
        set(key, value)?;
    }
    Ok(config)
}

/// What every session is set to, unless a configuration file says otherwise.
const SETTINGS: [(&str, &str); 12] = [
    // A router waits half a second for scouting that is switched off below.
    ("scouting/delay", "0"),
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/enabled", "false"),
    // A process that hangs or a link that is cut is noticed within this time, milliseconds.
    ("transport/link/tx/lease", "2000"),
    ("transport/link/tx/keep_alive", "4"),
    // A receiver that does not read holds the sender for at most this long, microseconds.
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "500000"),
    ("transport/link/rx/max_message_size", "4194304"),
    // Hundreds of robots may connect at the same moment.
    ("transport/unicast/accept_pending", "1000"),
    ("transport/unicast/max_sessions", "2000"),
    ("transport/unicast/accept_timeout", "2000"),
    // An attempt to connect into a cut link must not outlive the cut for long, milliseconds. It takes three round
    // trips to succeed: where one takes more than 0.3 s, a configuration file says more.
    ("transport/unicast/open_timeout", "1000"),
    // So a link that is whole again is found within about a second: the rest of an attempt and the longest wait.
    ("connect/retry", "{period_init_ms: 100, period_max_ms: 200, period_increase_factor: 2}"),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// `configs/zenoh/` says what is built in, so that who changes one thing there changes nothing else.
    #[test]
    fn the_configuration_files_say_what_is_built_in() {
        let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/zenoh"));
        let here = || "tcp/127.0.0.1:7447".to_owned();
        for (file, role) in [
            ("simulator.json5", Role::Router { listen: here() }),
            ("robot.json5", Role::Client { connect: here(), patience: QUERY_TIMEOUT }),
            ("router.json5", Role::Relay { listen: Vec::new(), connect: Vec::new() }),
        ] {
            let built_in = configuration(&role, None).unwrap();
            let from_file = configuration(&role, Some(&folder.join(file))).unwrap();
            for (key, _) in SETTINGS.iter().chain(&[("mode", "")]) {
                assert_eq!(
                    from_file.get_json(key).ok(),
                    built_in.get_json(key).ok(),
                    "{key} in {file} and as it is built in"
                );
                assert!(built_in.get_json(key).is_ok_and(|value| value != "null"), "{key} is set");
            }
        }
    }
}
