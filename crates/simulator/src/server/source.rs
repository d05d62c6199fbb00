//! Where the ticks of a run come from.

use std::time::Duration;

use bus::Query;
use protocol::Tick;
use protocol::messages::{Control, ControlAnswer, Status};
use scenario::Scenario;

use super::event::{ServerEvent, StopReason};
use super::frontend::{Frontend, answer};

/// What a server does next.
pub(super) enum Next {
    /// Something has changed: look at what comes of it.
    GoOn,
    /// Wait for an event, at most for this long.
    Wait(Option<Duration>),
}

/// Where the ticks of a run come from: robots in lock-step, or a recording.
pub(super) trait TickSource: Send + Sized + 'static {
    /// Why handling an event stops the work.
    type Interrupt: From<StopReason>;

    /// A thread begins to work.
    fn begin_work(&mut self) {}

    /// What came of the work: it goes on, or the server stops.
    fn end_work(
        &mut self,
        outcome: Result<Option<Duration>, Self::Interrupt>,
        frontend: &mut Frontend,
    ) -> Result<Option<Duration>, StopReason>;

    /// Goes on by at most one tick, if one is due.
    fn advance(&mut self, frontend: &mut Frontend) -> Result<Next, Self::Interrupt>;

    /// Handles an event that is not the same for all sources.
    fn handle(
        &mut self,
        event: ServerEvent,
        frontend: &mut Frontend,
    ) -> Result<(), Self::Interrupt>;

    /// Handles a request of control.
    fn request(
        &mut self,
        query: Query,
        control: Control,
        frontend: &mut Frontend,
    ) -> Result<(), Self::Interrupt>;

    /// Does what only this source can do.
    ///
    /// # Errors
    /// Why it is refused, in words.
    fn act(&mut self, control: &Control, frontend: &mut Frontend) -> Result<(), String>;

    /// Whether there is a further tick to start for.
    ///
    /// # Errors
    /// Why not, in words.
    fn check_next_tick(&self) -> Result<(), String>;

    /// The tick at which this many further ones are complete; `None` if a client that steps is answered at once.
    fn tick_after(&self, ticks: u64) -> Option<Tick>;

    /// The scenario of the epoch.
    ///
    /// # Errors
    /// Why it cannot be read, in words.
    fn scenario(&self) -> Result<Scenario, String>;

    /// How things stand.
    fn status(&self, frontend: &Frontend) -> Status;

    /// Shows observers how things stand, after a request that may have changed it.
    fn show(&mut self, frontend: &mut Frontend);

    fn answer_status(&self, query: &Query, frontend: &Frontend) {
        let status = Box::new(self.status(frontend));
        answer(query, &ControlAnswer::Done(status));
    }

    /// Answers the client that has stopped the run, which is over now.
    fn answer_stopping(&self, frontend: &mut Frontend) {
        if let Some(query) = frontend.stopping.take() {
            self.answer_status(&query, frontend);
        }
    }

    /// Answers a client whose steps are done.
    fn answer_reached(&self, tick: Tick, frontend: &mut Frontend) {
        if let Some(query) = frontend.pace.reached(tick) {
            self.answer_status(&query, frontend);
        }
    }

    /// Answers a client whose steps are not done, and will not be for now.
    fn answer_stepping(&self, frontend: &mut Frontend) {
        if let Some(query) = frontend.pace.give_up_stepping() {
            self.answer_status(&query, frontend);
        }
    }
}
