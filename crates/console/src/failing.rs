//! A run that failed: the console stays while a browser shows why. What follows is the launcher's again, which learns it from the
//! exit status: the end, or the run once more.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::app::App;
use crate::failed::Failed;

/// How often to look whether the run has failed.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// A browser that is gone for less than this may be loading the page again, or has been started and is not here yet.
const GRACE: Duration = Duration::from_secs(10);

/// How the console ends after a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AfterFailure {
    /// Nobody looks any more.
    End,
    /// A person wants the run to go on.
    Resume,
}

/// Looks for the file in which the launcher says that the run has failed, and tells browsers. Returns when a person wants the run
/// to go on, or when it has failed and no browser shows it. `awaits_browser` is whether one has been started.
pub(crate) async fn watch(file: &Path, app: &App, awaits_browser: bool) -> AfterFailure {
    // A browser that was started counts as seen until it can be here.
    let mut seen_at = awaits_browser.then(|| Instant::now() + GRACE);
    loop {
        tokio::select! {
            () = app.resumed() => return AfterFailure::Resume,
            () = tokio::time::sleep(LOOK_EVERY) => {}
        }
        if app.is_viewed() {
            seen_at = seen_at.max(Some(Instant::now()));
        }

        // Told once. From then on only the browsers decide when this ends.
        if app.failed().borrow().is_none() {
            let Some(failed) = Failed::read(file) else {
                continue;
            };
            app.fail(failed);
        }
        if seen_at.is_none_or(|seen_at| seen_at.elapsed() >= GRACE) {
            return AfterFailure::End;
        }
    }
}
