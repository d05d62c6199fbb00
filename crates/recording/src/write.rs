//! Writes a recording.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions};
use protocol::messages::{Panel, Report};
use protocol::{Event, Line, Tick};
use schemars::{JsonSchema, schema_for};
use serde::Serialize;

use crate::content::{Frame, Header, RecordedTick, Wall};
use crate::protobuf::Protobuf;
use crate::topic::{Topic, View};
use crate::viewers::{self, Schema};
use crate::{METADATA, SCENARIO};

/// A chunk ends with the tick in which it gets this large, bytes before compression.
const CHUNK_BYTES: usize = 1 << 20;
/// A chunk ends with the first tick that is complete this long after the chunk began: what a crash can lose of a slow run.
pub(crate) const CHUNK_INTERVAL: Duration = Duration::from_secs(1);
/// Simulated time between two pictures for viewers, seconds.
const VIEW_INTERVAL_S: f64 = 0.1;
/// Level of compression: higher ones cost more time than they save bytes.
const COMPRESSION_LEVEL: u32 = 1;

/// A recording cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {error}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub error: String,
}

/// Writes the recording of an epoch. A writer that is dropped finishes its file, without reporting errors.
pub struct Writer {
    path: PathBuf,
    file: mcap::Writer<BufWriter<File>>,
    /// The same file, to synchronize it, also after it has been renamed.
    disk: File,
    header: Header,
    channels: BTreeMap<Topic, u16>,
    views: BTreeMap<View, u16>,
    /// Ticks between two pictures for viewers.
    view_interval: Tick,
    /// A message, encoded; kept for its memory.
    message: Vec<u8>,
    /// Bytes in the chunk so far, before compression.
    chunk_bytes: usize,
    chunk_begun: Instant,
}

impl Writer {
    /// Creates a recording. `scenario` is the complete scenario file of the epoch.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn create(path: &Path, header: &Header, scenario: &str) -> Result<Self, WriteError> {
        let disk = File::create(path).map_err(|error| failed(path, &error.into()))?;
        let file = disk
            .try_clone()
            .map_err(McapError::from)
            .and_then(|file| options().create(BufWriter::new(file)))
            .map_err(|error| failed(path, &error))?;

        let mut writer = Self {
            path: path.to_owned(),
            file,
            disk,
            header: header.clone(),
            channels: BTreeMap::new(),
            views: BTreeMap::new(),
            view_interval: (VIEW_INTERVAL_S / header.tick_s).round().max(1.0) as Tick,
            message: Vec::new(),
            chunk_bytes: 0,
            chunk_begun: Instant::now(),
        };
        writer
            .begin(scenario)
            .map_err(|error| failed(path, &error))?;
        Ok(writer)
    }

    /// Writes what does not change: attachment, metadata, and all channels with the header in a chunk of their own.
    fn begin(&mut self, scenario: &str) -> Result<(), McapError> {
        self.file.write_metadata(&metadata(&self.header))?;
        self.file.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: SCENARIO.to_owned(),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(scenario.as_bytes()),
        })?;

        self.add_channel::<Header>(Topic::Header, "cars.Header")?;
        self.add_channel::<Frame>(Topic::Frame, "cars.Frame")?;
        self.add_channel::<Line>(Topic::Events, "cars.Event")?;
        self.add_channel::<Wall>(Topic::Wall, "cars.Wall")?;
        for robot in self.header.robots.clone() {
            self.add_channel::<Report>(Topic::Report(robot.clone()), "cars.Report")?;
            self.add_channel::<Panel>(Topic::Panel(robot.clone()), "cars.Panel")?;
            self.add_view(View::Pose(robot), Schema::PoseInFrame)?;
        }
        self.add_view(View::Field, Schema::SceneUpdate)?;
        self.add_view(View::Robots, Schema::SceneUpdate)?;
        self.add_view(View::Guests, Schema::PointCloud)?;
        self.add_view(View::Transforms, Schema::FrameTransforms)?;
        self.add_view(View::Log, Schema::Log)?;

        let header = self.header.clone();
        self.add(&Topic::Header, 0, &header)?;
        self.end_chunk()
    }

    fn add_channel<M: JsonSchema>(&mut self, topic: Topic, schema: &str) -> Result<(), McapError> {
        let json = schema_for!(M).to_value().to_string();
        let schema = self
            .file
            .add_schema(schema, "jsonschema", json.as_bytes())?;
        let id = self
            .file
            .add_channel(schema, &topic.to_string(), "json", &BTreeMap::new())?;
        self.channels.insert(topic, id);
        Ok(())
    }

    /// Adds a channel that viewers draw.
    fn add_view(&mut self, view: View, schema: Schema) -> Result<(), McapError> {
        let schema = self
            .file
            .add_schema(schema.name(), "protobuf", schema.descriptor())?;
        let id = self
            .file
            .add_channel(schema, &view.to_string(), "protobuf", &BTreeMap::new())?;
        self.views.insert(view, id);
        Ok(())
    }

    /// Writes a tick. Ticks come in their order, from tick 0 on.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn tick(&mut self, tick: &RecordedTick) -> Result<(), WriteError> {
        self.try_tick(tick)
            .map_err(|error| failed(&self.path, &error))
    }

    fn try_tick(&mut self, tick: &RecordedTick) -> Result<(), McapError> {
        let number = tick.tick();
        self.add(&Topic::Frame, number, &tick.frame)?;
        for event in &tick.events {
            self.add_event(number, event)?;
        }
        for (robot, report) in &tick.reports {
            self.add(&Topic::Report(robot.clone()), number, report)?;
        }
        for (robot, panel) in &tick.panels {
            self.add(&Topic::Panel(robot.clone()), number, panel)?;
        }
        self.add(&Topic::Wall, number, &tick.wall)?;
        self.add_views(tick)?;

        if self.chunk_bytes >= CHUNK_BYTES || self.chunk_begun.elapsed() >= CHUNK_INTERVAL {
            self.end_chunk()?;
        }
        Ok(())
    }

    fn add_event(&mut self, tick: Tick, event: &Event) -> Result<(), McapError> {
        let line = Line {
            tick,
            event: event.clone(),
        };
        self.add(&Topic::Events, tick, &line)
    }

    fn add(
        &mut self,
        topic: &Topic,
        tick: Tick,
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        let Some(channel_id) = self.channels.get(topic) else {
            return Ok(()); // A robot outside the scenario cannot report.
        };

        self.message.clear();
        serde_json::to_writer(&mut self.message, message)
            .unwrap_or_else(|error| unreachable!("a record is always JSON: {error}"));
        let header = self.message_header(*channel_id, tick);
        self.file.write_to_known_channel(&header, &self.message)?;
        self.chunk_bytes += self.message.len();
        Ok(())
    }

    fn message_header(&self, channel_id: u16, tick: Tick) -> MessageHeader {
        let time_ns = self.header.time_ns(tick);
        MessageHeader {
            channel_id,
            sequence: tick as u32,
            log_time: time_ns,
            publish_time: time_ns,
        }
    }

    /// Adds what viewers draw, limited in its rate.
    fn add_views(&mut self, tick: &RecordedTick) -> Result<(), McapError> {
        let number = tick.tick();
        let time_ns = self.header.time_ns(number);
        for line in tick.log(&self.header) {
            self.view(&View::Log, number, viewers::log(&line, time_ns))?;
        }
        if !number.is_multiple_of(self.view_interval) {
            return Ok(());
        }

        if number == 0 {
            self.view(&View::Field, number, viewers::field(&self.header))?;
        }
        let robots = viewers::robots(&self.header, tick, time_ns);
        self.view(&View::Robots, number, robots)?;
        let guests = viewers::guests(&tick.frame.guests_mm, time_ns);
        self.view(&View::Guests, number, guests)?;
        let transforms = viewers::transforms(tick, time_ns);
        self.view(&View::Transforms, number, transforms)?;
        for robot in &tick.frame.robots {
            let pose = viewers::robot_pose(tick, robot, time_ns);
            self.view(&View::Pose(robot.name.clone()), number, pose)?;
        }
        Ok(())
    }

    fn view(&mut self, view: &View, tick: Tick, message: Protobuf) -> Result<(), McapError> {
        let Some(channel_id) = self.views.get(view) else {
            return Ok(()); // A robot outside the scenario has no place.
        };

        let header = self.message_header(*channel_id, tick);
        let message = message.into_bytes();
        self.chunk_bytes += message.len();
        self.file.write_to_known_channel(&header, &message)
    }

    /// Ends the chunk, so that everything so far is in the file.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.end_chunk().map_err(|error| failed(&self.path, &error))
    }

    fn end_chunk(&mut self) -> Result<(), McapError> {
        self.file.flush()?;
        self.chunk_bytes = 0;
        self.chunk_begun = Instant::now();
        Ok(())
    }

    /// Ends the chunk and waits until everything is on the disk.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        self.flush()?;
        self.disk
            .sync_data()
            .map_err(|error| failed(&self.path, &error.into()))
    }

    /// Writes the event of the end of the run, after its last tick.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn end(&mut self, last: Tick, event: &Event) -> Result<(), WriteError> {
        self.add_event(last, event)
            .map_err(|error| failed(&self.path, &error))
    }

    /// Writes the index, which makes seeking fast, and ends the file.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.file
            .finish()
            .map(drop)
            .map_err(|error| failed(&self.path, &error))
    }
}

fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(COMPRESSION_LEVEL)
        .compression_threads(0)
        .chunk_size(None)
        // A chunk is written as a whole: a crash leaves no half of one in the middle of the file.
        .disable_seeking(true)
        .profile("cars")
}

fn metadata(header: &Header) -> Metadata {
    let mut metadata = BTreeMap::from([
        ("run".to_owned(), header.run.to_string()),
        ("epoch".to_owned(), header.epoch.to_string()),
        ("seed".to_owned(), header.seed.to_string()),
        ("version".to_owned(), header.version.clone()),
        ("protocol".to_owned(), header.protocol.to_string()),
        ("tick_s".to_owned(), header.tick_s.to_string()),
    ]);
    if let Some(commit) = &header.commit {
        metadata.insert("commit".to_owned(), commit.clone());
    }

    Metadata {
        name: METADATA.to_owned(),
        metadata,
    }
}

/// The error with its causes: the first one alone does not name that of the operating system.
fn failed(path: &Path, error: &McapError) -> WriteError {
    let mut reason = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(error) = cause {
        reason += &format!(": {error}");
        cause = error.source();
    }

    WriteError {
        path: path.to_owned(),
        error: reason,
    }
}
