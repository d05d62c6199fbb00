//! Files with a line for each tick, or lines in the order of ticks. Only the offset of each tick is kept in memory.

use std::fs::File;
use std::io::{BufRead, BufReader, Error, Read};
use std::os::unix::fs::FileExt;
use std::path::Path;

use protocol::messages::RecordedTick;
use protocol::{Line, Tick};
use serde::de::DeserializeOwned;

/// Most bytes in one answer, as they are in the file; an answer has at least one tick.
const MAX_BYTES: u64 = 32 << 20;
/// Longest line, bytes: more than a hundred thousand guests.
const MAX_LINE_BYTES: u64 = 8 << 20;

/// Why a recording cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordingError {
    /// A file cannot be read.
    #[error(
        "cannot read {file}: {error}; --recording takes the folder of a run, which has a recording unless its scenario \
         sets `frames = false` under [record]"
    )]
    Unreadable {
        /// The file.
        file: String,
        /// The operating system's reason.
        error: Error,
    },
    /// A file has an unexpected content.
    #[error("{file}, {place}: {reason}")]
    Malformed {
        /// The file.
        file: String,
        /// Which line, from 1, or which ticks.
        place: String,
        /// What is wrong there.
        reason: String,
    },
}

/// A file and the offsets of its ticks.
#[derive(Debug)]
pub(crate) struct TickFile {
    file: File,
    name: String,
    /// Where the lines of each tick begin, and then where those of the last one end, bytes.
    starts: Vec<u64>,
}

impl TickFile {
    /// A file with one line for each tick, from tick 0 on; the header has been read.
    pub(crate) fn of_ticks(mut lines: LineReader) -> Result<Self, RecordingError> {
        let mut starts = vec![lines.offset];

        while let Some(line) = lines.read()? {
            let tick = lines.parse::<RecordedTick>(&line)?.tick;
            let expected = starts.len() as u64 - 1;
            if tick != expected {
                return Err(lines.malformed(format!("tick {tick} where tick {expected} should be")));
            }
            starts.push(lines.offset);
        }

        if starts.len() == 1 {
            return Err(lines.malformed("no tick was completed".to_owned()));
        }
        Ok(Self::new(lines, starts))
    }

    /// A file with any number of lines for each of `ticks` ticks, in their order.
    pub(crate) fn of_events(mut lines: LineReader, ticks: u64) -> Result<Self, RecordingError> {
        let mut starts = Vec::new();
        let mut end = 0;

        while let Some(line) = lines.read()? {
            let tick = lines.parse::<Line>(&line)?.tick;
            if starts.len() as u64 > tick + 1 {
                return Err(lines.malformed(format!("tick {tick} after a later one")));
            }
            // After a crash, the events may go on where the recording ends.
            if tick >= ticks {
                break;
            }

            while starts.len() as u64 <= tick {
                starts.push(end);
            }
            end = lines.offset;
        }

        while starts.len() as u64 <= ticks {
            starts.push(end);
        }
        Ok(Self::new(lines, starts))
    }

    fn new(lines: LineReader, starts: Vec<u64>) -> Self {
        Self {
            file: lines.file.into_inner(),
            name: lines.name,
            starts,
        }
    }

    /// Number of ticks.
    pub(crate) fn len(&self) -> u64 {
        self.starts.len() as u64 - 1
    }

    fn start(&self, tick: Tick) -> u64 {
        let last = self.starts.len() - 1;
        let index = usize::try_from(tick).map_or(last, |tick| tick.min(last));
        self.starts[index]
    }

    /// The end of a range from `from` on, at most `to`, that is small enough for one answer.
    pub(crate) fn fitting(&self, from: Tick, to: Tick) -> Tick {
        let to = to.min(self.len());
        let limit = self.start(from) + MAX_BYTES;

        let fitting = (from..to)
            .take_while(|tick| self.start(tick + 1) <= limit)
            .count() as u64;
        to.min(from + fitting.max(1))
    }

    /// The lines of the ticks from `from` up to and excluding `to`.
    pub(crate) fn read<T: DeserializeOwned>(
        &self,
        from: Tick,
        to: Tick,
    ) -> Result<Vec<T>, RecordingError> {
        let start = self.start(from);
        let len = self.start(to) - start;
        let mut bytes = vec![0; usize::try_from(len).unwrap_or(0)];
        self.file
            .read_exact_at(&mut bytes, start)
            .map_err(|error| unreadable(&self.name, error))?;

        bytes
            .split(|byte| *byte == b'\n')
            .filter(|line| !line.is_empty())
            .map(|line| {
                serde_json::from_slice(line).map_err(|error| self.changed(from, to, &error))
            })
            .collect()
    }

    fn changed(&self, from: Tick, to: Tick, error: &serde_json::Error) -> RecordingError {
        RecordingError::Malformed {
            file: self.name.clone(),
            place: format!("ticks {from} to {to}"),
            reason: format!("changed since it was opened: {error}"),
        }
    }
}

/// Reads a file line by line, up to a last line that a crash left unfinished.
pub(crate) struct LineReader {
    file: BufReader<File>,
    name: String,
    /// Number of the line that was read last, from 1.
    number: usize,
    /// Where the next line begins, bytes.
    offset: u64,
}

impl LineReader {
    pub(crate) fn open(path: &Path) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| unreadable(&name, error))?;

        Ok(Self {
            file: BufReader::new(file),
            name,
            number: 0,
            offset: 0,
        })
    }

    pub(crate) fn read_header<T: DeserializeOwned>(&mut self) -> Result<T, RecordingError> {
        let line = self.read()?;
        let line = line.ok_or_else(|| self.malformed("there is no header".to_owned()))?;
        self.parse(&line)
    }

    /// The next line; `None` at the end of the file.
    fn read(&mut self) -> Result<Option<Vec<u8>>, RecordingError> {
        let mut line = Vec::new();
        let len = self
            .file
            .by_ref()
            .take(MAX_LINE_BYTES + 1)
            .read_until(b'\n', &mut line)
            .map_err(|error| unreadable(&self.name, error))? as u64;

        self.number += 1;
        if len > MAX_LINE_BYTES {
            return Err(self.malformed(format!("longer than {MAX_LINE_BYTES} bytes")));
        }
        if line.last() != Some(&b'\n') {
            return Ok(None);
        }

        self.offset += len;
        Ok(Some(line))
    }

    /// Parses the line that was read last.
    fn parse<T: DeserializeOwned>(&self, line: &[u8]) -> Result<T, RecordingError> {
        serde_json::from_slice(line).map_err(|error| self.malformed(error.to_string()))
    }

    fn malformed(&self, reason: String) -> RecordingError {
        RecordingError::Malformed {
            file: self.name.clone(),
            place: format!("line {}", self.number),
            reason,
        }
    }
}

fn unreadable(file: &str, error: Error) -> RecordingError {
    RecordingError::Unreadable {
        file: file.to_owned(),
        error,
    }
}
