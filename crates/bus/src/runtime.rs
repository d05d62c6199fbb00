//! The middleware's threads, and work that is done on them.
//!
//! Its default of one small thread pool per duty costs a lock-step system up to half of its ticks: every message
//! crosses several threads. One shared worker gave 1.2 to 2 times the ticks per second at half the processor time.

use std::os::unix::process::CommandExt;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;

/// Environment variable that the middleware reads once, at its first use.
pub const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// All duties on one thread: the cheapest set-up.
pub const ONE_THREAD: &str = "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))";

/// The same, and a thread of its own for sending. What forwards messages needs it: a thread that receives blocks while the
/// queue of the link that a message is forwarded to is full, and must not be the one that empties this queue.
pub const OWN_SENDER: &str = "(rx:(handover:app),tx:(worker_threads:1),acc:(handover:app),net:(handover:app),app:(worker_threads:1))";

/// Makes this process use one thread for the middleware, unless the environment chooses other set-ups than the two above.
///
/// To be called before any thread exists. The variable must be in the environment by then, which a running program cannot
/// arrange for itself in safe code; so the program replaces itself, once, by itself with the variable set. The process keeps
/// its id. Where that fails it goes on with the defaults: slower, not wrong.
pub fn use_one_thread() {
    use_threads(ONE_THREAD);
}

/// The same for a process that forwards messages, a simulator or a router: [`OWN_SENDER`].
pub fn use_router_threads() {
    use_threads(OWN_SENDER);
}

fn use_threads(wanted: &str) {
    let chosen = std::env::var(RUNTIME_VARIABLE);
    // One of the two set-ups here was inherited from a program of the project that has started this
    // one. Any other one is the choice of a person, and stays.
    let is_ours = match chosen.as_deref() {
        Ok(ONE_THREAD | OWN_SENDER) | Err(std::env::VarError::NotPresent) => true,
        Ok(_) | Err(std::env::VarError::NotUnicode(_)) => false,
    };
    if !is_ours || chosen.as_deref() == Ok(wanted) {
        return;
    }
    let Ok(program) = std::env::current_exe() else {
        return;
    };

    let mut arguments = std::env::args_os();
    let mut command = std::process::Command::new(program);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    // This returns only if it fails. The program that takes over finds the variable as wanted, so it
    // does not do the same again.
    let error = command.args(arguments).env(RUNTIME_VARIABLE, wanted).exec();
    tracing::warn!(%error, "could not apply the lock-step thread set-up");
}

/// Threads that a session needs, with some to spare.
const THREADS: usize = 8;

/// Checks that the system starts the threads that the middleware needs: it panics where one cannot be started.
///
/// # Errors
/// The system's reason.
pub fn check_threads() -> std::io::Result<()> {
    let all_started = Arc::new(Mutex::new(()));
    let starting = all_started.lock().unwrap_or_else(PoisonError::into_inner);
    let mut threads = Vec::new();
    let mut refused = Ok(());
    for _ in 0..THREADS {
        // Each lasts until all have been started, or one could not be.
        let waits = all_started.clone();
        match Builder::new().spawn(move || drop(waits.lock())) {
            Ok(thread) => threads.push(thread),
            Err(error) => refused = Err(error),
        }
    }
    drop(starting);

    // The system counts a thread until it has ended.
    for thread in threads {
        let _ended = thread.join();
    }
    refused
}

/// Whether this process sends on a thread of its own. Then a subscriber may put messages and take its time, and the process
/// stays connected meanwhile.
#[must_use]
pub fn has_own_sender() -> bool {
    std::env::var(RUNTIME_VARIABLE).as_deref() == Ok(OWN_SENDER)
}

/// Runs `work` soon on the middleware's thread, after the message that is being handled there: nothing is handed from one
/// thread to another. For callers on that thread; on any other one `work` comes back.
///
/// # Errors
/// The work, if this is not the middleware's thread.
pub fn run_soon<W: FnOnce() + Send + 'static>(work: W) -> Result<(), W> {
    // The middleware's threads are in its runtime; those of the project are in none.
    let Ok(handle) = tokio::runtime::Handle::try_current() else {
        return Err(work);
    };

    handle.spawn(async move { work() });
    Ok(())
}

/// Runs something that may block. On the middleware's thread, another one takes over its duties meanwhile.
pub fn block<T>(work: impl FnOnce() -> T) -> T {
    tokio::task::block_in_place(work)
}
