//! The middleware's threads.
//!
//! Its default of one small thread pool per duty costs a lock-step system up to half of its ticks: every message
//! crosses several threads. One shared worker gave 1.2 to 2 times the ticks per second at half the processor time.

use std::os::unix::process::CommandExt;

/// Environment variable that the middleware reads once, at its first use.
pub const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// All duties handed over to one runtime with one worker.
pub const ONE_THREAD: &str = "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))";

/// Makes this process use the lock-step thread set-up unless the environment already chooses one.
///
/// To be called first in `main`. The variable must be in the environment before any thread exists, which a running
/// program cannot arrange for itself in safe code; so the program replaces itself, once, by itself with the variable
/// set. The process keeps its id. Where that fails it goes on with the defaults: slower, not wrong.
pub fn use_one_thread() {
    if std::env::var_os(RUNTIME_VARIABLE).is_some() {
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
    let error = command
        .args(arguments)
        .env(RUNTIME_VARIABLE, ONE_THREAD)
        .exec();
    tracing::warn!(%error, "could not apply the lock-step thread set-up");
}
