//! Signals that end the launcher.

use nix::sys::signal::Signal;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::UnboundedSender;

use super::supervise::SupervisorEvent;

/// Ctrl-C, `kill`, a closed terminal, and Ctrl-\.
const ASKING: [Signal; 4] = [
    Signal::SIGINT,
    Signal::SIGTERM,
    Signal::SIGHUP,
    Signal::SIGQUIT,
];

/// Turns the signals into events of the supervisor, so that none of them kills the launcher.
pub(super) fn listen(queue: &UnboundedSender<SupervisorEvent>) -> std::io::Result<()> {
    for asking in ASKING {
        if asking == Signal::SIGHUP && is_ignored(asking) {
            continue; // Started by `nohup`.
        }
        // From here on the signal does not end the process: it is queued like everything else that
        // happens.
        let mut signals = signal(SignalKind::from_raw(asking as i32))?;
        let queue = queue.clone();
        tokio::spawn(async move {
            while signals.recv().await.is_some()
                && queue.send(SupervisorEvent::Asked(asking)).is_ok()
            {}
        });
    }

    Ok(())
}

/// Whether this process was started with the signal ignored.
fn is_ignored(signal: Signal) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    let mask = mask.unwrap_or_default();
    mask & (1 << (signal as i32 - 1)) != 0
}
