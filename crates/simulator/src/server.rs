//! The simulator as a process: it translates between the bus, the lock-step ([`lockstep::Barrier`]) and the
//! [`Simulation`](environment::Simulation).
//!
//! A [`Server`] has one [`bus::Inbox`]. Everything that can happen is an event, and one thread at a time works on them: the
//! one on which an event arrives, or the server's own. Control is answered in the same way, also while the clock is held, because
//! no work ever waits for a robot.
//!
//! What observers and clients see (`frontend`, `control`, `pace`) is the same wherever the ticks come from (`source`): they take
//! place now ([`LiveRun`]), or are those of a recording ([`RecordedRun`]).

mod control;
mod departed;
mod ended;
mod event;
mod faults;
mod frame;
mod frontend;
mod join;
mod live;
mod messages;
mod observers;
mod offers;
mod options;
mod orders;
mod pace;
mod player;
mod process;
mod record;
mod recorded;
mod rejoins;
mod replay_log;
mod requests;
mod source;
mod ticks;
mod timers;
mod viewers;
mod watchdog;

pub use event::ServerError;
pub use live::LiveRun;
pub use options::{KeepAlive, REPEAT_AFTER, ServerOptions};
pub use process::Server;
pub use recorded::RecordedRun;
pub use replay_log::ReplayLog;
