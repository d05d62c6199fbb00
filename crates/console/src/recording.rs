//! A run of the past, from the files it left. Kept in memory is where each tick begins in them, and no more.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use protocol::messages::{Fate, Flight, LogRecord, RecordedTick, RecordingHeader};
use protocol::{Event, Line, Tick};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Where everything was after every tick.
const RECORDING: &str = "recording.jsonl";
/// What happened.
const EVENTS: &str = "events.jsonl";
/// Most ticks of one answer.
pub(crate) const MAX_TICKS: u64 = 512;
/// Most bytes of one answer, as they are in the files; an answer has one tick at least.
const MAX_BYTES: u64 = 32 << 20;
/// Longest line: a hundred thousand guests and more.
const MAX_LINE_BYTES: u64 = 8 << 20;

/// Why a recording cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordingError {
    /// It is not there, or cannot be read.
    #[error(
        "cannot read {file}: {error}; --recording wants the folder of a run, which has a recording unless its scenario \
         says `frames = false` under [record]"
    )]
    Unreadable {
        /// Which file.
        file: String,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// It is not what it should be.
    #[error("{file}, {place}: {reason}")]
    Malformed {
        /// Which file.
        file: String,
        /// Which line, from 1, or which ticks.
        place: String,
        /// What is wrong there.
        reason: String,
    },
}

/// A run of the past.
#[derive(Debug)]
pub(crate) struct Recording {
    header: RecordingHeader,
    ticks: Ranges,
    events: Ranges,
}

/// The header with what only the whole file tells.
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
    /// Opens the recording in a run's folder, or the file of one: `RUN/recording-epoch1.jsonl` is that of an epoch
    /// which `init` ended.
    ///
    /// # Errors
    /// [`RecordingError`] names the file, and the line where there is one.
    pub(crate) fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = if path.is_dir() {
            path.join(RECORDING)
        } else {
            path.to_owned()
        };
        let events = events_beside(&file);
        let mut lines = Lines::open(&file)?;
        let first = lines
            .read()?
            .ok_or_else(|| lines.malformed("there is no header".to_owned()))?;
        let header = lines.parse(&first.text)?;
        let ticks = Ranges::of_ticks(lines, first.end)?;
        let events = Ranges::of_events(Lines::open(&events)?, ticks.len())?;
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

    /// What does not change during it.
    pub(crate) fn summary(&self) -> Summary<'_> {
        Summary {
            header: &self.header,
            ticks: self.ticks.len() - 1,
        }
    }

    /// What happened from tick `from` on in `count` ticks, or in as many as there are, or as fit into one answer.
    ///
    /// # Errors
    /// [`RecordingError`] if the files have changed since they were opened.
    pub(crate) fn range(&self, from: Tick, count: u64) -> Result<Range, RecordingError> {
        let from = from.min(self.ticks.len());
        let to = self
            .ticks
            .fitting(from, from.saturating_add(count.min(MAX_TICKS)));
        let mut range = Range {
            ticks: self.ticks.read(from, to)?,
            ..Range::default()
        };
        for line in self.events.read::<Line>(from, to)? {
            range.flights.extend(flight(&line));
            if let Some((source, kind, text)) = line.event.readable() {
                let (epoch, tick) = (self.header.epoch, line.tick);
                let time_s = tick as f64 * self.header.tick_s;
                range.log.push(LogRecord {
                    epoch,
                    tick,
                    time_s,
                    source,
                    kind,
                    text,
                });
            }
        }
        Ok(range)
    }
}

/// The events of a recording are beside it, under the same number.
fn events_beside(recording: &Path) -> PathBuf {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    recording.with_file_name(
        name.strip_prefix("recording")
            .map_or(EVENTS.to_owned(), |rest| format!("events{rest}")),
    )
}

/// What an event says of a command; `None` if it is about something else.
fn flight(line: &Line) -> Option<Flight> {
    let (from, to, seq, command, fate) = match &line.event {
        Event::CommandSent {
            from,
            to,
            seq,
            command,
            ..
        } => (from, to, *seq, command.as_str(), Fate::Sent),
        Event::CommandDelivered { from, to, seq, .. } => (from, to, *seq, "", Fate::Delivered),
        Event::CommandDropped { from, to, seq, .. } => (from, to, *seq, "", Fate::Dropped),
        Event::CommandMissing { from, to, seq, .. } => (from, to, *seq, "", Fate::Missing),
        _ => return None,
    };
    Some(Flight {
        tick: line.tick,
        from: from.clone(),
        to: to.clone(),
        seq,
        command: command.to_owned(),
        fate,
    })
}

/// A file of lines, and where in it what belongs to each tick begins.
#[derive(Debug)]
struct Ranges {
    file: File,
    name: String,
    /// Where the lines of each tick begin, and at last where those of the last one end, bytes.
    starts: Vec<u64>,
}

impl Ranges {
    /// One line for each tick, from tick 0 on.
    fn of_ticks(mut lines: Lines, begin: u64) -> Result<Self, RecordingError> {
        let mut starts = vec![begin];
        while let Some(line) = lines.read()? {
            let (tick, expected) = (
                lines.parse::<RecordedTick>(&line.text)?.tick,
                starts.len() as u64 - 1,
            );
            if tick != expected {
                return Err(lines.malformed(format!("tick {tick} where tick {expected} should be")));
            }
            starts.push(line.end);
        }
        if starts.len() == 1 {
            return Err(lines.malformed("no tick was completed".to_owned()));
        }
        Ok(Self {
            file: lines.file.into_inner(),
            name: lines.name,
            starts,
        })
    }

    /// Any number of lines for each of `ticks` ticks, in their order.
    fn of_events(mut lines: Lines, ticks: u64) -> Result<Self, RecordingError> {
        let (mut starts, mut end) = (Vec::new(), 0);
        while let Some(line) = lines.read()? {
            let tick = lines.parse::<Line>(&line.text)?.tick;
            if starts.len() as u64 > tick + 1 {
                return Err(lines.malformed(format!("tick {tick} after a later one")));
            }
            if tick >= ticks {
                break; // The recording ends before the events do.
            }
            while starts.len() as u64 <= tick {
                starts.push(end);
            }
            end = line.end;
        }
        while starts.len() as u64 <= ticks {
            starts.push(end);
        }
        Ok(Self {
            file: lines.file.into_inner(),
            name: lines.name,
            starts,
        })
    }

    /// Number of ticks.
    fn len(&self) -> u64 {
        self.starts.len() as u64 - 1
    }

    fn start(&self, tick: Tick) -> u64 {
        let last = self.starts.len() - 1;
        self.starts[usize::try_from(tick).map_or(last, |tick| tick.min(last))]
    }

    /// The end of a range that begins at `from`, at `to` at most, so that it is not too much for one answer.
    fn fitting(&self, from: Tick, to: Tick) -> Tick {
        let (to, limit) = (to.min(self.len()), self.start(from) + MAX_BYTES);
        let fitting = (from..to)
            .take_while(|tick| self.start(tick + 1) <= limit)
            .count() as u64;
        to.min(from + fitting.max(1))
    }

    /// The lines from tick `from` on, up to tick `to`, that one not included.
    fn read<T: DeserializeOwned>(&self, from: Tick, to: Tick) -> Result<Vec<T>, RecordingError> {
        let (start, end) = (self.start(from), self.start(to));
        let mut bytes = vec![0; usize::try_from(end - start).unwrap_or(0)];
        let read = self.file.read_exact_at(&mut bytes, start);
        read.map_err(|error| RecordingError::Unreadable {
            file: self.name.clone(),
            error,
        })?;
        let lines = bytes
            .split(|byte| *byte == b'\n')
            .filter(|line| !line.is_empty());
        let parse = |line| {
            serde_json::from_slice(line).map_err(|error| RecordingError::Malformed {
                file: self.name.clone(),
                place: format!("ticks {from} to {to}"),
                reason: format!("changed since it was opened: {error}"),
            })
        };
        lines.map(parse).collect()
    }
}

/// The lines of a file, each of bounded length. A last one that was not finished, as a crash leaves it, is not there.
struct Lines {
    file: BufReader<File>,
    name: String,
    /// Lines read so far.
    count: usize,
    /// Where the next one begins, bytes.
    at: u64,
}

/// A line.
struct TextLine {
    text: Vec<u8>,
    /// Where the next one begins, bytes.
    end: u64,
}

impl Lines {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        match File::open(path) {
            Ok(file) => Ok(Self {
                file: BufReader::new(file),
                name,
                count: 0,
                at: 0,
            }),
            Err(error) => Err(RecordingError::Unreadable { file: name, error }),
        }
    }

    fn read(&mut self) -> Result<Option<TextLine>, RecordingError> {
        let mut text = Vec::new();
        let read = self
            .file
            .by_ref()
            .take(MAX_LINE_BYTES + 1)
            .read_until(b'\n', &mut text);
        let read = read.map_err(|error| RecordingError::Unreadable {
            file: self.name.clone(),
            error,
        })? as u64;
        self.count += 1;
        if read > MAX_LINE_BYTES {
            return Err(self.malformed(format!("longer than {MAX_LINE_BYTES} bytes")));
        }
        if text.last() != Some(&b'\n') {
            return Ok(None);
        }
        self.at += read;
        Ok(Some(TextLine { text, end: self.at }))
    }

    /// What the line just read says.
    fn parse<T: DeserializeOwned>(&self, text: &[u8]) -> Result<T, RecordingError> {
        serde_json::from_slice(text).map_err(|error| self.malformed(error.to_string()))
    }

    fn malformed(&self, reason: String) -> RecordingError {
        RecordingError::Malformed {
            file: self.name.clone(),
            place: format!("line {}", self.count),
            reason,
        }
    }
}
