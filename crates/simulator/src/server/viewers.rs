//! Whether people look at the run in a browser.

use std::time::{Duration, Instant};

/// A browser that is gone for less than this may be loading the page again.
const GRACE: Duration = Duration::from_secs(10);

/// Whether a browser shows the run, and when the last one was gone.
#[derive(Debug, Default)]
pub(super) struct Viewers {
    are_present: bool,
    gone_at: Option<Instant>,
}

impl Viewers {
    /// A console declares whether browsers show the run there.
    pub(super) fn note(&mut self, are_present: bool) {
        if self.are_present && !are_present {
            self.gone_at = Some(Instant::now());
        }
        self.are_present = are_present;
    }

    /// How long to wait for browsers to come back; `None` while there is one.
    pub(super) fn rest(&self) -> Option<Duration> {
        if self.are_present {
            return None;
        }
        // Where there has never been a browser, none is waited for.
        let gone = self.gone_at.map_or(GRACE, |gone_at| gone_at.elapsed());
        Some(GRACE.saturating_sub(gone))
    }
}
