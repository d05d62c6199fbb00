//! When a tick is granted.

use std::time::{Duration, Instant};

use bus::Query;
use protocol::Tick;
use protocol::messages::Phase;

/// A paced clock that has fallen behind by more than this does not try to catch up.
const MAX_BEHIND: Duration = Duration::from_millis(500);

/// The pace of the clock.
pub(super) struct Pace {
    pub(super) phase: Phase,
    /// What to do once everybody is there.
    pub(super) starts_paused: bool,
    pub(super) speed: Option<f64>,
    pub(super) due: Instant,
    pub(super) pending_steps: u64,
    /// Who asked to step, and the tick at which the answer is due.
    pub(super) stepping: Option<(Query, Tick)>,
}

impl Pace {
    pub(super) fn new(speed: Option<f64>, starts_paused: bool) -> Self {
        Self {
            phase: Phase::Gathering,
            starts_paused,
            speed,
            due: Instant::now(),
            pending_steps: 0,
            stepping: None,
        }
    }

    /// An epoch begins: robots are awaited.
    pub(super) fn gather(&mut self) {
        self.phase = Phase::Gathering;
    }

    /// Tick 0 is complete.
    pub(super) fn ready(&mut self) {
        self.phase = if self.starts_paused {
            Phase::Ready
        } else {
            Phase::Running
        };
        // Whoever presses init later wants to press start, too.
        self.starts_paused = true;
        (self.pending_steps, self.stepping) = (0, None);
        self.due = Instant::now();
    }

    pub(super) fn end(&mut self) {
        self.phase = Phase::Ended;
    }

    /// Who is to be told that a tick is reached.
    pub(super) fn reached(&mut self, tick: Tick) -> Option<(Query, Tick)> {
        self.stepping.take_if(|(_, until)| tick >= *until)
    }

    /// Who is to be told that stepping hangs.
    pub(super) fn give_up_stepping(&mut self) -> Option<Query> {
        self.stepping.take().map(|(query, _)| query)
    }

    /// Takes one tick of what was granted. `Err` says how long to wait at most before looking again.
    pub(super) fn take_grant(&mut self, tick_s: f64) -> Result<(), Option<Duration>> {
        if self.pending_steps > 0 {
            self.pending_steps -= 1;
            return Ok(());
        }
        if self.phase != Phase::Running {
            return Err(None);
        }
        let Some(speed) = self.speed else {
            return Ok(());
        };
        let now = Instant::now();
        if self.due > now {
            return Err(Some(self.due - now));
        }
        // A speed is finite and positive, but a very slow one asks for a very long tick.
        let tick = Duration::try_from_secs_f64(tick_s / speed).unwrap_or(Duration::MAX);
        let from = if now - self.due > MAX_BEHIND {
            now
        } else {
            self.due
        };
        self.due = from
            .checked_add(tick)
            .unwrap_or(now + Duration::from_secs(86_400));
        Ok(())
    }
}
