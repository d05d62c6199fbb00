//! A recorded run, as the page shows it.

use std::collections::BTreeMap;
use std::path::Path;

use protocol::messages::{Flight, LogRecord, Point, Presence};
use protocol::{RobotName, Tick};
use recording::{Header, Json, PlacedRobot, RawTick, RecordingError};
use serde::Serialize;

use crate::diagrams::{DiagramError, Diagrams, Window};

/// Most ticks in one answer.
pub(crate) const MAX_TICKS: u64 = 512;
/// Most bytes in one answer, as they are recorded; an answer has at least one tick.
const MAX_BYTES: u64 = 32 << 20;

/// Why a recording cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// It cannot be read.
    #[error(
        "{0}; --recording takes the folder of a run, which has a recording unless its scenario sets `frames = false` \
         under [record]"
    )]
    Unreadable(#[from] RecordingError),
    /// It has no tick.
    #[error("{0}: no tick was completed")]
    Empty(String),
}

/// A recorded run.
#[derive(Debug)]
pub(crate) struct Recording {
    file: recording::Recording,
    diagrams: Diagrams,
}

/// The header of a recording, and its length.
#[derive(Debug, Serialize)]
pub(crate) struct Summary<'a> {
    #[serde(flatten)]
    header: &'a Header,
    /// The last tick.
    ticks: Tick,
}

/// What happened in a range of ticks, as a JSON object. Reports and panels are in it as they were recorded: to decode them and
/// encode them again would take most of the time of a seek.
#[derive(Debug, Default)]
struct Range {
    /// Elements of a list: each tick as a frame of a run in progress shows it.
    ticks: List,
    /// Panels that arrived in these ticks, or shortly before.
    panels: List,
    flights: Vec<Flight>,
    log: Vec<LogRecord>,
}

/// The elements of a JSON list.
#[derive(Debug, Default)]
struct List(Vec<u8>);

/// A robot as a frame of a run in progress has it, without what its report states.
#[derive(Serialize)]
struct RobotHead<'a> {
    name: &'a RobotName,
    location: Point,
    blocked: bool,
    presence: Presence,
}

impl Recording {
    /// Opens the recording in a run's folder, or a recording file: `RUN/run-epoch1.mcap` is the recording of an epoch that
    /// `init` ended.
    ///
    /// # Errors
    /// [`OpenError`] names the file.
    pub(crate) fn open(path: &Path) -> Result<Self, OpenError> {
        let path = if path.is_dir() {
            path.join(recording::FILE)
        } else {
            path.to_owned()
        };

        let file = recording::Recording::open(&path)?;
        if file.is_empty() {
            return Err(OpenError::Empty(path.display().to_string()));
        }
        let diagrams = Diagrams::of(&file);
        Ok(Self { file, diagrams })
    }

    /// Name of the run.
    pub(crate) fn run(&self) -> &str {
        self.file.header().run.as_str()
    }

    /// What holds for the whole recording.
    pub(crate) fn summary(&self) -> Summary<'_> {
        Summary {
            header: self.file.header(),
            ticks: self.file.len() - 1,
        }
    }

    /// What happened in `count` ticks from tick `from` on, as JSON; fewer if the recording ends before, or if they are too
    /// much for one answer.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is damaged.
    pub(crate) fn range(&self, from: Tick, count: u64) -> Result<Vec<u8>, RecordingError> {
        let to = from.saturating_add(count.min(MAX_TICKS));
        let to = self.file.fitting(from, to, MAX_BYTES);

        let header = self.file.header();
        let mut range = Range::default();
        let mut last_reports = BTreeMap::new();
        for recorded in self.file.read_raw(header.first_of_panels(from), to)? {
            let tick = recorded.tick();
            for (robot, panel) in &recorded.panels {
                range.add_panel(tick, robot, panel);
            }
            if tick < from {
                continue;
            }

            for event in &recorded.events {
                range.flights.extend(event.flight(tick));
            }
            range.log.extend(recorded.log(header));
            self.add_tick(recorded, &mut last_reports, &mut range)?;
        }
        Ok(range.into_json())
    }

    /// The space-time diagram of a window, as SVG without its style sheet.
    ///
    /// # Errors
    /// [`DiagramError`] if the file is damaged or the window has too much.
    pub(crate) fn diagram(&self, window: Window) -> Result<String, DiagramError> {
        self.diagrams.draw(&self.file, window)
    }

    /// Adds a tick as the page shows it. `last_reports` has the last report of each robot in the ticks before, as far as they
    /// have been read.
    fn add_tick(
        &self,
        mut recorded: RawTick,
        last_reports: &mut BTreeMap<RobotName, Json>,
        range: &mut Range,
    ) -> Result<(), RecordingError> {
        let tick = recorded.tick();
        last_reports.append(&mut recorded.reports);

        let mut robots = List::default();
        for robot in &recorded.frame.robots {
            let last_report = robot.missed.and_then(|missed| missed.last_report);
            if let Some(tick) = last_report
                && !last_reports.contains_key(&robot.name)
                && let Some(report) = self.file.report(&robot.name, tick)?
            {
                last_reports.insert(robot.name.clone(), report);
            }
            // A robot is shown from its first report on.
            if let Some(report) = last_reports.get(&robot.name) {
                robots.add_robot(robot, report);
            }
        }

        range.ticks.add_object(&[
            ("tick", &to_json(&tick)),
            ("robots", &robots.into_json()),
            ("guests_mm", &to_json(&recorded.frame.guests_mm)),
            ("cuts", &to_json(&recorded.frame.cuts)),
            (
                "expectations",
                &to_json(&recorded.frame.standings(&recorded.events)),
            ),
            // Robots for which the clock was held.
            ("awaiting", &to_json(&recorded.wall.awaited)),
        ]);
        Ok(())
    }
}

impl Range {
    /// Adds a panel with the tick in which it arrived.
    fn add_panel(&mut self, tick: Tick, robot: &RobotName, panel: &Json) {
        self.panels.add_object(&[
            ("tick", &to_json(&tick)),
            ("robot", &to_json(robot)),
            ("panel", panel.as_bytes()),
        ]);
    }

    fn into_json(self) -> Vec<u8> {
        let mut range = List::default();
        range.add_object(&[
            ("ticks", &self.ticks.into_json()),
            ("panels", &self.panels.into_json()),
            ("flights", &to_json(&self.flights)),
            ("log", &to_json(&self.log)),
        ]);
        range.0
    }
}

impl List {
    /// Adds an object with these fields, whose values are JSON.
    fn add_object(&mut self, fields: &[(&str, &[u8])]) {
        self.separate();
        for (index, (name, value)) in fields.iter().enumerate() {
            let before = if index == 0 { "{\"" } else { ",\"" };
            self.0.extend_from_slice(before.as_bytes());
            self.0.extend_from_slice(name.as_bytes());
            self.0.extend_from_slice(b"\":");
            self.0.extend_from_slice(value);
        }
        self.0.push(b'}');
    }

    /// Adds a robot as a frame of a run in progress has it. The fields of such a frame that are not in its head have the same
    /// names in its report.
    fn add_robot(&mut self, robot: &PlacedRobot, report: &Json) {
        let head = to_json(&RobotHead {
            name: &robot.name,
            location: robot.location,
            blocked: robot.blocked,
            presence: match robot.missed {
                Some(_) => Presence::Gone,
                None => Presence::Here,
            },
        });

        self.separate();
        self.0.push(b'{');
        let stated = report.fields();
        if !stated.is_empty() {
            self.0.extend_from_slice(stated);
            self.0.push(b',');
        }
        self.0.extend_from_slice(&head[1..]);
    }

    /// Separates the next element from the one before.
    fn separate(&mut self) {
        if !self.0.is_empty() {
            self.0.push(b',');
        }
    }

    fn into_json(self) -> Vec<u8> {
        let mut list = self.0;
        list.insert(0, b'[');
        list.push(b']');
        list
    }
}

fn to_json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value)
        .unwrap_or_else(|error| unreachable!("what was recorded is JSON: {error}"))
}
