//! A queue whose items are worked on by one thread at a time: by the one on which they arrive, so that nothing is handed from
//! thread to thread, or else by the owner's, which also wakes for timers.
//!
//! Two locks. A thread works only while it holds the lock of the worker; the lock of the queue is held for a few instructions.
//!
//! *No item is lost.* An item is queued first, and only then does its thread try the lock of the worker. If another thread has
//! it, that one looks into the queue once more after it has given the lock back, and finds the item there: either it works on it
//! itself (the owner's thread) or it wakes the owner's. The owner's thread looks into the queue under the lock under which items
//! are queued before it sleeps.
//!
//! *No item is worked on twice.* It is taken out of the queue under the lock of the queue, by one that has the worker.
//!
//! *No deadlock.* A thread on which an item arrives only ever tries the lock of the worker. The owner's thread waits for it, but
//! holds nothing then. The lock of the queue is the last one that a thread takes.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crate::runtime;

/// Items that may queue up before those that send them are slowed down.
const MAX_QUEUED: usize = 65_536;

/// What works on the items of an [`Inbox`].
pub trait Worker: Send + 'static {
    /// Why the work is over.
    type Exit: Send;

    /// Does all that can be done now on this thread. Returns after how long to work again at the latest, also without a further
    /// item. What it leaves in the queue on a thread of arrival is for the owner's.
    ///
    /// # Errors
    /// Why the work is over.
    fn work(&mut self, thread: WorkerThread) -> Result<Option<Duration>, Self::Exit>;
}

/// A thread that works.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkerThread {
    /// The one that called [`Inbox::run`].
    Owner,
    /// One on which an item arrived.
    Arrival,
}

/// Where items are worked on that may be worked on where they arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnArrival {
    /// On the owner's thread.
    Wake,
    /// At once.
    Work,
    /// On the same thread, after the message that the middleware handles there.
    WorkSoon,
}

/// A queue of items, and the worker that [`Inbox::run`] is given.
pub struct Inbox<T>(Arc<InboxShared<T>>);

struct InboxShared<T> {
    queue: Mutex<ItemQueue<T>>,
    wake_owner: Condvar,
    wake_worker: Condvar,
    has_room: Condvar,
    on_arrival: OnArrival,
    /// Lets the worker work on this thread, if it is running and no other thread is at it.
    try_work: OnceLock<TryWork<T>>,
}

type TryWork<T> = Box<dyn Fn(&InboxShared<T>) + Send + Sync>;

struct ItemQueue<T> {
    items: VecDeque<T>,
    /// When the owner's thread wakes by itself.
    wakes_at: Option<Instant>,
    /// Whether the owner's thread is to work whatever is queued.
    is_owner_woken: bool,
    /// Whether the worker waits in the middle of its work ([`Inbox::wait`]).
    is_worker_waiting: bool,
    /// Whether something has happened since the worker waited last. A worker that looks, finds nothing and then waits misses
    /// nothing that happens in between.
    has_changed: bool,
}

/// A worker, and why it cannot go on.
struct Slot<W: Worker> {
    worker: W,
    exit: Option<W::Exit>,
}

impl<T> Clone for Inbox<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: Send + 'static> Inbox<T> {
    /// An empty queue.
    #[must_use]
    pub fn new(on_arrival: OnArrival) -> Self {
        let queue = ItemQueue {
            items: VecDeque::new(),
            wakes_at: None,
            is_owner_woken: false,
            is_worker_waiting: false,
            has_changed: false,
        };

        Self(Arc::new(InboxShared {
            queue: Mutex::new(queue),
            wake_owner: Condvar::new(),
            wake_worker: Condvar::new(),
            has_room: Condvar::new(),
            on_arrival,
            try_work: OnceLock::new(),
        }))
    }

    /// Queues an item for the owner's thread. For callers that may hold locks which the work needs: the middleware calls back
    /// about tokens and matching in the middle of its own work.
    pub fn send(&self, item: T) {
        self.0.push_when_there_is_room(item);
        self.wake();
    }

    /// Queues an item, and works on it if no other thread is working: for messages, of which there are many in each tick.
    pub fn send_and_work(&self, item: T) {
        self.0.push_when_there_is_room(item);
        self.arrive();
    }

    /// Queues an item without waking a thread: [`Self::wake`] or [`Self::arrive`] follows. For callers that hold a lock which the
    /// worker takes.
    pub fn push(&self, item: T) {
        self.0.lock().push(item);
    }

    /// What was queued is for the owner's thread, or for a worker that waits.
    pub fn wake(&self) {
        if !self.0.notify_worker() {
            self.0.wake_owner();
        }
    }

    /// What was queued is worked on where it arrives: on this thread, if no other one is working.
    pub fn arrive(&self) {
        if self.0.notify_worker() {
            return;
        }

        let is_done = match self.0.on_arrival {
            OnArrival::Wake => false,
            OnArrival::Work => {
                self.0.work_here();
                true
            }
            OnArrival::WorkSoon => {
                let shared = self.0.clone();
                runtime::run_soon(move || shared.work_here()).is_ok()
            }
        };
        if !is_done {
            self.0.wake_owner();
        }
    }

    /// Something has happened that a worker may wait for, and nothing was queued.
    pub fn notify(&self) {
        self.0.notify_worker();
    }

    /// The owner's thread works at this time at the latest.
    pub fn work_at(&self, due: Instant) {
        self.0.work_at(due);
    }

    /// Takes the next item.
    #[must_use]
    pub fn take(&self) -> Option<T> {
        self.take_if(|_| true)
    }

    /// Takes the next item if it is such a one.
    pub fn take_if(&self, mut is_such: impl FnMut(&T) -> bool) -> Option<T> {
        let mut queue = self.0.lock();
        if !is_such(queue.items.front()?) {
            return None;
        }

        let item = queue.items.pop_front();
        // Senders wait only while the queue is full, so only the first item taken from a full one wakes
        // them.
        if queue.items.len() + 1 == MAX_QUEUED {
            self.0.has_room.notify_all();
        }
        item
    }

    /// Takes the first such item, whatever is before it.
    pub fn take_first(&self, is_such: impl FnMut(&T) -> bool) -> Option<T> {
        // Nothing waits for room here: a queue from which items are taken out of turn is filled by
        // `push`.
        let items = &mut self.0.lock().items;
        let index = items.iter().position(is_such)?;
        items.remove(index)
    }

    /// Takes the next item, or `None` if there is none until this time. For a worker that is over.
    pub fn take_until(&self, until: Instant) -> Option<T> {
        loop {
            let item = self.take();
            if item.is_some() || is_over(Some(until)) {
                return item;
            }
            self.wait(Some(until));
        }
    }

    /// What `look` sees in the next item, which stays in the queue.
    pub fn peek<R>(&self, look: impl FnOnce(&T) -> R) -> Option<R> {
        self.0.lock().items.front().map(look)
    }

    /// Waits until something has happened since the last call, or until this time. For a worker in the middle of its work, or one
    /// that is over. On the middleware's thread another one takes over its duties meanwhile.
    pub fn wait(&self, until: Option<Instant>) {
        runtime::block(|| {
            let mut queue = self.0.lock();
            // Under the lock under which changes are noted: one before this is seen below, one after it
            // notifies.
            queue.is_worker_waiting = true;
            while !queue.has_changed && !is_over(until) {
                queue = wait(&self.0.wake_worker, queue, until);
            }
            queue.is_worker_waiting = false;
            queue.has_changed = false;
        });
    }

    /// Works on this thread, the owner's, and on those on which items arrive, until the work is over. Returns the worker and the
    /// reason. To be called once.
    ///
    /// # Panics
    /// If the worker panicked on another thread.
    pub fn run<W: Worker>(&self, worker: W) -> (W, W::Exit) {
        let slot = Arc::new(Mutex::new(Some(Slot { worker, exit: None })));
        // A weak reference: callbacks of the middleware hold the queue, and must not keep a worker that
        // is over.
        let shared_slot = Arc::downgrade(&slot);
        let _first = self.0.try_work.set(Box::new(move |shared| {
            if let Some(slot) = shared_slot.upgrade() {
                shared.try_work(&slot);
            }
        }));

        loop {
            // This may wait for a thread of arrival that is at work. That one never waits for this one.
            let Ok(mut working) = slot.lock() else {
                panic!("another thread panicked while it worked");
            };
            self.0.work(&mut working, WorkerThread::Owner);
            if let Some(Slot {
                worker,
                exit: Some(exit),
            }) = working.take_if(|slot| slot.exit.is_some())
            {
                return (worker, exit);
            }
            drop(working);

            self.0.sleep();
        }
    }
}

impl<T> InboxShared<T> {
    fn lock(&self) -> MutexGuard<'_, ItemQueue<T>> {
        // Nothing panics under this lock.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push_when_there_is_room(&self, item: T) {
        let mut queue = self.lock();
        while queue.items.len() >= MAX_QUEUED {
            queue = wait(&self.has_room, queue, None);
        }
        queue.push(item);
    }

    /// Wakes a worker that waits in the middle of its work: whatever was queued is left to it. Returns whether one does.
    fn notify_worker(&self) -> bool {
        let mut queue = self.lock();
        // A worker that waits has its own lock, so no other thread could work on the item meanwhile.
        queue.has_changed = true;
        if queue.is_worker_waiting {
            self.wake_worker.notify_all();
        }
        queue.is_worker_waiting
    }

    fn wake_owner(&self) {
        self.lock().is_owner_woken = true;
        self.wake_owner.notify_one();
    }

    fn work_at(&self, due: Instant) {
        let mut queue = self.lock();
        // A plan that is too early stands: to wake once in vain is cheaper than to plan anew in each tick.
        if queue.wakes_at.is_none_or(|planned| due < planned) {
            queue.wakes_at = Some(due);
            self.wake_owner.notify_one();
        }
    }

    fn work_here(&self) {
        if let Some(try_work) = self.try_work.get() {
            try_work(self);
        }
    }

    /// Works on a thread of arrival, unless another thread is at it.
    fn try_work<W: Worker>(&self, slot: &Mutex<Option<Slot<W>>>) {
        let alarm = scopeguard::guard((), |()| {
            // The owner's thread finds the lock poisoned, and the process ends.
            if std::thread::panicking() {
                self.wake_owner();
            }
        });
        // The thread that has the worker looks into the queue after it has given it back.
        let Ok(mut working) = slot.try_lock() else {
            return;
        };
        self.work(&mut working, WorkerThread::Arrival);
        drop(working);
        drop(alarm);

        // Only now: an item that came before the worker was given back is seen here, one that comes later finds it free.
        if !self.lock().items.is_empty() {
            self.wake_owner();
        }
    }

    fn work<W: Worker>(&self, slot: &mut Option<Slot<W>>, thread: WorkerThread) {
        // Items still arrive between the end of the work and the return of the owner's thread.
        let Some(slot) = slot.as_mut().filter(|slot| slot.exit.is_none()) else {
            return;
        };

        match slot.worker.work(thread) {
            Ok(rest) => {
                let due = rest.and_then(|rest| Instant::now().checked_add(rest));
                if let Some(due) = due {
                    self.work_at(due);
                }
            }
            Err(exit) => {
                slot.exit = Some(exit);
                self.wake_owner();
            }
        }
    }

    /// The owner's thread sleeps until there is something to do.
    fn sleep(&self) {
        let mut queue = self.lock();
        // An item may have been left to this thread while it was working.
        while !queue.is_owner_woken && queue.items.is_empty() && !is_over(queue.wakes_at) {
            let until = queue.wakes_at;
            queue = wait(&self.wake_owner, queue, until);
        }

        // The work that follows looks at the whole queue, and says anew when to wake.
        queue.is_owner_woken = false;
        queue.wakes_at = None;
    }
}

impl<T> ItemQueue<T> {
    fn push(&mut self, item: T) {
        self.items.push_back(item);
        self.has_changed = true;
    }
}

fn is_over(until: Option<Instant>) -> bool {
    until.is_some_and(|until| until <= Instant::now())
}

/// Waits on a condition, at most until this time.
fn wait<'a, T>(
    condition: &Condvar,
    guard: MutexGuard<'a, T>,
    until: Option<Instant>,
) -> MutexGuard<'a, T> {
    let Some(until) = until else {
        return condition
            .wait(guard)
            .unwrap_or_else(PoisonError::into_inner);
    };
    let left = until.saturating_duration_since(Instant::now());
    let waited = condition.wait_timeout(guard, left);
    waited.unwrap_or_else(PoisonError::into_inner).0
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::thread::{self, ThreadId};

    use super::*;

    /// Longer than anything here takes, also on a busy machine.
    const LONG: Duration = Duration::from_secs(30);
    /// The item that ends the work.
    const END: u32 = u32::MAX;

    /// Notes items, and the threads on which they were worked on.
    struct Notes {
        inbox: Inbox<u32>,
        noted: Sender<(u32, ThreadId)>,
        /// Works on no item before it receives something.
        gate: Option<Receiver<()>>,
    }

    impl Worker for Notes {
        type Exit = ();

        fn work(&mut self, _: WorkerThread) -> Result<Option<Duration>, ()> {
            while let Some(item) = self.inbox.take() {
                if item == END {
                    return Err(());
                }
                self.noted.send((item, thread::current().id())).unwrap();
                if let Some(gate) = &self.gate {
                    gate.recv().unwrap();
                }
            }
            Ok(None)
        }
    }

    /// Runs a worker on a thread of its own, which is asleep when this returns.
    fn start(
        on_arrival: OnArrival,
        gate: Option<Receiver<()>>,
    ) -> (
        Inbox<u32>,
        Receiver<(u32, ThreadId)>,
        thread::JoinHandle<()>,
    ) {
        let inbox = Inbox::new(on_arrival);
        let (noted, notes) = channel();
        let worker = Notes {
            inbox: inbox.clone(),
            noted,
            gate,
        };
        let own = inbox.clone();
        let owner = thread::spawn(move || drop(own.run(worker)));
        while inbox.0.try_work.get().is_none() {
            thread::yield_now();
        }
        (inbox, notes, owner)
    }

    #[test]
    fn an_item_is_worked_on_where_it_arrives() {
        let (inbox, notes, owner) = start(OnArrival::Work, None);
        let here = thread::current().id();
        // The owner's thread may still be about to sleep, and take the first ones.
        let is_here = (0..1000).any(|item| {
            inbox.send_and_work(item);
            notes.recv_timeout(LONG).unwrap().1 == here
        });
        assert!(is_here);

        inbox.send(1000);
        let (_, thread) = notes.recv_timeout(LONG).unwrap();
        assert_eq!(thread, owner.thread().id());
        inbox.send(END);
        owner.join().unwrap();
    }

    #[test]
    fn an_item_that_arrives_during_work_is_left_to_the_thread_at_work() {
        let (open, gate) = channel();
        let (inbox, notes, owner) = start(OnArrival::Work, Some(gate));
        inbox.send(1);
        assert_eq!(notes.recv_timeout(LONG).unwrap(), (1, owner.thread().id()));

        // It does not wait for the other thread.
        inbox.send_and_work(2);
        open.send(()).unwrap();
        assert_eq!(notes.recv_timeout(LONG).unwrap(), (2, owner.thread().id()));
        open.send(()).unwrap();
        inbox.send(END);
        owner.join().unwrap();
    }

    #[test]
    fn each_item_of_many_threads_is_worked_on_once() {
        let (inbox, notes, owner) = start(OnArrival::Work, None);
        let senders = [0, 1, 2, 3].map(|sender| {
            let inbox = inbox.clone();
            thread::spawn(move || {
                for item in 0..5000 {
                    inbox.send_and_work(sender * 5000 + item);
                    if item % 64 == 0 {
                        thread::yield_now();
                    }
                }
            })
        });

        let mut seen = BTreeSet::new();
        while seen.len() < 20_000 {
            let (item, _) = notes.recv_timeout(LONG).unwrap();
            assert!(seen.insert(item), "{item} twice");
        }
        for sender in senders {
            sender.join().unwrap();
        }
        inbox.send(END);
        owner.join().unwrap();
    }

    #[test]
    fn a_worker_that_waits_misses_nothing() {
        let inbox: Inbox<u32> = Inbox::new(OnArrival::Work);
        let other = inbox.clone();
        let sender = thread::spawn(move || {
            for item in 0..1000 {
                other.send_and_work(item);
            }
        });

        for expected in 0..1000 {
            assert_eq!(inbox.take_until(Instant::now() + LONG), Some(expected));
        }
        sender.join().unwrap();
    }

    /// Ends when it works for the second time.
    struct Twice(bool);

    impl Worker for Twice {
        type Exit = ();

        fn work(&mut self, _: WorkerThread) -> Result<Option<Duration>, ()> {
            if std::mem::replace(&mut self.0, true) {
                return Err(());
            }
            Ok(Some(Duration::from_millis(20)))
        }
    }

    #[test]
    fn the_owner_works_when_it_is_time() {
        let begun = Instant::now();
        Inbox::<u32>::new(OnArrival::Wake).run(Twice(false));
        assert!(begun.elapsed() >= Duration::from_millis(20));
    }

    /// Panics where an item arrives.
    struct Panics(Inbox<u32>);

    impl Worker for Panics {
        type Exit = ();

        fn work(&mut self, thread: WorkerThread) -> Result<Option<Duration>, ()> {
            assert_eq!(thread, WorkerThread::Owner, "a panic that the test wants");
            while self.0.take().is_some() {}
            Ok(None)
        }
    }

    #[test]
    fn a_panic_where_an_item_arrives_ends_the_owner() {
        let inbox: Inbox<u32> = Inbox::new(OnArrival::Work);
        let own = inbox.clone();
        let owner = thread::spawn(move || own.run(Panics(own.clone())).1);
        while !owner.is_finished() {
            let inbox = inbox.clone();
            let arrival = thread::spawn(move || inbox.send_and_work(1));
            let _panicked = arrival.join();
        }
        assert!(owner.join().is_err());
    }
}
