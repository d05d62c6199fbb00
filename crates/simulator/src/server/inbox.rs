//! A queue, and the thread that works on it: the one on which an event arrives, so that nothing is handed from thread to
//! thread, or else the worker's own. The own thread always is the one that a timer wakes.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Events that may queue up before those that send them are slowed down.
const QUEUE: usize = 65_536;

/// What is done about events.
pub(super) trait Work: Send {
    /// What can happen.
    type Event: Send;
    /// Why the work is over.
    type Interrupt: Send;

    /// Handles all events that are queued, and does all that can be done now. Returns how long to wait at most before looking
    /// again.
    fn work(&mut self) -> Result<Option<Duration>, Self::Interrupt>;
}

/// Where events are sent to.
pub(super) struct Inbox<W: Work> {
    queue: SyncSender<W::Event>,
    executor: Arc<Executor<W>>,
}

/// Where the worker takes its events from.
pub(super) struct Events<W: Work> {
    queue: Receiver<W::Event>,
    executor: Arc<Executor<W>>,
}

/// What those that send events share with the worker's own thread.
struct Executor<W: Work> {
    working: Mutex<Option<Working<W>>>,
    /// Events that are sent and not handled.
    queued: AtomicUsize,
    sleep: Mutex<Sleep>,
    woken: Condvar,
    works_on_arrival: bool,
}

/// A worker, and why it cannot go on.
struct Working<W: Work> {
    worker: W,
    interrupt: Option<W::Interrupt>,
}

/// The sleep of the worker's own thread.
#[derive(Debug, Default)]
struct Sleep {
    /// When it ends by itself.
    until: Option<Instant>,
    is_woken: bool,
}

/// The two ends of a queue. Whether the work is done where events arrive is decided here: only where the process stays
/// connected while it works there.
pub(super) fn inbox<W: Work>() -> (Inbox<W>, Events<W>) {
    let (sender, receiver) = std::sync::mpsc::sync_channel(QUEUE);
    let executor = Arc::new(Executor {
        working: Mutex::new(None),
        queued: AtomicUsize::new(0),
        sleep: Mutex::default(),
        woken: Condvar::new(),
        works_on_arrival: bus::runtime::has_own_sender(),
    });
    let inbox = Inbox {
        queue: sender,
        executor: executor.clone(),
    };
    let events = Events {
        queue: receiver,
        executor,
    };
    (inbox, events)
}

impl<W: Work> Clone for Inbox<W> {
    fn clone(&self) -> Self {
        Self {
            queue: self.queue.clone(),
            executor: self.executor.clone(),
        }
    }
}

impl<W: Work> Inbox<W> {
    /// Sends an event to the worker's own thread. For callers that may hold locks which the work needs: the middleware calls
    /// back about tokens and matching in the middle of its own work.
    pub(super) fn send(&self, event: W::Event) {
        if self.enqueue(event) {
            self.executor.wake();
        }
    }

    /// Sends an event, and works on it if no other thread is working: for messages, of which there are many in each tick.
    pub(super) fn send_and_work(&self, event: W::Event) {
        if !self.enqueue(event) {
            return;
        }

        if self.executor.works_on_arrival {
            self.executor.work_here();
        } else {
            self.executor.wake();
        }
    }

    /// Returns whether events are still taken: otherwise the process ends, and no event matters any more.
    fn enqueue(&self, event: W::Event) -> bool {
        // Counted before it is queued: the thread at work looks at the count after it has given the work up, and then either it sees
        // this event or this thread finds the work free. Counted afterwards, an event could be seen by neither.
        self.executor.queued.fetch_add(1, Ordering::SeqCst);
        self.queue.send(event).is_ok()
    }

    /// Works on this thread and on those on which events arrive, until the work is over. Returns the worker and the reason.
    pub(super) fn run(&self, worker: W) -> (W, W::Interrupt) {
        let executor = &self.executor;
        *lock(&executor.working) = Some(Working {
            worker,
            interrupt: None,
        });
        loop {
            let mut slot = lock(&executor.working);
            if let Some(working) = slot.as_mut() {
                executor.work(working);
            }
            if let Some(Working {
                worker,
                interrupt: Some(interrupt),
            }) = slot.take_if(|working| working.interrupt.is_some())
            {
                return (worker, interrupt);
            }
            drop(slot);

            executor.sleep();
        }
    }
}

impl<W: Work> Events<W> {
    /// The next event, if one is queued.
    pub(super) fn try_next(&self) -> Option<W::Event> {
        let event = self.queue.try_recv().ok()?;

        self.executor.queued.fetch_sub(1, Ordering::SeqCst);
        Some(event)
    }

    /// The next event, or `None` after `patience`: for a worker that does not run.
    pub(super) fn wait(&self, patience: Duration) -> Option<W::Event> {
        let event = self.queue.recv_timeout(patience).ok()?;

        self.executor.queued.fetch_sub(1, Ordering::SeqCst);
        Some(event)
    }
}

impl<W: Work> Executor<W> {
    /// Does all that can be done now.
    fn work(&self, working: &mut Working<W>) {
        if working.interrupt.is_some() {
            return;
        }

        match working.worker.work() {
            Ok(patience) => {
                let until = patience.and_then(|patience| Instant::now().checked_add(patience));
                if let Some(until) = until {
                    self.sleep_until(until);
                }
            }
            Err(interrupt) => {
                working.interrupt = Some(interrupt);
                self.wake();
            }
        }
    }

    /// Works until no event is left, unless another thread does.
    fn work_here(&self) {
        loop {
            let alarm = scopeguard::guard(self, |executor| {
                // The worker's own thread finds out that this one panicked, and the process ends.
                if std::thread::panicking() {
                    executor.wake();
                }
            });
            // Another thread that works looks for further events when it is done.
            let Ok(mut slot) = self.working.try_lock() else {
                return;
            };
            let Some(working) = slot.as_mut() else { return };
            self.work(working);
            let is_over = working.interrupt.is_some();
            drop(slot);
            drop(alarm);

            if is_over || self.queued.load(Ordering::SeqCst) == 0 {
                return;
            }
        }
    }

    /// Wakes the worker's own thread.
    fn wake(&self) {
        lock(&self.sleep).is_woken = true;
        self.woken.notify_one();
    }

    /// The worker's own thread has something to do at this time at the latest.
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

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    match mutex.lock() {
        Ok(guard) => guard,
        Err(_) => panic!("another thread panicked while it worked"),
    }
}
