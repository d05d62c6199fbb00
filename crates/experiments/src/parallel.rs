//! Plays on several threads whose result does not depend on their number.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::Builder;

/// The result of `play` for each item, in their order. Items that are not begun when `stop` is set have none.
pub fn all<T: Sync, R: Send>(
    items: &[T],
    jobs: usize,
    stop: &AtomicBool,
    play: impl Fn(&T) -> R + Sync,
) -> Vec<Option<R>> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else {
                break;
            };
            done.push((index, play(item)));
        }
        done
    };

    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        // This thread is a worker, too, so the work is done even if the system starts no other one.
        let mut workers = Vec::new();
        for _ in 1..jobs.min(items.len()) {
            workers.extend(Builder::new().spawn_scoped(scope, work));
        }
        let mut all_done = work();
        for worker in workers {
            match worker.join() {
                Ok(done) => all_done.extend(done),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        for (index, result) in all_done {
            results[index] = Some(result);
        }
    });
    results
}

/// The first item, in their order, for which `play` has a result, and the result. Of the items after it at most as many are
/// played as run at the same time.
pub fn first<T: Sync, R: Send>(
    items: &[T],
    jobs: usize,
    stop: &AtomicBool,
    play: impl Fn(&T) -> Option<R> + Sync,
) -> Option<(usize, R)> {
    let jobs = jobs.max(1);
    for (chunk, some) in items.chunks(jobs).enumerate() {
        let results = all(some, jobs, stop, &play);
        for (index, result) in results.into_iter().enumerate() {
            if let Some(result) = result.flatten() {
                return Some((chunk * jobs + index, result));
            }
        }
    }

    None
}
