//! What a recording contains.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::messages::{Awaited, LogRecord, Panel, Report};
pub use protocol::recorded::{Frame, Header, Missed, PlacedRobot, WallTimes};
use protocol::{Event, Message, RobotName, Tick};
use serde::de::{Error, IgnoredAny};

/// What every reader of the format shows of the file.
pub(crate) fn metadata(header: &Header) -> BTreeMap<String, String> {
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
    metadata
}

/// Everything that is recorded of one tick. Events and reports are shared with the simulation that they came from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordedTick {
    /// The field after the tick.
    pub frame: Frame,
    /// The events of the tick, in the order of `events.jsonl`, without seals. The last tick of a run also has its end.
    pub events: Arc<Vec<Event>>,
    /// The reports for this tick, whole; a robot that missed the tick has none.
    pub reports: BTreeMap<RobotName, Arc<Report>>,
    /// The newest panel of each robot from which one arrived during the tick. Not reproducible.
    pub panels: BTreeMap<RobotName, Panel>,
    /// Wall-clock times. Not reproducible.
    pub wall: WallTimes,
}

impl RecordedTick {
    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.frame.tick
    }

    /// The lines of the log about this tick, which are made from its events.
    #[must_use]
    pub fn log(&self, header: &Header) -> Vec<LogRecord> {
        log(self.tick(), &self.events, &self.wall, header)
    }
}

fn log(tick: Tick, events: &[Event], wall: &WallTimes, header: &Header) -> Vec<LogRecord> {
    let mut lines = wall.late.clone();
    for event in events {
        lines.extend(event.log_record(header.epoch, tick, header.tick_s));
    }
    lines
}

/// What is recorded of one tick, with reports and panels as they are in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct RawTick {
    /// The field after the tick.
    pub frame: Frame,
    /// The events of the tick.
    pub events: Vec<Event>,
    /// The reports for this tick.
    pub reports: BTreeMap<RobotName, Json>,
    /// The newest panels.
    pub panels: BTreeMap<RobotName, Json>,
    /// Wall-clock times.
    pub wall: WallTimes,
}

impl RawTick {
    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.frame.tick
    }

    /// The lines of the log about this tick.
    #[must_use]
    pub fn log(&self, header: &Header) -> Vec<LogRecord> {
        log(self.tick(), &self.events, &self.wall, header)
    }

    /// Decodes reports and panels.
    pub(crate) fn decode(self) -> Result<RecordedTick, serde_json::Error> {
        let mut reports = BTreeMap::new();
        for (robot, report) in self.reports {
            reports.insert(robot, Arc::new(Report::from_json(&report.0)?));
        }
        let mut panels = BTreeMap::new();
        for (robot, panel) in self.panels {
            panels.insert(robot, Panel::from_json(&panel.0)?);
        }

        Ok(RecordedTick {
            frame: self.frame,
            events: Arc::new(self.events),
            reports,
            panels,
            wall: self.wall,
        })
    }
}

/// A JSON object, as it is in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Json(Vec<u8>);

impl Json {
    /// Bytes of a message that have not been checked yet.
    pub(crate) fn unchecked(bytes: &[u8]) -> Self {
        Self(bytes.to_vec())
    }

    /// Checks that it is a JSON object.
    pub(crate) fn check(&self) -> Result<(), serde_json::Error> {
        let IgnoredAny = serde_json::from_slice(&self.0)?;
        if self.0.trim_ascii().starts_with(b"{") {
            Ok(())
        } else {
            Err(serde_json::Error::custom("not a JSON object"))
        }
    }

    /// The fields of the object with the commas between them, without its braces.
    #[must_use]
    pub fn fields(&self) -> &[u8] {
        let text = self.0.trim_ascii();
        let end = text.len().saturating_sub(1);
        text.get(1..end).unwrap_or_default().trim_ascii()
    }

    /// The text.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }
}

/// What happened in a tick, without what the field and the robots were like.
#[derive(Debug, Clone, PartialEq)]
pub struct TickEvents {
    /// The tick.
    pub tick: Tick,
    /// The events of the tick, in the order of `events.jsonl`, without seals. The last tick of a run also has its end.
    pub events: Vec<Event>,
    /// Robots for which the clock was held. Not reproducible.
    pub awaited: Vec<Awaited>,
}
