//! What passes the router.

/// What an observer at the router sees, in the order of arrival there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Overheard {
    /// A message was put.
    Put {
        /// Where.
        key: String,
        /// The message.
        message: Vec<u8>,
    },
    /// A query was asked.
    Asked {
        /// Its number.
        query: u64,
        /// The key that was asked.
        key: String,
        /// As in `tick=12;epoch=1`.
        parameters: String,
        /// What came with it.
        body: Vec<u8>,
    },
    /// It was answered.
    Answered {
        /// Its number.
        query: u64,
        /// The message, or the refusal in words.
        result: Result<Vec<u8>, String>,
    },
    /// A token was shown.
    Token {
        /// Where.
        key: String,
    },
}
