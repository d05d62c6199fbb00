//! The messages between server and page: one JSON object in each text message of the WebSocket.

use axum::extract::ws::Utf8Bytes;
use protocol::RobotName;
use protocol::messages::{Control, ControlAnswer, LogRecord, TickPanel, WorldFrame};
use serde::{Deserialize, Serialize};

use crate::failed::Failed;

/// Server to page.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum ServerMessage<'a> {
    /// The first message.
    Hello {
        /// `live` or `recording`.
        mode: &'static str,
        /// Name of the run.
        run: &'a str,
        /// Where the simulator of a run in progress is expected.
        #[serde(skip_serializing_if = "Option::is_none")]
        endpoint: Option<&'a str>,
        /// Version of the console.
        version: &'static str,
        /// Whether the page explains its first steps.
        has_guide: bool,
    },
    /// Sent regularly: a page that receives nothing for a while has lost the connection. Requests carry the time back, so that the
    /// server knows how old they are at most.
    Beat {
        /// Since the connection was opened, milliseconds of the server's clock.
        at_ms: u64,
    },
    /// Whether the simulator is connected.
    Simulator {
        /// Whether its liveliness token is declared.
        present: bool,
    },
    /// The newest frame.
    Frame {
        /// The frame, with the flights of the frames that this browser skipped.
        frame: &'a WorldFrame,
    },
    /// The panel of a robot in the tick of the newest frame.
    Panel {
        /// The robot that published it.
        robot: &'a RobotName,
        /// Its widgets.
        panel: &'a TickPanel,
    },
    /// Lines of the log, in order.
    Log {
        /// The lines.
        lines: &'a [LogRecord],
        /// How many lines before them this browser missed.
        dropped: u64,
    },
    /// The run has failed, and its processes end.
    Failed {
        /// Why, as its launcher says.
        failed: &'a Failed,
    },
    /// The outcome of a request: either `answer` or `error` is present.
    Answer {
        /// The number that the page gave the request; `None` if the request has no readable number.
        id: Option<u64>,
        /// The simulator's answer.
        #[serde(skip_serializing_if = "Option::is_none")]
        answer: Option<ControlAnswer>,
        /// Why the request has no answer.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<String>,
    },
}

impl ServerMessage<'_> {
    /// The outcome of request `id`.
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

    /// The message as JSON text.
    pub(crate) fn text(&self) -> Utf8Bytes {
        // Serialization fails only for maps with keys that are not strings, and there are none in these types.
        let text = serde_json::to_string(self)
            .unwrap_or_else(|error| unreachable!("a message is always JSON: {error}"));
        text.into()
    }
}

/// Page to server.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum PageMessage {
    /// A request to the simulator.
    Control {
        /// Number of the request; the answer carries it, too.
        id: u64,
        /// The request.
        control: Control,
    },
    /// A command of a person to a robot.
    Command {
        /// Number of the request; the answer carries it, too.
        id: u64,
        /// The robot.
        to: RobotName,
        /// The text of the command.
        command: String,
    },
    /// Has a run that has failed go on.
    Resume {
        /// Number of the request; the answer carries it, too.
        id: u64,
    },
}

impl PageMessage {
    /// The number that the page gave the request.
    pub(crate) fn id(&self) -> u64 {
        match self {
            Self::Control { id, .. } | Self::Command { id, .. } | Self::Resume { id } => *id,
        }
    }

    /// Whether the message carries a scenario or a set-up, which may be long.
    pub(crate) fn carries_scenario(&self) -> bool {
        matches!(
            self,
            Self::Control {
                control: Control::Load { .. } | Control::Init { .. },
                ..
            }
        )
    }
}

/// What a request says of itself, also one that is malformed otherwise.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct RequestHead {
    /// Number of the request; `None` if the message has none.
    pub(crate) id: Option<u64>,
    /// The newest `at_ms` that the page had received when it sent the request; `None` from a client that ignores
    /// [`ServerMessage::Beat`].
    pub(crate) heard_ms: Option<u64>,
}
