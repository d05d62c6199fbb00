//! The loop of a server.

use std::time::Duration;

use bus::{Worker, WorkerThread};

use super::control::handle;
use super::event::{ServerEvent, StopReason};
use super::frontend::Frontend;
use super::source::{Next, TickSource};

/// A run on the bus.
pub struct Server<S> {
    pub(super) frontend: Frontend,
    pub(super) source: S,
}

impl<S> Server<S> {
    /// What asks this server to end, from any thread: a signal, for example.
    pub fn stopper(&self) -> impl Fn() + Clone + Send + Sync + 'static {
        let inbox = self.frontend.inbox.clone();
        move || inbox.send(ServerEvent::Terminate)
    }
}

/// Runs a server until it stops.
pub(super) fn run_to_exit<S: TickSource>(server: Server<S>) -> (Server<S>, StopReason) {
    let inbox = server.frontend.inbox.clone();
    let (Loop(server), exit) = inbox.run(Loop(server));
    (server, exit)
}

/// A server that runs.
struct Loop<S>(Server<S>);

impl<S: TickSource> Worker for Loop<S> {
    type Exit = StopReason;

    fn work(&mut self, _: WorkerThread) -> Result<Option<Duration>, StopReason> {
        let Server { frontend, source } = &mut self.0;
        source.begin_work();
        // Whatever stops the work, `end_work` still writes what is complete.
        let outcome = work_until_idle(source, frontend);
        source.end_work(outcome, frontend)
    }
}

/// Does all that can be done now. Events come first, so that a request is answered between any two ticks.
fn work_until_idle<S: TickSource>(
    source: &mut S,
    frontend: &mut Frontend,
) -> Result<Option<Duration>, S::Interrupt> {
    loop {
        // One event at a time: what it changes is seen by the next one, and by the look at the clock
        // after all of them.
        while let Some(event) = frontend.inbox.take() {
            handle(event, source, frontend)?;
        }
        if let Next::Wait(rest) = source.advance(frontend)? {
            return Ok(rest);
        }
    }
}
