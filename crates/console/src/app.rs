//! The state that all connections share: what is shown, how many clients may use it, and whether the console ends.

use std::sync::Arc;

use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, SemaphorePermit, watch};

use crate::failed::Failed;
use crate::guard::Guard;
use crate::live::Live;
use crate::past::RecordedEpochs;

/// Most browsers at a time.
pub(crate) const MAX_BROWSERS: usize = 32;
/// Most requests, of all browsers, that may wait for the simulator's answer; each occupies a thread.
const MAX_REQUESTS: usize = 64;
/// Most ranges that are read from a recording at a time.
const MAX_READS: usize = 2;

/// What is shown.
pub(crate) enum Mode {
    /// A run in progress, or one that has not started yet.
    Live(Arc<Live>),
    /// The recording of this run.
    Recording(String),
}

/// The state that all connections share.
pub(crate) struct App {
    /// Decides which requests are answered.
    pub(crate) guard: Guard,
    /// What is shown.
    pub(crate) mode: Mode,
    /// What is recorded of it; none if its folder is not known.
    pub(crate) past: Option<RecordedEpochs>,
    /// Whether pages explain their first steps.
    pub(crate) has_guide: bool,
    /// Whether a browser has been connected so far.
    was_viewed: watch::Sender<bool>,
    browsers: Arc<Semaphore>,
    requests: Arc<Semaphore>,
    reads: Semaphore,
    ending: watch::Sender<bool>,
    entry: Notify,
    failed: watch::Sender<Option<Arc<Failed>>>,
    resumption: Notify,
}

impl App {
    /// A console that shows `mode` to clients that `guard` admits.
    pub(crate) fn new(
        guard: Guard,
        mode: Mode,
        past: Option<RecordedEpochs>,
        has_guide: bool,
    ) -> Self {
        Self {
            guard,
            mode,
            past,
            has_guide,
            was_viewed: watch::Sender::new(false),
            browsers: Arc::new(Semaphore::new(MAX_BROWSERS)),
            requests: Arc::new(Semaphore::new(MAX_REQUESTS)),
            reads: Semaphore::new(MAX_READS),
            ending: watch::Sender::new(false),
            entry: Notify::new(),
            failed: watch::Sender::new(None),
            resumption: Notify::new(),
        }
    }

    /// Asks all connections to close.
    pub(crate) fn end(&self) {
        self.ending.send_replace(true);
    }

    /// Resolves when [`App::end`] has been called.
    pub(crate) fn ending(&self) -> Ending {
        Ending(self.ending.subscribe())
    }

    /// Notes that a browser has shown the token.
    pub(crate) fn on_entry(&self) {
        self.entry.notify_one();
    }

    /// Waits until a browser has shown the token. For one task.
    pub(crate) async fn entered(&self) {
        self.entry.notified().await;
    }

    /// Tells all browsers why the run has failed.
    pub(crate) fn fail(&self, failed: Failed) {
        self.failed.send_replace(Some(Arc::new(failed)));
    }

    /// Why the run has failed, once it has.
    pub(crate) fn failed(&self) -> watch::Receiver<Option<Arc<Failed>>> {
        self.failed.subscribe()
    }

    /// Notes that a person wants a run that has failed to go on. Returns whether it has failed.
    pub(crate) fn on_resume(&self) -> bool {
        let has_failed = self.failed.borrow().is_some();
        if has_failed {
            self.resumption.notify_one();
        }
        has_failed
    }

    /// Waits until a person wants the run to go on. For one task.
    pub(crate) async fn resumed(&self) {
        self.resumption.notified().await;
    }

    /// Closes the session with the run.
    pub(crate) fn close(&self) {
        if let Mode::Live(live) = &self.mode {
            live.end();
        }
    }

    /// A permit for one browser; `None` if [`MAX_BROWSERS`] are connected.
    pub(crate) fn admit_browser(&self) -> Option<OwnedSemaphorePermit> {
        let permit = self.browsers.clone().try_acquire_owned().ok()?;
        self.was_viewed.send_replace(true);
        Some(permit)
    }

    /// Waits until a browser has been connected.
    pub(crate) async fn viewed(&self) {
        // It cannot fail: this owns the sender.
        let mut was_viewed = self.was_viewed.subscribe();
        let _viewed = was_viewed.wait_for(|viewed| *viewed).await;
    }

    /// A permit for one request to the simulator; `None` if too many wait for an answer.
    pub(crate) fn admit_request(&self) -> Option<OwnedSemaphorePermit> {
        self.requests.clone().try_acquire_owned().ok()
    }

    /// Waits for a permit to read from the recording. `None` never happens: the semaphore is not closed.
    pub(crate) async fn admit_read(&self) -> Option<SemaphorePermit<'_>> {
        self.reads.acquire().await.ok()
    }

    /// Whether a browser is connected.
    pub(crate) fn is_viewed(&self) -> bool {
        self.browsers.available_permits() < MAX_BROWSERS
    }

    /// Waits until no browser is connected.
    pub(crate) async fn browsers_left(&self) {
        let _all = self.browsers.acquire_many(MAX_BROWSERS as u32).await;
    }
}

/// Whether the console ends.
pub(crate) struct Ending(watch::Receiver<bool>);

impl Ending {
    /// Waits until the console ends.
    pub(crate) async fn reached(&mut self) {
        // The only error is that the sender was dropped, and then the console has ended, too.
        let _is_ending = self.0.wait_for(|is_ending| *is_ending).await;
    }
}
