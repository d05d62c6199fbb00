//! When a tick is granted.

use std::time::{Duration, Instant};

use bus::Query;
use protocol::Tick;
use protocol::messages::Phase;

/// A paced clock that has fallen behind by more than this does not try to catch up.
const MAX_BEHIND: Duration = Duration::from_millis(500);

/// Most ticks that one `step` may ask for.
const MAX_STEPS: u64 = 1_000_000;

/// The pace of the clock.
pub(super) struct Pace {
    pub(super) phase: Phase,
    /// Whether the clock is held once every robot is connected.
    pub(super) starts_paused: bool,
    pub(super) speed: Option<f64>,
    pub(super) due: Instant,
    pub(super) pending_steps: u64,
    /// The client that waits for steps, and the tick at which the answer is due.
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
        // After `init`, a later epoch waits for `start`.
        self.starts_paused = true;
        (self.pending_steps, self.stepping) = (0, None);
        self.due = Instant::now();
    }

    pub(super) fn end(&mut self) {
        self.phase = Phase::Ended;
    }

    /// Lets the clock run, at once or when the robots have joined.
    pub(super) fn start(&mut self) -> Result<(), String> {
        match self.phase {
            Phase::Ready | Phase::Paused | Phase::Running => {
                self.phase = Phase::Running;
                self.due = Instant::now();
            }
            Phase::Gathering => self.starts_paused = false,
            Phase::Ended => return Err(format!("the run is {}", self.phase)),
        }
        Ok(())
    }

    /// Holds the clock after the current tick. Steps that are pending are given up.
    pub(super) fn pause(&mut self) -> Result<(), String> {
        match self.phase {
            Phase::Ready | Phase::Paused | Phase::Running => {
                if self.phase == Phase::Running {
                    self.phase = Phase::Paused;
                }
                self.pending_steps = 0;
            }
            Phase::Gathering => self.starts_paused = true,
            Phase::Ended => return Err(format!("the run is {}", self.phase)),
        }
        Ok(())
    }

    /// Holds the clock at the end of a recording, or before a tick of it that cannot be read.
    pub(super) fn hold(&mut self) {
        self.phase = Phase::Paused;
        self.pending_steps = 0;
    }

    /// Whether the clock stays where it is until a request.
    pub(super) fn is_held(&self) -> bool {
        self.phase != Phase::Running && self.pending_steps == 0
    }

    /// Changes the speed from now on.
    pub(super) fn set_speed(&mut self, speed: Option<f64>) -> Result<(), String> {
        if speed.is_some_and(|speed| speed <= 0.0) {
            return Err("a speed is more than zero; to hold the clock, pause".to_owned());
        }

        self.speed = speed;
        self.due = Instant::now();
        Ok(())
    }

    /// Grants `n` ticks of a clock that is held.
    pub(super) fn step(&mut self, n: u64) -> Result<(), String> {
        if !matches!(self.phase, Phase::Ready | Phase::Paused) {
            return Err(format!("the run is {}; pause it to step", self.phase));
        }
        if n == 0 || n > MAX_STEPS {
            return Err(format!("a step is 1 to {MAX_STEPS} ticks"));
        }
        if self.pending_steps + n > MAX_STEPS {
            return Err("too many steps are pending already".to_owned());
        }

        self.phase = Phase::Paused;
        self.pending_steps += n;
        Ok(())
    }

    /// Whether the next tick is due as soon as one is complete, and no client waits for a step.
    pub(super) fn is_at_full_speed(&self) -> bool {
        self.phase == Phase::Running && self.speed.is_none() && self.stepping.is_none()
    }

    /// The client whose steps are done at this tick.
    pub(super) fn reached(&mut self, tick: Tick) -> Option<Query> {
        let stepping = self.stepping.take_if(|(_, until)| tick >= *until);
        stepping.map(|(query, _)| query)
    }

    /// The client that waits for steps, which is answered before they are done.
    pub(super) fn give_up_stepping(&mut self) -> Option<Query> {
        self.stepping.take().map(|(query, _)| query)
    }

    /// Takes one tick of what was granted. `Err` says how long to wait at most before looking again.
    pub(super) fn take_grant(&mut self, tick_s: f64) -> Result<(), Option<Duration>> {
        // Steps do not wait for their time: a person has asked for them.
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
        // A clock that is a little behind catches up, so that the mean speed is right. One that was
        // held does not race.
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
