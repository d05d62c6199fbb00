//! The lines of a transcript; section "Test vectors" of `docs/protocol.md` explains their fields.

/// A query and its reply: bytes, or the text of an error reply.
pub(super) struct Query<'a> {
    pub(super) key: &'a str,
    pub(super) parameters: &'a str,
    pub(super) message: Option<&'a [u8]>,
    pub(super) reply: &'a Result<Vec<u8>, String>,
}

/// What one robot receives and puts, in this order.
pub(super) struct Transcript {
    text: String,
}

/// A message as it is on the wire: JSON within JSON.
fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("messages are UTF-8")
}

fn quoted(text: &str) -> serde_json::Value {
    serde_json::Value::from(text)
}

impl Transcript {
    pub(super) fn new(robot: &str, scenario: &str) -> Self {
        let scenario = quoted(scenario);

        Self {
            text: format!(r#"{{"way":"start","robot":"{robot}","scenario":{scenario}}}"#) + "\n",
        }
    }

    fn add(&mut self, line: &str) {
        self.text += line;
        self.text += "\n";
    }

    /// A message to the robot's subscribers.
    pub(super) fn received(&mut self, key: &str, message: &[u8]) {
        self.add_message("to", key, message);
    }

    /// A message that the robot puts.
    pub(super) fn put(&mut self, key: &str, message: &[u8]) {
        self.add_message("from", key, message);
    }

    fn add_message(&mut self, way: &str, key: &str, message: &[u8]) {
        let message = text(message);
        self.add(&format!(
            r#"{{"way":"{way}","key":"{key}","message":{message}}}"#
        ));
    }

    /// The robot declares its token.
    pub(super) fn token(&mut self, key: &str) {
        self.add(&format!(r#"{{"way":"token","key":"{key}"}}"#));
    }

    /// The robot sends a query.
    pub(super) fn asks(&mut self, query: &Query<'_>) {
        self.add_query("ask", query);
    }

    /// The robot receives a query.
    pub(super) fn asked(&mut self, query: &Query<'_>) {
        self.add_query("asked", query);
    }

    fn add_query(&mut self, way: &str, query: &Query<'_>) {
        let mut line = format!(r#"{{"way":"{way}","key":"{}""#, query.key);
        if !query.parameters.is_empty() {
            line += &format!(r#","parameters":"{}""#, query.parameters);
        }
        if let Some(message) = query.message {
            line += &format!(r#","message":{}"#, text(message));
        }
        line += &match query.reply {
            Ok(answer) => format!(r#","answer":{}}}"#, text(answer)),
            Err(reason) => format!(r#","refused":{}}}"#, quoted(reason)),
        };
        self.add(&line);
    }

    pub(super) fn text(self) -> String {
        self.text
    }
}
