//! What arrives at a server, and the thread that works on it: the one on which a message arrives, so that nothing is handed
//! from thread to thread, or else the server's own. The own thread always is the one that a timer wakes.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::recorder::Recorder;
use crate::simulation::Simulation;

use super::process::{Event, Interrupt, Server};

/// Events that may queue up before links are slowed down.
const QUEUE: usize = 65_536;

/// Where events are sent to.
#[derive(Clone)]
pub struct Inbox {
    queue: SyncSender<Event>,
    desk: Arc<Desk>,
}

/// Where a server takes its events from.
pub(super) struct Events {
    queue: Receiver<Event>,
    desk: Arc<Desk>,
}

/// An epoch that a server runs.
pub(super) struct Running {
    pub(super) server: Server,
    pub(super) simulation: Simulation,
    pub(super) recorder: Recorder,
    /// Why the epoch is over, when it is.
    interrupt: Option<Interrupt>,
}

/// What those that send events share with the server's thread.
struct Desk {
    running: Mutex<Option<Running>>,
    /// Events that are sent and not handled.
    queued: AtomicUsize,
    sleep: Mutex<Sleep>,
    woken: Condvar,
    works_on_arrival: bool,
}

/// The sleep of the server's own thread.
#[derive(Debug, Default)]
struct Sleep {
    /// When it ends by itself.
    until: Option<Instant>,
    is_woken: bool,
}

/// The two ends of a server's queue. Whether its work is done where events arrive is decided here: only where the process
/// stays connected while it works there.
pub(super) fn inbox() -> (Inbox, Events) {
    let (sender, receiver) = std::sync::mpsc::sync_channel(QUEUE);
    let desk = Arc::new(Desk {
        running: Mutex::new(None),
        queued: AtomicUsize::new(0),
        sleep: Mutex::default(),
        woken: Condvar::new(),
        works_on_arrival: bus::runtime::has_own_sender(),
    });
    let inbox = Inbox {
        queue: sender,
        desk: desk.clone(),
    };
    let events = Events {
        queue: receiver,
        desk,
    };
    (inbox, events)
}

impl Inbox {
    /// Sends an event, and works on it if no other thread is working.
    pub fn send(&self, event: Event) {
        self.desk.queued.fetch_add(1, Ordering::SeqCst);
        // It fails only when the process ends, and then no event matters any more.
        if self.queue.send(event).is_err() {
            return;
        }

        if self.desk.works_on_arrival {
            self.desk.work_here();
        } else {
            self.desk.wake();
        }
    }

    /// Runs an epoch on this thread and on those on which events arrive, until it is over.
    pub(super) fn run(&self, running: Running) -> (Running, Interrupt) {
        let desk = &self.desk;
        *lock(&desk.running) = Some(running);
        loop {
            let mut slot = lock(&desk.running);
            let Some(running) = slot.as_mut() else {
                unreachable!("it is taken out below only");
            };
            running.work();
            if let Some(interrupt) = running.interrupt.take()
                && let Some(running) = slot.take()
            {
                return (running, interrupt);
            }
            drop(slot);

            desk.sleep();
        }
    }
}

impl Events {
    /// The next event, if one is queued.
    pub(super) fn try_next(&self) -> Option<Event> {
        let event = self.queue.try_recv().ok()?;

        self.desk.queued.fetch_sub(1, Ordering::SeqCst);
        Some(event)
    }

    /// The next event, or `None` after `patience`: for a server that no epoch runs.
    pub(super) fn wait(&self, patience: Duration) -> Option<Event> {
        match self.queue.recv_timeout(patience) {
            Ok(event) => {
                self.desk.queued.fetch_sub(1, Ordering::SeqCst);
                Some(event)
            }
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => None,
        }
    }
}

impl Running {
    pub(super) fn new(server: Server, simulation: Simulation, recorder: Recorder) -> Self {
        Self {
            server,
            simulation,
            recorder,
            interrupt: None,
        }
    }

    /// Does all that can be done now.
    fn work(&mut self) {
        if self.interrupt.is_some() {
            return;
        }

        let desk = self.server.events.desk.clone();
        match self.server.work(&mut self.simulation, &mut self.recorder) {
            Ok(patience) => {
                let until = patience.and_then(|patience| Instant::now().checked_add(patience));
                if let Some(until) = until {
                    desk.sleep_until(until);
                }
            }
            Err(interrupt) => {
                self.interrupt = Some(interrupt);
                desk.wake();
            }
        }
    }
}

impl Desk {
    /// Works until no event is left, unless another thread does.
    fn work_here(&self) {
        loop {
            let alarm = Alarm(self);
            // Another thread that works looks for further events when it is done.
            let Ok(mut slot) = self.running.try_lock() else {
                return;
            };
            let Some(running) = slot.as_mut() else { return };
            running.work();
            drop(alarm);
            let is_over = running.interrupt.is_some();
            drop(slot);

            if is_over || self.queued.load(Ordering::SeqCst) == 0 {
                return;
            }
        }
    }

    /// Wakes the server's own thread.
    fn wake(&self) {
        lock(&self.sleep).is_woken = true;
        self.woken.notify_one();
    }

    /// The server's own thread has something to do at this time at the latest.
    fn sleep_until(&self, until: Instant) {
        let mut sleep = lock(&self.sleep);
        // A plan that is too early stands: to wake once in vain is cheaper than to plan anew in each tick.
        if sleep.until.is_none_or(|planned| until < planned) {
            sleep.until = Some(until);
            self.woken.notify_one();
        }
    }

    /// Sleeps until there is something to do.
    fn sleep(&self) {
        let mut sleep = lock(&self.sleep);
        // An event may be left to this thread by a sender that found it at work.
        while !sleep.is_woken && self.queued.load(Ordering::SeqCst) == 0 {
            let Some(until) = sleep.until else {
                sleep = self
                    .woken
                    .wait(sleep)
                    .unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            let waited = self.woken.wait_timeout(sleep, left);
            sleep = waited.unwrap_or_else(PoisonError::into_inner).0;
        }

        *sleep = Sleep::default();
    }
}

/// Wakes the server's own thread when the one that works panics: it finds out, and the process ends.
struct Alarm<'a>(&'a Desk);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.wake();
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    match mutex.lock() {
        Ok(guard) => guard,
        Err(_) => panic!("another thread of the server panicked"),
    }
}
