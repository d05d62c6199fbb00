//! Queries at the sessions that answer them.

use std::sync::Arc;

use crate::reply::Reply;

/// Number of a session.
pub(super) type PeerId = u64;

/// The way of answers from a session to the router.
pub(super) trait ReplyLink: std::fmt::Debug + Send + Sync {
    /// Sends an answer of the session `from` to a query.
    fn reply(&self, from: PeerId, query: u64, answer: Reply) -> Result<(), &'static str>;

    /// Notifies the router that the session `from` sends no more answers to a query.
    fn done(&self, from: PeerId, query: u64) -> Result<(), &'static str>;
}

/// The contents of a query.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) key: String,
    pub(super) parameters: String,
    pub(super) body: Vec<u8>,
}

/// A query at a session with a queryable for it.
#[derive(Debug)]
pub(crate) struct Query {
    pub(super) asked: Arc<Asked>,
    pub(super) ending: Arc<Ending>,
}

/// Notifies the router, when the last handler drops it, that a session sends no more answers to a query.
#[derive(Debug)]
pub(super) struct Ending {
    pub(super) link: Arc<dyn ReplyLink>,
    pub(super) peer: PeerId,
    pub(super) query: u64,
}

impl Ending {
    fn reply(&self, answer: Reply) {
        log_unsent(self.link.reply(self.peer, self.query, answer));
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        log_unsent(self.link.done(self.peer, self.query));
    }
}

fn log_unsent(sent: Result<(), &'static str>) {
    if let Err(reason) = sent {
        tracing::debug!(reason, "an answer could not be sent");
    }
}

impl Query {
    pub(crate) fn key(&self) -> &str {
        &self.asked.key
    }

    pub(crate) fn parameter(&self, name: &str) -> Option<&str> {
        let pairs = self
            .asked
            .parameters
            .split(';')
            .filter_map(|pair| pair.split_once('='));
        pairs
            .into_iter()
            .find(|(key, _)| *key == name)
            .map(|(_, value)| value)
    }

    pub(crate) fn body(&self) -> Vec<u8> {
        self.asked.body.clone()
    }

    pub(crate) fn reply(&self, key: &str, message: Vec<u8>) {
        let answer = Reply {
            key: key.to_owned(),
            result: Ok(message),
        };
        self.ending.reply(answer);
    }

    pub(crate) fn reply_err(&self, reason: &str) {
        let answer = Reply {
            key: String::new(),
            result: Err(reason.to_owned()),
        };
        self.ending.reply(answer);
    }
}
