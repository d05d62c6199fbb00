//! Draws the space-time diagram of a recorded epoch: its events, and from its recording, if there is one, for whom the clock was
//! held.

use std::collections::BTreeMap;

use pictures::diagram::Diagram;
use protocol::messages::Awaited;
use protocol::{Event, Tick};
use record::EpochFiles;
use record::{Entry, Record};
use recording::{Recording, RecordingError};
use timeline::Timeline;

pub use pictures::diagram::DiagramOptions;

use lab::LabError;
use lab::moment::Moment;

/// The part of a run that is drawn, both ends included.
#[derive(Debug, Clone, Copy, Default)]
pub struct Window {
    /// The first moment; without it, the beginning of the run.
    pub from: Option<Moment>,
    /// The last moment; without it, the end of the run.
    pub to: Option<Moment>,
}

/// A diagram, with notes for people about what it lacks, a sentence each.
#[derive(Debug)]
pub struct Drawn {
    /// The picture.
    pub svg: String,
    /// What it lacks.
    pub notes: Vec<String>,
}

/// Draws an epoch. The seed follows the title that the options have.
///
/// # Errors
/// If its events cannot be read, it has no tick in the window, or the window has too much for a diagram.
pub fn draw(
    files: &EpochFiles,
    window: Window,
    options: DiagramOptions,
) -> Result<Drawn, LabError> {
    let (diagram, notes) = read(files, window, options)?;
    let svg = diagram.to_svg().map_err(|error| {
        LabError::refused(error).with_help("draw a part of the run with --from and --to")
    })?;
    Ok(Drawn { svg, notes })
}

/// Reads the diagram of an epoch, as [`draw`], with notes about what it lacks.
pub(crate) fn read(
    files: &EpochFiles,
    window: Window,
    mut options: DiagramOptions,
) -> Result<(Diagram, Vec<String>), LabError> {
    let events = files.events.display();
    let mut record = Record::of_events(&files.events)?;
    let mut next = record.next_entry()?;
    let Some((seed, tick_s)) = next.as_ref().and_then(beginning) else {
        return Err(LabError::record(format!("{events} has no complete tick")));
    };
    options.title += &format!(", seed {seed}");
    let from = window.from.map_or(0, |moment| moment.tick(tick_s));
    let to = window.to.map_or(Tick::MAX, |moment| moment.tick(tick_s));
    if from > to {
        return Err(LabError::refused(format!(
            "the window is empty: tick {from} comes after tick {to}"
        )));
    }

    let mut timeline = Timeline::default();
    while let Some(entry) = next.take_if(|entry| entry.tick < from) {
        timeline.tick(entry.tick, &entry.events);
        next = record.next_entry()?;
        if next.is_none() {
            let last = entry.tick;
            return Err(LabError::refused(format!(
                "the window begins with tick {from}, and {events} ends with tick {last}"
            )));
        }
    }

    let mut notes = Vec::new();
    let held_up = HeldTicks::read(files, from, to).unwrap_or_else(|error| {
        notes.push(format!("{error}: ticks that were held up are not marked"));
        HeldTicks::default()
    });
    let mut diagram = Diagram::new(timeline, tick_s, from, options);
    let mut has_end = false;
    let mut last = from;
    while let Some(entry) = next.take_if(|entry| entry.tick <= to) {
        last = entry.tick;
        has_end = entry.is_end();
        // The end of a run is another entry of its last tick.
        let awaited = held_up.awaited.get(&entry.tick).filter(|_| !has_end);
        let awaited = awaited.map_or(&[][..], Vec::as_slice);
        diagram.tick(entry.tick, &entry.events, awaited);
        next = record.next_entry()?;
    }
    if next.is_none() && !has_end {
        notes.push(format!(
            "{events} has no end: the simulator was killed, or the run is in progress"
        ));
    }

    if let Some(end) = held_up.end.filter(|end| *end <= last) {
        notes.push(format!(
            "{} ends before tick {end}: from there on it is not known which ticks were held up, and none is marked",
            files.recording.display()
        ));
    }

    Ok((diagram, notes))
}

/// Seed and length of a tick, simulated seconds, which the first event has.
fn beginning(entry: &Entry) -> Option<(u64, f64)> {
    entry.events.iter().find_map(|event| match event {
        Event::Init { seed, tick_s, .. } if tick_s.is_finite() && *tick_s > 0.0 => {
            Some((*seed, *tick_s))
        }
        _ => None,
    })
}

/// For whom the clock was held, as far as the epoch was recorded.
#[derive(Default)]
struct HeldTicks {
    /// By tick.
    awaited: BTreeMap<Tick, Vec<Awaited>>,
    /// The first tick that the recording does not have; `None` without a recording.
    end: Option<Tick>,
}

impl HeldTicks {
    fn read(files: &EpochFiles, from: Tick, to: Tick) -> Result<Self, RecordingError> {
        let mut held_up = Self::default();
        if !files.recording.exists() {
            return Ok(held_up);
        }

        let recording = Recording::open(&files.recording)?;
        held_up.end = Some(recording.len());
        recording.for_events(from, to.saturating_add(1), |tick| {
            if !tick.awaited.is_empty() {
                held_up.awaited.insert(tick.tick, tick.awaited);
            }
        })?;
        Ok(held_up)
    }
}
