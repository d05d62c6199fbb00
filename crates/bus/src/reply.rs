//! Answers to queries, and the continuations that wait for them.

use std::time::Duration;

/// Longest wait for an answer before the asker checks again whether the other side is connected.
pub const QUERY_TIMEOUT: Duration = Duration::from_secs(2);

/// An answer: bytes, or the reason why there are none.
#[derive(Debug, Clone)]
pub struct Reply {
    /// Key on which it came.
    pub key: String,
    /// The message, or the responder's refusal in words.
    pub result: Result<Vec<u8>, String>,
}

type Then = Box<dyn FnOnce(Option<Reply>) + Send>;

/// A continuation that is called exactly once: with the answer, or with `None` when the query ends without one.
pub(crate) struct Pending(Option<Then>);

impl Pending {
    pub(crate) fn new(then: impl FnOnce(Option<Reply>) + Send + 'static) -> Self {
        Self(Some(Box::new(then)))
    }

    /// Calls the continuation, unless it has been called.
    pub(crate) fn settle(&mut self, answer: Option<Reply>) {
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
