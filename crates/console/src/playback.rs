//! A recorded epoch, as the page shows it. That of a run in progress grows.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use protocol::messages::{Flight, HeldProcess, LogRecord, Point, Presence};
use protocol::{Epoch, Event, RobotName, Tick};
use recording::{Header, Json, PlacedRobot, RawTick, RecordingError, Timelines};
use serde::Serialize;
use timeline::{RunDecision, Span, StateKind, Timeline};

use crate::diagrams::{self, DiagramError, WindowQuery};

/// Most ticks in one answer.
pub(crate) const MAX_TICKS: u64 = 512;
/// Most ticks that one answer samples.
pub(crate) const MAX_SAMPLED_TICKS: u64 = 4096;
/// Most bytes in one answer, as they are recorded; an answer has at least one tick.
const MAX_BYTES: u64 = 32 << 20;
/// An answer has no further ticks once this many stays in an emotion or behavior are over in it.
const MAX_STAYS: usize = 32_768;

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
    #[error(
        "{0}: no tick was completed, or none is written yet, which takes a run in progress two seconds at most"
    )]
    Empty(String),
    /// The folder of a run in progress has no recording that can be read.
    #[error("nothing is recorded yet, or the scenario sets `frames = false` under [record]")]
    NotYet,
    /// The folder has no recording of an epoch.
    #[error("this epoch has no recording")]
    NoEpoch,
    /// The folder is that of another run.
    #[error("{0} is of another run")]
    OtherRun(String),
}

/// A recorded epoch.
#[derive(Debug)]
pub(crate) struct RecordedEpoch {
    header: Header,
    /// Which one of the recordings with this epoch it is: a run may be started anew.
    number: u64,
    file: RwLock<recording::Recording>,
    timelines: Timelines,
}

/// The header of a recording, and its length.
#[derive(Debug, Serialize)]
struct RecordingHeader<'a> {
    #[serde(flatten)]
    header: &'a Header,
    /// The last tick.
    ticks: Tick,
    /// Whether no more ticks follow.
    is_finished: bool,
    number: u64,
    /// The epochs that have a recording.
    epochs: &'a [Epoch],
}

/// The emotions and behaviors of a recording.
#[derive(Debug, Serialize)]
struct RecordedNames<'a> {
    emotion: &'a [String],
    behavior: &'a [String],
}

/// What happened in a range of ticks, as a JSON object. Reports and panels are in it as they were recorded: to decode them and
/// encode them again would take most of the time of a seek.
#[derive(Debug, Default)]
struct EncodedRange {
    /// The tick after the range.
    end: Tick,
    /// Elements of a list: each tick as a frame of a run in progress shows it.
    ticks: List,
    /// Emotions and behaviors of robots.
    spans: List,
    /// Panels of these ticks.
    panels: List,
    /// What is known of commands before the range.
    earlier_flights: Vec<Flight>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_rad: Option<f64>,
    blocked: bool,
    presence: Presence,
}

/// Which ticks are asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted {
    /// The first one.
    pub(crate) from: Tick,
    /// Number of ticks.
    pub(crate) count: u64,
    /// If set, samples for charts: the ticks that this number divides, without guests, layers, panels and commands. The log is
    /// complete, and with it are all stays in an emotion or behavior that were over in these ticks or go on after them.
    pub(crate) every: Option<u64>,
}

impl Wanted {
    /// Whether the request is within its limits.
    pub(crate) fn is_valid(&self) -> bool {
        match self.every {
            None => self.count <= MAX_TICKS,
            Some(every) => every > 0 && self.count <= MAX_SAMPLED_TICKS,
        }
    }
}

impl RecordedEpoch {
    /// Opens a recording. `number` tells it from others of its epoch.
    ///
    /// # Errors
    /// [`OpenError`] names the file.
    pub(crate) fn open(path: &Path, number: u64) -> Result<Self, OpenError> {
        let file = recording::Recording::open(path)?;
        if file.is_empty() {
            return Err(OpenError::Empty(path.display().to_string()));
        }

        Ok(Self {
            header: file.header().clone(),
            number,
            timelines: Timelines::of(&file),
            file: RwLock::new(file),
        })
    }

    fn file(&self) -> RwLockReadGuard<'_, recording::Recording> {
        self.file.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether an answer is about this epoch: its digest is that of the epoch at its last tick.
    pub(crate) fn is_of(&self, decision: &RunDecision) -> bool {
        let (last, mut is_of) = (decision.last, false);
        let read = self
            .file()
            .for_events(last, last.saturating_add(1), |tick| {
                is_of |= tick.events.iter().any(|event| {
                matches!(event, Event::Tick { digest, .. } if *digest == decision.digest)
            });
            });
        read.is_ok() && is_of
    }

    /// Takes in what has become complete since.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is damaged.
    pub(crate) fn grow(&self) -> Result<(), RecordingError> {
        let mut file = self.file.write().unwrap_or_else(PoisonError::into_inner);
        file.grow()
    }

    /// Whether it is the file at this path.
    pub(crate) fn is_at(&self, path: &Path) -> bool {
        self.file().is_at(path)
    }

    /// Name of the run.
    pub(crate) fn run(&self) -> &str {
        self.header.run.as_str()
    }

    /// The epoch.
    pub(crate) fn epoch(&self) -> Epoch {
        self.header.epoch
    }

    /// What holds for the whole recording, as JSON. `epochs` are those that have a recording.
    pub(crate) fn summary(&self, epochs: &[Epoch]) -> Vec<u8> {
        let file = self.file();
        to_json(&RecordingHeader {
            header: &self.header,
            ticks: file.len().saturating_sub(1),
            is_finished: file.is_finished(),
            number: self.number,
            epochs,
        })
    }

    /// What happened in a range of ticks, as JSON; fewer ticks if the recording ends before, or if they are too much for one
    /// answer.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is damaged.
    pub(crate) fn range(&self, wanted: Wanted) -> Result<Vec<u8>, RecordingError> {
        let file = self.file();
        let Wanted { from, count, every } = wanted;
        let to = file.fitting(from, from.saturating_add(count), MAX_BYTES);
        let mut range = EncodedRange {
            end: to.min(file.len()).max(from),
            ..EncodedRange::default()
        };
        // Whether a robot is lost in the first tick depends on ticks before the range.
        let mut timeline = if every.is_some() {
            self.timelines.before(&file, from)?
        } else {
            let (timeline, flights) = self.timelines.with_flights(&file, from)?;
            range.earlier_flights = flights;
            timeline
        };
        let mut last_reports = BTreeMap::new();
        let mut stays = 0;
        for mut recorded in file.read_raw(from, to)? {
            let tick = recorded.tick();
            let over = timeline.tick(tick, &recorded.events);
            if every.is_some() {
                stays += range.add_stays(&over);
                recorded.panels.clear();
                recorded.frame.guests_mm.clear();
                recorded.frame.guest_numbers.clear();
                recorded.frame.layers.clear();
            }
            for (robot, panel) in &recorded.panels {
                range.add_panel(tick, robot, panel);
            }
            if every.is_none() {
                for event in &recorded.events {
                    range.flights.extend(event.flight(tick));
                }
            }
            range.log.extend(recorded.log(&self.header));
            last_reports.append(&mut recorded.reports);
            if every.is_none_or(|every| tick.is_multiple_of(every)) {
                add_tick(&file, &recorded, &timeline, &mut last_reports, &mut range)?;
            }
            if stays >= MAX_STAYS {
                range.end = tick.saturating_add(1);
                break;
            }
        }
        if every.is_some() {
            range.add_stays(&timeline.in_progress());
        }
        Ok(range.into_json())
    }

    /// The emotions and behaviors so far, as JSON, in the order in which they first occurred: by it they have their colors.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is damaged.
    pub(crate) fn names(&self) -> Result<Vec<u8>, RecordingError> {
        let file = self.file();
        let timeline = self.timelines.before(&file, file.len())?;
        let names = timeline.names();
        Ok(to_json(&RecordedNames {
            emotion: names.of(StateKind::Emotion),
            behavior: names.of(StateKind::Behavior),
        }))
    }

    /// The space-time diagram of a window, as SVG without its style sheet.
    ///
    /// # Errors
    /// [`DiagramError`] if the file is damaged or the window has too much.
    pub(crate) fn diagram(&self, window: WindowQuery) -> Result<String, DiagramError> {
        diagrams::draw(&self.file(), &self.timelines, window)
    }
}

/// Adds a tick as the page shows it. `last_reports` has the last report of each robot up to this tick, as far as ticks have
/// been read.
fn add_tick(
    file: &recording::Recording,
    recorded: &RawTick,
    timeline: &Timeline,
    last_reports: &mut BTreeMap<RobotName, Json>,
    range: &mut EncodedRange,
) -> Result<(), RecordingError> {
    let mut robots = List::default();
    for robot in &recorded.frame.robots {
        let last_report = robot.missed.and_then(|missed| missed.last_report);
        if let Some(tick) = last_report
            && !last_reports.contains_key(&robot.name)
            && let Some(report) = file.report(&robot.name, tick)?
        {
            last_reports.insert(robot.name.clone(), report);
        }
        // A robot is shown from its first report on.
        if let Some(report) = last_reports.get(&robot.name) {
            let presence = if timeline.lost_since(&robot.name).is_some() {
                Presence::Lost
            } else if robot.missed.is_some() {
                Presence::Gone
            } else {
                Presence::Here
            };
            robots.add_robot(robot, presence, report);
        }
    }

    let faults: Vec<HeldProcess> = timeline
        .faults()
        .map(|(robot, kind)| HeldProcess {
            robot: robot.clone(),
            kind,
        })
        .collect();

    range.ticks.add_object(&[
        ("tick", &to_json(&recorded.tick())),
        ("robots", &robots.into_json()),
        ("guests_mm", &to_json(&recorded.frame.guests_mm)),
        ("guest_numbers", &to_json(&recorded.frame.guest_numbers)),
        ("guest_moods", &to_json(&recorded.frame.guest_moods)),
        ("cuts", &to_json(&recorded.frame.cuts)),
        ("faults", &to_json(&faults)),
        ("sites", &to_json(&file.header().sites_of(&recorded.frame))),
        // Of the others, the page has in the header how they are at the start.
        ("layers", &to_json(&recorded.frame.layers)),
        (
            "expectations",
            &to_json(&recorded.frame.standings(&recorded.events)),
        ),
        ("measures", &to_json(&recorded.frame.measures)),
        // Robots for which the clock was held.
        ("awaiting", &to_json(&recorded.wall.awaited)),
    ]);
    Ok(())
}

impl EncodedRange {
    /// Adds the stays among these spans. Returns how many there are.
    fn add_stays(&mut self, spans: &[Span]) -> usize {
        let stays = spans.iter().filter_map(|span| match span {
            Span::Stay(stay) => Some(stay),
            _ => None,
        });
        let mut count = 0;
        for stay in stays {
            self.spans.add_object(&[
                ("robot", &to_json(&stay.robot)),
                ("kind", &to_json(&stay.kind.as_str())),
                ("state", &to_json(&stay.name)),
                ("begin", &to_json(&stay.period.begin)),
                // None if it goes on after the range.
                ("end", &to_json(&stay.period.end)),
            ]);
            count += 1;
        }
        count
    }

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
            ("end", &to_json(&self.end)),
            ("ticks", &self.ticks.into_json()),
            ("spans", &self.spans.into_json()),
            ("panels", &self.panels.into_json()),
            ("earlier_flights", &to_json(&self.earlier_flights)),
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
    fn add_robot(&mut self, robot: &PlacedRobot, presence: Presence, report: &Json) {
        let head = to_json(&RobotHead {
            name: &robot.name,
            location: robot.location,
            heading_rad: robot.heading_rad,
            blocked: robot.blocked,
            presence,
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
