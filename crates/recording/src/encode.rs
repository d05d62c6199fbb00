//! Encodes ticks into the messages of a chunk.

use std::collections::BTreeMap;

use protocol::{Event, RobotName, Tick, schemas};
use serde::Serialize;

use crate::content::{Header, RecordedTick};
use crate::json;
use crate::mcap::{Channels, Chunk, MessageHead};
use crate::protobuf::Protobuf;
use crate::topic::{Topic, View};
use crate::viewers::{self, ViewerSchema};

/// Simulated time between two pictures for viewers, seconds.
const VIEW_INTERVAL_S: f64 = 1.0;

/// Encodes the ticks of an epoch.
pub(crate) struct Encoder {
    header: Header,
    channels: Channels,
    ids: Ids,
    robots: BTreeMap<RobotName, RobotIds>,
    /// Ticks between two pictures for viewers.
    view_interval: Tick,
}

/// Numbers of channels.
struct Ids {
    header: u16,
    frame: u16,
    events: u16,
    wall: u16,
    field: u16,
    scene: u16,
    guests: u16,
    transforms: u16,
    log: u16,
}

/// Numbers of the channels of a robot.
struct RobotIds {
    report: u16,
    panel: u16,
    pose: u16,
}

/// A line of `events.jsonl`, of which nothing is copied: a [`Line`].
#[derive(Serialize)]
struct LineView<'a> {
    tick: Tick,
    #[serde(flatten)]
    event: &'a Event,
}

impl Encoder {
    pub(crate) fn new(header: &Header) -> Self {
        let mut channels = Channels::default();
        let ids = Ids {
            header: add_topic(
                &mut channels,
                &Topic::Header,
                "cars.Header",
                &compact(schemas::HEADER),
            ),
            frame: add_topic(
                &mut channels,
                &Topic::Frame,
                "cars.Frame",
                &compact(schemas::FRAME),
            ),
            events: add_topic(
                &mut channels,
                &Topic::Events,
                "cars.Event",
                &compact(schemas::EVENT),
            ),
            wall: add_topic(
                &mut channels,
                &Topic::Wall,
                "cars.Wall",
                &compact(schemas::WALL),
            ),
            field: add_view(&mut channels, &View::Field, ViewerSchema::SceneUpdate),
            scene: add_view(&mut channels, &View::Robots, ViewerSchema::SceneUpdate),
            guests: add_view(&mut channels, &View::Guests, ViewerSchema::PointCloud),
            transforms: add_view(
                &mut channels,
                &View::Transforms,
                ViewerSchema::FrameTransforms,
            ),
            log: add_view(&mut channels, &View::Log, ViewerSchema::Log),
        };

        let report_schema = compact(schemas::REPORT);
        let panel_schema = compact(schemas::PANEL);
        let mut robots = BTreeMap::new();
        for robot in &header.robots {
            let report = Topic::Report(robot.clone());
            let panel = Topic::Panel(robot.clone());
            let pose = View::Pose(robot.clone());
            let ids = RobotIds {
                report: add_topic(&mut channels, &report, "cars.Report", &report_schema),
                panel: add_topic(&mut channels, &panel, "cars.Panel", &panel_schema),
                pose: add_view(&mut channels, &pose, ViewerSchema::PoseInFrame),
            };
            robots.insert(robot.clone(), ids);
        }

        Self {
            header: header.clone(),
            channels,
            ids,
            robots,
            view_interval: (VIEW_INTERVAL_S / header.tick_s).round().max(1.0) as Tick,
        }
    }

    /// The schemas and channels of the file.
    pub(crate) fn channels(&self) -> &Channels {
        &self.channels
    }

    /// The first chunk: all channels, and the header.
    pub(crate) fn preamble(&self) -> Chunk {
        let mut chunk = self.channels.chunk();
        self.add(&mut chunk, self.ids.header, 0, &self.header);
        chunk
    }

    /// Adds a tick to a chunk.
    pub(crate) fn add_tick(&self, tick: &RecordedTick, chunk: &mut Chunk) {
        let number = tick.frame.tick;
        self.add(chunk, self.ids.frame, number, &tick.frame);
        for event in tick.events.iter() {
            self.add_event(number, event, chunk);
        }

        // A robot outside the scenario cannot report.
        for (robot, report) in &tick.reports {
            if let Some(ids) = self.robots.get(robot) {
                self.add(chunk, ids.report, number, report.as_ref());
            }
        }
        for (robot, panel) in &tick.panels {
            if let Some(ids) = self.robots.get(robot) {
                self.add(chunk, ids.panel, number, panel);
            }
        }

        self.add(chunk, self.ids.wall, number, &tick.wall);
        self.add_views(tick, chunk);
    }

    /// Adds an event to a chunk.
    pub(crate) fn add_event(&self, tick: Tick, event: &Event, chunk: &mut Chunk) {
        self.add(chunk, self.ids.events, tick, &LineView { tick, event });
    }

    /// Adds what viewers draw, limited in its rate.
    fn add_views(&self, tick: &RecordedTick, chunk: &mut Chunk) {
        let number = tick.frame.tick;
        let time_ns = self.header.time_ns(number);
        for line in tick.log(&self.header) {
            self.add_view(chunk, self.ids.log, number, |to| {
                viewers::log(to, &line, time_ns);
            });
        }
        if !number.is_multiple_of(self.view_interval) {
            return;
        }

        if number == 0 {
            self.add_view(chunk, self.ids.field, number, |to| {
                viewers::field(to, &self.header);
            });
        }
        self.add_view(chunk, self.ids.scene, number, |to| {
            viewers::robots(to, &self.header, tick, time_ns);
        });
        self.add_view(chunk, self.ids.guests, number, |to| {
            viewers::guests(to, &tick.frame.guests_mm, time_ns);
        });
        self.add_view(chunk, self.ids.transforms, number, |to| {
            viewers::transforms(to, tick, time_ns);
        });
        for robot in &tick.frame.robots {
            if let Some(ids) = self.robots.get(&robot.name) {
                self.add_view(chunk, ids.pose, number, |to| {
                    viewers::robot_pose(to, tick, robot, time_ns);
                });
            }
        }
    }

    fn add(&self, chunk: &mut Chunk, channel: u16, tick: Tick, message: &impl Serialize) {
        chunk.add_message(self.head(channel, tick), |bytes| {
            json::append(bytes, message);
        });
    }

    fn add_view(
        &self,
        chunk: &mut Chunk,
        channel: u16,
        tick: Tick,
        encode: impl FnOnce(&mut Protobuf<'_>),
    ) {
        chunk.add_message(self.head(channel, tick), |bytes| {
            encode(&mut Protobuf::append_to(bytes));
        });
    }

    fn head(&self, channel: u16, tick: Tick) -> MessageHead {
        MessageHead {
            channel,
            sequence: tick as u32,
            time_ns: self.header.time_ns(tick),
        }
    }
}

/// A schema without the blanks of its file, which is written for people.
fn compact(schema: &str) -> String {
    let value: serde_json::Result<serde_json::Value> = serde_json::from_str(schema);
    value.map_or_else(|_| schema.to_owned(), |value| value.to_string())
}

/// Adds a channel with messages in JSON.
fn add_topic(channels: &mut Channels, topic: &Topic, name: &'static str, schema: &str) -> u16 {
    let schema = channels.add_schema(name, "jsonschema", schema.as_bytes());
    channels.add_channel(&topic.to_string(), schema, "json")
}

/// Adds a channel that viewers draw.
fn add_view(channels: &mut Channels, view: &View, schema: ViewerSchema) -> u16 {
    let schema = channels.add_schema(schema.name(), "protobuf", schema.descriptor());
    channels.add_channel(&view.to_string(), schema, "protobuf")
}
