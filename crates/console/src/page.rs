//! What the page is told and what it says: one JSON object for each message of the WebSocket.

use axum::extract::ws::Utf8Bytes;
use protocol::RobotName;
use protocol::messages::{Control, ControlAnswer, LogRecord, Panel, WorldFrame};
use serde::{Deserialize, Serialize};

/// Server to page.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum ToPage<'a> {
    /// The first message.
    Hello {
        /// `live` or `recording`.
        mode: &'static str,
        /// Name of the run.
        run: &'a str,
        /// Version of the console.
        version: &'static str,
    },
    /// Whether the simulator is there.
    Simulator {
        /// Whether it is.
        present: bool,
    },
    /// The field.
    Frame {
        /// The newest there is.
        frame: &'a WorldFrame,
    },
    /// What a robot displays.
    Panel {
        /// Which robot.
        robot: &'a RobotName,
        /// The newest there is.
        panel: &'a Panel,
    },
    /// Lines of the log, in order.
    Log {
        /// The lines.
        lines: &'a [LogRecord],
        /// How many this browser missed before them.
        dropped: u64,
    },
    /// What came of a request.
    Answer {
        /// The page's number for it; none where it could not be read.
        id: Option<u64>,
        /// What the simulator says.
        #[serde(skip_serializing_if = "Option::is_none")]
        answer: Option<ControlAnswer>,
        /// Why there is no answer.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<String>,
    },
}

impl ToPage<'_> {
    /// The answer to request `id`.
    pub(crate) fn answer(id: Option<u64>, outcome: Result<ControlAnswer, String>) -> Self {
        match outcome {
            Ok(answer) => Self::Answer {
                id,
                answer: Some(answer),
                error: None,
            },
            Err(error) => Self::Answer {
                id,
                answer: None,
                error: Some(error),
            },
        }
    }

    /// The message as it is sent.
    pub(crate) fn text(&self) -> Utf8Bytes {
        // Numbers, strings, lists and maps with string keys: there is no value of theirs that JSON cannot write.
        let text = serde_json::to_string(self)
            .unwrap_or_else(|error| unreachable!("a message is always JSON: {error}"));
        text.into()
    }
}

/// Page to server.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum FromPage {
    /// A request to the simulator.
    Control {
        /// The page's number for it; the answer carries it, too.
        id: u64,
        /// The request.
        control: Control,
    },
}

/// What can be made out of a message that cannot be understood.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct Numbered {
    /// The page's number for it.
    pub(crate) id: Option<u64>,
}
