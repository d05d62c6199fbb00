//! Answers to requests of control.

use bus::Query;
use protocol::encode;
use protocol::messages::{ControlAnswer, FieldError};

/// Why something is not done.
pub(super) struct Refusal {
    pub(super) explanation: String,
    pub(super) fields: Vec<FieldError>,
}

impl From<String> for Refusal {
    fn from(explanation: String) -> Self {
        Self {
            explanation,
            fields: Vec::new(),
        }
    }
}

impl From<Refusal> for ControlAnswer {
    fn from(
        Refusal {
            explanation,
            fields,
        }: Refusal,
    ) -> Self {
        Self::Refused {
            explanation,
            fields,
        }
    }
}

/// Refuses a request with the reason.
pub(super) fn refuse(query: &Query, explanation: &str) {
    let answer = ControlAnswer::from(Refusal::from(explanation.to_owned()));
    query.reply(query.key(), encode(&answer));
}
