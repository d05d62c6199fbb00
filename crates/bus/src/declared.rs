//! Declarations of a session: publishers, subscribers, queryables, tokens.

/// A declaration, alive until dropped.
pub struct Declared {
    _inner: Box<dyn Send + Sync>,
}

impl Declared {
    /// A declaration that `inner` withdraws when it is dropped.
    pub(crate) fn new(inner: impl Send + Sync + 'static) -> Self {
        Self {
            _inner: Box::new(inner),
        }
    }
}

impl std::fmt::Debug for Declared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Declared")
    }
}
