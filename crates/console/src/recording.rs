//! A recorded run, read from the files in its folder.

use std::path::{Path, PathBuf};

use protocol::messages::{Fate, Flight, LogRecord, RecordedTick, RecordingHeader};
use protocol::{Event, Line, Tick};
use serde::Serialize;

use crate::tick_file::{LineReader, RecordingError, TickFile};

/// The state after every tick.
const RECORDING_FILE: &str = "recording.jsonl";
/// The events of every tick.
const EVENTS_FILE: &str = "events.jsonl";
/// Most ticks in one answer.
pub(crate) const MAX_TICKS: u64 = 512;

/// A recorded run.
#[derive(Debug)]
pub(crate) struct Recording {
    header: RecordingHeader,
    ticks: TickFile,
    events: TickFile,
}

/// The header of a recording, and its length.
#[derive(Debug, Serialize)]
pub(crate) struct Summary<'a> {
    #[serde(flatten)]
    header: &'a RecordingHeader,
    /// The last tick.
    ticks: Tick,
}

/// What happened in a range of ticks.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Range {
    ticks: Vec<RecordedTick>,
    flights: Vec<Flight>,
    log: Vec<LogRecord>,
}

impl Recording {
    /// Opens the recording in a run's folder, or a recording file: `RUN/recording-epoch1.jsonl` is the recording of an
    /// epoch that `init` ended.
    ///
    /// # Errors
    /// [`RecordingError`] names the file, and the line if one is malformed.
    pub(crate) fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = if path.is_dir() {
            path.join(RECORDING_FILE)
        } else {
            path.to_owned()
        };

        let mut lines = LineReader::open(&file)?;
        let header = lines.read_header()?;
        let ticks = TickFile::of_ticks(lines)?;

        let events = LineReader::open(&events_beside(&file))?;
        let events = TickFile::of_events(events, ticks.len())?;

        Ok(Self {
            header,
            ticks,
            events,
        })
    }

    /// Name of the run.
    pub(crate) fn run(&self) -> &str {
        self.header.run.as_str()
    }

    /// What holds for the whole recording.
    pub(crate) fn summary(&self) -> Summary<'_> {
        Summary {
            header: &self.header,
            ticks: self.ticks.len() - 1,
        }
    }

    /// What happened in `count` ticks from tick `from` on; fewer if the recording ends before, or if they are too much
    /// for one answer.
    ///
    /// # Errors
    /// [`RecordingError`] if the files have changed since they were opened.
    pub(crate) fn range(&self, from: Tick, count: u64) -> Result<Range, RecordingError> {
        let from = from.min(self.ticks.len());
        let wanted = from.saturating_add(count.min(MAX_TICKS));
        let to = self.ticks.fitting(from, wanted);

        let mut range = Range {
            ticks: self.ticks.read(from, to)?,
            ..Range::default()
        };
        for line in self.events.read::<Line>(from, to)? {
            range.flights.extend(flight(&line));
            range.log.extend(self.log_record(&line));
        }
        Ok(range)
    }

    /// The line of the log about an event; `None` if the log omits such events.
    fn log_record(&self, line: &Line) -> Option<LogRecord> {
        let (source, kind, text) = line.event.readable()?;

        Some(LogRecord {
            epoch: self.header.epoch,
            tick: line.tick,
            time_s: line.tick as f64 * self.header.tick_s,
            source,
            kind,
            text,
        })
    }
}

/// The events of a recording are in the same folder, with the same suffix.
fn events_beside(recording: &Path) -> PathBuf {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();

    match name.strip_prefix("recording") {
        Some(suffix) => recording.with_file_name(format!("events{suffix}")),
        None => recording.with_file_name(EVENTS_FILE),
    }
}

/// The fate of a command that an event states; `None` for other events.
fn flight(line: &Line) -> Option<Flight> {
    let (from, to, seq, fate) = match &line.event {
        Event::CommandSent { from, to, seq, .. } => (from, to, seq, Fate::Sent),
        Event::CommandDelivered { from, to, seq, .. } => (from, to, seq, Fate::Delivered),
        Event::CommandDropped { from, to, seq, .. } => (from, to, seq, Fate::Dropped),
        _ => return None,
    };

    Some(Flight {
        tick: line.tick,
        from: from.clone(),
        to: to.clone(),
        seq: *seq,
        command: command_text(&line.event),
        fate,
    })
}

/// The text of a command, which only the event of its sending has.
fn command_text(event: &Event) -> String {
    match event {
        Event::CommandSent { command, .. } => command.clone(),
        _ => String::new(),
    }
}
