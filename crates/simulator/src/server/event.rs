//! What can happen to a server, and why it stops.

use bus::{BusError, Query};
use protocol::messages::{Command, Control, End, Report, Target, TickPanel, Waiting};
use protocol::{Malformed, RobotName, RunName};
use record::RecordError;
use record::difference::Difference;
use recording::RecordingError;
use scenario::Scenario;

/// Everything that can happen to a server. Robots are those that the keys name.
pub(super) enum ServerEvent {
    /// A robot has done its tick.
    Report(String, Report),
    /// A robot, or the operator, sent a command. `None` is a target that no robot can have as its name.
    Command {
        from: String,
        to: Option<Target>,
        command: Command,
    },
    /// A robot waits for another robot's answer.
    Waiting(String, Waiting),
    /// A robot shows a panel.
    Panel(String, TickPanel),
    /// A message that cannot be decoded.
    Malformed(Malformed),
    /// A robot asks to take part.
    Join(Query),
    /// An operator asks for something.
    Control(Query),
    /// Robots have been asked about the parameters that a request sets; a refusal is the reason of one of them.
    Offered {
        query: Query,
        control: Control,
        refusal: Option<String>,
    },
    /// An observer asks for the state of a robot of a recording.
    State(RobotName, Query),
    /// A robot's liveliness token was declared or undeclared.
    Token { robot: String, is_present: bool },
    /// A console declares, or declares no more, that a browser shows the run.
    Viewer { is_present: bool },
    /// The process is asked to end.
    Terminate,
}

/// Why a server ended before its time, or cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The record cannot be written.
    #[error(transparent)]
    Record(Box<RecordError>),
    /// The environment cannot be set up.
    #[error(transparent)]
    Hall(Box<world::HallError>),
    /// A run that is resumed does not go as its record.
    #[error(
        "the run cannot be resumed: executed again, it differs from its record at {0} (recorded: {recorded}; now: {now}). \
         The record is as it was",
        recorded = .0.value(0),
        now = .0.value(1)
    )]
    NotRepeated(Box<Difference>),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A recording has no tick.
    #[error("the recording of run {0} has no complete tick")]
    Empty(RunName),
}

impl From<RecordError> for ServerError {
    fn from(error: RecordError) -> Self {
        Self::Record(Box::new(error))
    }
}

impl From<world::HallError> for ServerError {
    fn from(error: world::HallError) -> Self {
        Self::Hall(Box::new(error))
    }
}

/// Why a server stops.
#[derive(Debug)]
pub(super) enum StopReason {
    /// The run ends.
    End(End),
    /// The process cannot go on.
    Failed(ServerError),
}

impl<E: Into<ServerError>> From<E> for StopReason {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// Why an epoch of a run stops.
#[derive(Debug)]
pub(super) enum EpochStop {
    /// Another one begins with this scenario, and the client that wants it is answered then.
    Init {
        scenario: Box<Scenario>,
        query: Box<Query>,
    },
    /// The server stops.
    Exit(StopReason),
}

impl<E: Into<StopReason>> From<E> for EpochStop {
    fn from(exit: E) -> Self {
        Self::Exit(exit.into())
    }
}
