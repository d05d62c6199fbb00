//! What is in progress before a tick of a recording: it follows from all events before, so it is kept for some ticks once it
//! has been read.

use std::sync::{Mutex, PoisonError};

use protocol::Tick;
use protocol::messages::{Fate, Flight};
use timeline::{CommandSpan, Timeline};

use crate::damage::RecordingError;
use crate::read::Recording;

/// Ticks from one timeline that is kept to the next.
const KEPT_TICKS: Tick = 512;
/// For how long before a tick the fates of commands are told: the page of the console shows them as long (`flights.js`).
const TOLD_S: f64 = 2.0;
/// Most ticks of it.
const MAX_TOLD_TICKS: u64 = 4096;

/// The timelines of a recording: before tick 0, before tick 512 and so on, as far as was needed.
#[derive(Debug)]
pub struct Timelines {
    kept: Mutex<Vec<Timeline>>,
}

impl Timelines {
    /// Those of a recording of which nothing has been read yet.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let first = Timeline::new(&recording.header().robots);
        Self {
            kept: Mutex::new(vec![first]),
        }
    }

    /// What is in progress before a tick of the recording.
    ///
    /// # Errors
    /// [`RecordingError`] if the recording cannot be read or is damaged.
    pub fn before(&self, recording: &Recording, tick: Tick) -> Result<Timeline, RecordingError> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = usize::try_from(tick / KEPT_TICKS).unwrap_or(usize::MAX);
        let index = wanted.min(kept.len() - 1);
        let mut timeline = kept[index].clone();

        recording.for_events(index as Tick * KEPT_TICKS, tick, |tick| {
            timeline.tick(tick.tick, &tick.events);
            if tick.tick + 1 == kept.len() as Tick * KEPT_TICKS {
                kept.push(timeline.clone());
            }
        })?;
        Ok(timeline)
    }

    /// What is in progress before a tick, and what observers know of commands then: those under way, and what became of others
    /// in the last two simulated seconds, in the order of ticks.
    ///
    /// # Errors
    /// [`RecordingError`] if the recording cannot be read or is damaged.
    pub fn with_flights(
        &self,
        recording: &Recording,
        tick: Tick,
    ) -> Result<(Timeline, Vec<Flight>), RecordingError> {
        let told_from = tick.saturating_sub(told_ticks(recording.header().tick_s));
        let mut timeline = self.before(recording, told_from)?;
        let mut flights: Vec<Flight> = timeline.commands().map(sending).collect();
        flights.sort_by_key(|flight| flight.tick);

        recording.for_events(told_from, tick, |recorded| {
            timeline.tick(recorded.tick, &recorded.events);
            let told = recorded.events.iter();
            flights.extend(told.filter_map(|event| event.flight(recorded.tick)));
        })?;
        Ok((timeline, flights))
    }
}

/// The ticks in [`TOLD_S`].
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest tick, at most MAX_TOLD_TICKS"
)]
fn told_ticks(tick_s: f64) -> Tick {
    let ticks = (TOLD_S / tick_s).ceil();
    (ticks as Tick).min(MAX_TOLD_TICKS)
}

/// A command under way, as the tick in which it was sent shows it.
fn sending(command: &CommandSpan) -> Flight {
    Flight {
        tick: command.sent,
        from: command.from.clone(),
        to: command.to.clone(),
        seq: command.seq,
        command: command.text.clone(),
        fate: Fate::Sent,
        because: None,
    }
}
