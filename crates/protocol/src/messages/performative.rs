//! What messages between robots are meant to do.

use serde::{Deserialize, Serialize};

/// What a message between robots is meant to do: the part of KQML that the robots of the paper need (Finin et al. 1994;
/// the paper's robots spoke KQML, Murphy et al. 2002, abstract). A command is an `achieve`, and an answer to a query a
/// `tell`. KQML's `ask-one` is not among them: zenoh's queries have no payload, and the key states what is asked for.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Performative {
    /// The sender wants the receiver to make something true of its environment: every `setRobotCommand`.
    #[default]
    Achieve,
    /// The content is true as far as the sender knows: every answer to a query.
    Tell,
}

impl Performative {
    /// Its name in KQML.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Achieve => "achieve",
            Self::Tell => "tell",
        }
    }
}

impl std::fmt::Display for Performative {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
