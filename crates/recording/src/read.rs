//! Reads a recording.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::path::Path;

use protocol::{Event, Line, RobotName, Tick};
use serde::de::DeserializeOwned;

use crate::METADATA;
use crate::content::{self, Frame, Header, Json, RawTick, RecordedTick, TickEvents, WallTimes};
use crate::damage::{Name, RecordingError};
use crate::format::{Fields, op};
use crate::index::{Bytes, ChunkLocation, indexed_topic};
use crate::topic::Topic;

/// Ticks that are read from the file in one go.
pub(crate) const AT_ONCE: Tick = 64;

/// The recording of an epoch. Only where its parts are is kept in memory.
#[derive(Debug)]
pub struct Recording {
    bytes: Bytes,
    header: Header,
    topics: BTreeMap<u16, Option<Topic>>,
    /// The chunks with ticks, in their order.
    chunks: Vec<TickChunk>,
    scenario: Option<u64>,
    metadata: Vec<u64>,
    is_finished: bool,
    /// Where a file that is not finished goes on.
    end: u64,
}

/// A chunk and its first and last tick.
#[derive(Debug)]
struct TickChunk {
    chunk: ChunkLocation,
    first: Tick,
    last: Tick,
}

/// A message of a chunk.
struct ChunkMessage<'a> {
    channel: u16,
    time_ns: u64,
    json: &'a [u8],
}

/// A tick of which not everything has been read yet.
#[derive(Default)]
struct Partial {
    frame: Option<Frame>,
    wall: Option<WallTimes>,
    events: Vec<Event>,
    reports: BTreeMap<RobotName, Json>,
    panels: BTreeMap<RobotName, Json>,
}

impl Recording {
    /// Opens a recording. One that was cut off, by a crash of the simulator, has the ticks of its complete chunks.
    ///
    /// # Errors
    /// [`RecordingError`] if the file cannot be read, is not a recording, or is damaged.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let name = Name::of(path);
        let file = File::open(path).map_err(|error| name.unreadable(error))?;
        let bytes = Bytes::new(name, file)?;
        let index = bytes.index()?;

        let mut chunks = index.chunks;
        let first = chunks.first().ok_or_else(|| bytes.name.headless())?;
        // Of a file that another program has written anew, the index has channels that the first chunk does not have.
        let topics = index.topics.into_iter().collect();
        let preamble = read_preamble(&bytes, first, topics)?;
        // The writer puts the channels into a chunk of their own, which has no tick.
        if !preamble.has_ticks {
            chunks.remove(0);
        }

        let mut recording = Self {
            bytes,
            header: preamble.header,
            topics: preamble.topics,
            chunks: Vec::new(),
            scenario: index.scenario,
            metadata: index.metadata,
            is_finished: index.is_finished,
            end: index.end,
        };
        recording.add_chunks(chunks)?;
        Ok(recording)
    }

    /// Adds the ticks that have become complete since, where the run is in progress.
    ///
    /// # Errors
    /// [`RecordingError`] if the file cannot be read or is damaged. The ticks before stay.
    pub fn grow(&mut self) -> Result<(), RecordingError> {
        if self.is_finished {
            return Ok(());
        }

        let grown = self.bytes.grown(self.end)?;
        self.add_chunks(grown.chunks)?;
        // Only after the chunks were added: where one is damaged, the next call finds it again.
        self.end = grown.end;
        self.is_finished = grown.is_finished;
        Ok(())
    }

    /// Whether the recording is the file at this path: a later epoch or another run may have taken its name.
    #[must_use]
    pub fn is_at(&self, path: &Path) -> bool {
        self.bytes.is_at(path)
    }

    /// What does not change during the epoch.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Whether the file was finished; otherwise the simulator was killed, or the run is in progress.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.is_finished
    }

    /// Number of complete ticks. The first one is tick 0.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.chunks
            .last()
            .map_or(0, |chunk| chunk.last.saturating_add(1))
    }

    /// Whether no tick is complete.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.chunks.is_empty()
    }

    /// The scenario of the epoch, as a file.
    ///
    /// # Errors
    /// [`RecordingError`] if it cannot be read or is damaged.
    pub fn scenario(&self) -> Result<String, RecordingError> {
        let offset = self.scenario.ok_or_else(|| self.bytes.name.headless())?;
        let text = self.bytes.attachment(offset)?;
        String::from_utf8(text).map_err(|error| self.bytes.name.damaged(offset, &error))
    }

    /// Checks what no tick depends on: that the metadata is that of the header, and, of a finished file, that every byte outside
    /// the chunks is as it was written.
    ///
    /// # Errors
    /// [`RecordingError`] if the file cannot be read or is damaged.
    pub fn check(&self) -> Result<(), RecordingError> {
        for offset in &self.metadata {
            let (name, metadata) = self.bytes.metadata(*offset)?;
            if name == METADATA && metadata != content::metadata(&self.header) {
                let reason = "the metadata is not that of the header";
                return Err(self.bytes.name.damaged(*offset, &reason));
            }
        }

        self.bytes.check()
    }

    /// Reads the ticks from `from` up to and excluding `to`; fewer if the recording ends before.
    ///
    /// # Errors
    /// [`RecordingError`] if they cannot be read or are damaged.
    pub fn read(&self, from: Tick, to: Tick) -> Result<Vec<RecordedTick>, RecordingError> {
        let mut ticks = Vec::new();
        for (tick, chunk) in self.read_parts(from, to)? {
            let tick = tick.decode().map_err(|error| self.damaged(chunk, &error))?;
            ticks.push(tick);
        }
        Ok(ticks)
    }

    /// Reads ticks as [`Self::read`] does, and decodes neither reports nor panels.
    ///
    /// # Errors
    /// [`RecordingError`] if they cannot be read or are damaged.
    pub fn read_raw(&self, from: Tick, to: Tick) -> Result<Vec<RawTick>, RecordingError> {
        let mut ticks = Vec::new();
        for (tick, chunk) in self.read_parts(from, to)? {
            for message in tick.reports.values().chain(tick.panels.values()) {
                message
                    .check()
                    .map_err(|error| self.damaged(chunk, &error))?;
            }
            ticks.push(tick);
        }
        Ok(ticks)
    }

    /// Reads ticks, each with its last chunk.
    fn read_parts(
        &self,
        from: Tick,
        to: Tick,
    ) -> Result<Vec<(RawTick, &TickChunk)>, RecordingError> {
        let to = to.min(self.len());
        let mut ticks = Vec::new();
        let mut next = from;
        let mut partial: BTreeMap<Tick, Partial> = BTreeMap::new();

        for chunk in self.chunks_of(from, to) {
            self.read_chunk(chunk, from, to, |_| true, &mut partial)?;
            // A further chunk may go on with the last tick of this one.
            let complete = partial.split_off(&chunk.last);
            for (tick, parts) in std::mem::replace(&mut partial, complete) {
                ticks.push((self.whole(tick, next, parts, chunk)?, chunk));
                next += 1;
            }
        }
        if let Some(last) = self.chunks_of(from, to).last() {
            for (tick, parts) in partial {
                ticks.push((self.whole(tick, next, parts, last)?, last));
                next += 1;
            }
        }

        if next < to {
            return Err(self.bytes.name.no_such_tick(next, self.len()));
        }
        Ok(ticks)
    }

    /// Calls `each` with what happened in the ticks from `from` up to and excluding `to`, without frames, reports and panels, which are most
    /// of a recording; fewer ticks if the recording ends before.
    ///
    /// # Errors
    /// [`RecordingError`] if it cannot be read or is damaged.
    pub fn for_events(
        &self,
        from: Tick,
        to: Tick,
        mut each: impl FnMut(TickEvents),
    ) -> Result<(), RecordingError> {
        let to = to.min(self.len());
        let mut next = from;
        while next < to {
            // Piece by piece: a range may be the whole run, and what was read of it need not be in
            // memory at once.
            let end = to.min(next + AT_ONCE);
            self.events(next, end)?.into_iter().for_each(&mut each);
            next = end;
        }

        Ok(())
    }

    fn events(&self, from: Tick, to: Tick) -> Result<Vec<TickEvents>, RecordingError> {
        let mut partial: BTreeMap<Tick, Partial> = BTreeMap::new();
        for chunk in self.chunks_of(from, to) {
            self.read_chunk(chunk, from, to, Topic::is_of_events, &mut partial)?;
        }

        let mut ticks = Vec::new();
        for (tick, parts) in partial {
            ticks.push(TickEvents {
                tick,
                events: parts.events,
                awaited: parts.wall.unwrap_or_default().awaited,
            });
        }
        Ok(ticks)
    }

    /// The end of a range from `from` on, at most `to`, of which about `max_bytes` have to be read; at least one chunk.
    #[must_use]
    pub fn fitting(&self, from: Tick, to: Tick, max_bytes: u64) -> Tick {
        let mut bytes: u64 = 0;
        let mut end = from;
        for chunk in self.chunks_of(from, to) {
            bytes = bytes.saturating_add(chunk.chunk.size);
            // At least one chunk, however large: otherwise a caller would make no progress.
            if bytes > max_bytes && end > from {
                return end;
            }
            end = chunk.last.saturating_add(1);
        }
        end.min(to)
    }

    fn chunks_of(&self, from: Tick, to: Tick) -> &[TickChunk] {
        // Chunks are in the order of ticks, and none is left out: `add_chunks` has checked that.
        let begin = self.chunks.partition_point(|chunk| chunk.last < from);
        let end = self.chunks.partition_point(|chunk| chunk.first < to);
        self.chunks.get(begin..end).unwrap_or_default()
    }

    /// Adds what a chunk has of a range of ticks, on the topics that are wanted.
    fn read_chunk(
        &self,
        chunk: &TickChunk,
        from: Tick,
        to: Tick,
        is_wanted: fn(&Topic) -> bool,
        ticks: &mut BTreeMap<Tick, Partial>,
    ) -> Result<(), RecordingError> {
        let content = self.bytes.chunk(&chunk.chunk)?;
        let messages =
            messages(&content).ok_or_else(|| self.damaged(chunk, &"a length is wrong"))?;

        for message in messages {
            let tick = self.header.tick_at(message.time_ns);
            // The times of a chunk are in its header, which has no checksum, and decide which chunks
            // are read.
            if !(chunk.first..=chunk.last).contains(&tick) {
                return Err(self.damaged(chunk, &"a message of another tick"));
            }
            if !(from..to).contains(&tick) {
                continue;
            }
            // Without its topic a message would be missing, and nothing would show it.
            let topic = self.topics.get(&message.channel).ok_or_else(|| {
                let channel = message.channel;
                self.damaged(
                    chunk,
                    &format!("a message on channel {channel}, which is not declared"),
                )
            })?;
            if let Some(topic) = topic
                && is_wanted(topic)
            {
                let partial = ticks.entry(tick).or_default();
                partial
                    .add(topic, message.json)
                    .map_err(|error| self.damaged(chunk, &error))?;
            }
        }
        Ok(())
    }

    /// A tick of which everything has been read.
    fn whole(
        &self,
        tick: Tick,
        expected: Tick,
        parts: Partial,
        chunk: &TickChunk,
    ) -> Result<RawTick, RecordingError> {
        let is_expected = tick == expected;
        let frame = parts
            .frame
            .filter(|frame| is_expected && frame.tick == tick);
        let frame =
            frame.ok_or_else(|| self.damaged(chunk, &format!("tick {expected} is missing")))?;

        Ok(RawTick {
            frame,
            events: parts.events,
            reports: parts.reports,
            panels: parts.panels,
            wall: parts.wall.unwrap_or_default(),
        })
    }

    /// The report of a robot for a tick, not decoded; `None` if it has none.
    ///
    /// # Errors
    /// [`RecordingError`] if it cannot be read or is damaged.
    pub fn report(&self, robot: &RobotName, tick: Tick) -> Result<Option<Json>, RecordingError> {
        let mut ticks = self.read_raw(tick, tick.saturating_add(1))?;
        Ok(ticks.pop().and_then(|mut tick| tick.reports.remove(robot)))
    }

    /// Adds chunks with their ticks, of which none may be left out. A chunk may go on with the last tick of the one before: so
    /// does the end of a run, and other programs that write the file anew end a chunk anywhere.
    fn add_chunks(
        &mut self,
        chunks: impl IntoIterator<Item = ChunkLocation>,
    ) -> Result<(), RecordingError> {
        for chunk in chunks {
            let first = self.header.tick_at(chunk.start_ns);
            let last = self.header.tick_at(chunk.end_ns);

            let before = self.chunks.last().map(|chunk| chunk.last);
            let due = before.map_or(0, |tick| tick.saturating_add(1));
            let goes_on = before == Some(first);
            if last < first || (first != due && !goes_on) {
                let reason = format!("ticks {first} to {last} where tick {due} is due");
                return Err(self.bytes.name.damaged(chunk.offset, &reason));
            }

            self.chunks.push(TickChunk { chunk, first, last });
        }

        Ok(())
    }

    fn damaged(&self, chunk: &TickChunk, reason: &dyn Display) -> RecordingError {
        self.bytes.name.damaged(chunk.chunk.offset, reason)
    }
}

impl Partial {
    fn add(&mut self, topic: &Topic, json: &[u8]) -> Result<(), serde_json::Error> {
        match topic {
            Topic::Header => {}
            Topic::Frame => self.frame = Some(parse(json)?),
            Topic::Wall => self.wall = Some(parse(json)?),
            Topic::Events => self.events.push(Line::from_json(json)?.event),
            // Decoded only for callers that want it: reports and panels are most of a recording.
            Topic::Report(robot) => {
                self.reports.insert(robot.clone(), Json::unchecked(json));
            }
            Topic::Panel(robot) => {
                self.panels.insert(robot.clone(), Json::unchecked(json));
            }
        }

        Ok(())
    }
}

/// What the first chunk has.
struct Preamble {
    header: Header,
    topics: BTreeMap<u16, Option<Topic>>,
    /// Whether the first ticks are in it, too: where another program has written the file anew.
    has_ticks: bool,
}

/// Reads the header, and adds the channels that are in the first chunk to those of the index.
fn read_preamble(
    bytes: &Bytes,
    chunk: &ChunkLocation,
    mut topics: BTreeMap<u16, Option<Topic>>,
) -> Result<Preamble, RecordingError> {
    let damaged = |reason: &dyn Display| bytes.name.damaged(chunk.offset, reason);

    let content = bytes.chunk(chunk)?;
    for (_, body) in records(&content)
        .ok_or_else(|| damaged(&"a length is wrong"))?
        .into_iter()
        .filter(|(op, _)| *op == op::CHANNEL)
    {
        let channel = indexed_topic(&mut Fields(body));
        let (id, topic) = channel.ok_or_else(|| damaged(&"a channel cannot be read"))?;
        topics.insert(id, topic);
    }

    let mut header: Option<Header> = None;
    let mut has_ticks = false;
    for message in messages(&content).unwrap_or_default() {
        match topics.get(&message.channel) {
            Some(Some(Topic::Header)) => {
                header = Some(parse(message.json).map_err(|error| damaged(&error))?);
            }
            Some(Some(_)) => has_ticks = true,
            Some(None) | None => {}
        }
    }

    let header = header.ok_or_else(|| bytes.name.headless())?;
    if !(header.tick_s.is_finite() && header.tick_s > 0.0) {
        return Err(damaged(&format!("a tick cannot last {} s", header.tick_s)));
    }
    Ok(Preamble {
        header,
        topics,
        has_ticks,
    })
}

/// The records of a chunk, each with its operation code; `None` if a length is wrong.
fn records(content: &[u8]) -> Option<Vec<(u8, &[u8])>> {
    let mut records = Vec::new();
    let mut content = Fields(content);
    while !content.0.is_empty() {
        records.push(content.record()?);
    }
    Some(records)
}

/// The messages of a chunk; `None` if a length is wrong.
fn messages(content: &[u8]) -> Option<Vec<ChunkMessage<'_>>> {
    let mut messages = Vec::new();
    for (op, body) in records(content)? {
        if op != op::MESSAGE {
            continue;
        }

        let mut fields = Fields(body);
        let channel = fields.u16()?;
        let _sequence = fields.u32()?;
        let time_ns = fields.u64()?;
        let _publish_time_ns = fields.u64()?;
        messages.push(ChunkMessage {
            channel,
            time_ns,
            json: fields.0,
        });
    }
    Some(messages)
}

fn parse<T: DeserializeOwned>(json: &[u8]) -> Result<T, serde_json::Error> {
    serde_json::from_slice(json)
}
