//! How a server runs.

use std::time::Duration;

use protocol::RunName;

/// While the clock is held it is repeated this often: what was lost on the wire is then sent again.
pub const REPEAT_AFTER: Duration = Duration::from_secs(2);

/// How a simulator process runs.
#[derive(Debug, Clone)]
pub struct ServerOptions {
    /// Name of the run in the keys.
    pub run: RunName,
    /// Simulated seconds per second; `None` is as fast as the barrier goes.
    pub speed: Option<f64>,
    /// Whether the clock waits for `start` once every robot is connected.
    pub is_paused: bool,
    /// Whether a launcher has started the process: it is about to connect, and stops and starts robots' processes.
    pub is_launched: bool,
    /// Whether the process stays when the run is over.
    pub stay: KeepAlive,
    /// While the clock is held it is repeated this often; [`REPEAT_AFTER`] unless a test is in a hurry.
    pub repeat_after: Duration,
}

/// Whether a simulator process stays when a run ends without being stopped: then `init` begins another epoch, with the same
/// processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeepAlive {
    /// It ends.
    Never,
    /// It stays while a browser shows the run in a console.
    Viewed,
    /// It stays until it is stopped.
    Always,
}
