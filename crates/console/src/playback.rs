//! A recorded run, as the page shows it.

use std::collections::BTreeMap;
use std::path::Path;

use protocol::messages::{
    Awaited, Cut, Fate, Flight, LogRecord, Panel, Presence, Report, RobotFrame,
};
use protocol::{Event, RobotName, Tick};
use recording::{Header, PlacedRobot, RecordedTick, RecordingError};
use serde::Serialize;

/// Most ticks in one answer.
pub(crate) const MAX_TICKS: u64 = 512;
/// How long a panel is shown, simulated seconds. In a fast run panels arrive more seldom, and would show old states.
const PANEL_S: f64 = 1.0;
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
}

/// The header of a recording, and its length.
#[derive(Debug, Serialize)]
pub(crate) struct Summary<'a> {
    #[serde(flatten)]
    header: &'a Header,
    /// The last tick.
    ticks: Tick,
}

/// What happened in a range of ticks.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Range {
    ticks: Vec<ShownTick>,
    /// Panels that arrived in these ticks, or within [`PANEL_S`] before them.
    panels: Vec<ShownPanel>,
    flights: Vec<Flight>,
    log: Vec<LogRecord>,
}

/// A tick as a frame of a run in progress shows it.
#[derive(Debug, Serialize)]
struct ShownTick {
    tick: Tick,
    robots: Vec<RobotFrame>,
    guests_mm: Vec<i64>,
    cuts: Vec<Cut>,
    /// Robots for which the clock was held.
    awaiting: Vec<Awaited>,
}

/// A panel with the tick in which it arrived.
#[derive(Debug, Serialize)]
struct ShownPanel {
    tick: Tick,
    robot: RobotName,
    panel: Panel,
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
        Ok(Self { file })
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

    /// What happened in `count` ticks from tick `from` on; fewer if the recording ends before, or if they are too much
    /// for one answer.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is damaged.
    pub(crate) fn range(&self, from: Tick, count: u64) -> Result<Range, RecordingError> {
        let to = from.saturating_add(count.min(MAX_TICKS));
        let to = self.file.fitting(from, to, MAX_BYTES);

        let mut range = Range::default();
        let mut last_reports = BTreeMap::new();
        for recorded in self.file.read(self.first_of_panels(from), to)? {
            let tick = recorded.tick();
            for (robot, panel) in &recorded.panels {
                range.panels.push(ShownPanel {
                    tick,
                    robot: robot.clone(),
                    panel: panel.clone(),
                });
            }
            if tick < from {
                continue;
            }

            for event in &recorded.events {
                range.flights.extend(flight(tick, event));
            }
            range.log.extend(recorded.log(self.file.header()));
            range.ticks.push(self.shown(recorded, &mut last_reports)?);
        }
        Ok(range)
    }

    /// The first tick of which panels are shown in a tick.
    fn first_of_panels(&self, tick: Tick) -> Tick {
        let lifetime = (PANEL_S / self.file.header().tick_s).round().max(1.0) as Tick;
        tick.saturating_sub(lifetime - 1)
    }

    /// A tick as the page shows it. `last_reports` has the last report of each robot in the ticks before, as far as they
    /// have been read.
    fn shown(
        &self,
        mut recorded: RecordedTick,
        last_reports: &mut BTreeMap<RobotName, Report>,
    ) -> Result<ShownTick, RecordingError> {
        let tick = recorded.tick();
        last_reports.append(&mut recorded.reports);

        let mut robots = Vec::new();
        for robot in recorded.frame.robots {
            let last_report = robot.missed.and_then(|missed| missed.last_report);
            if let Some(tick) = last_report
                && !last_reports.contains_key(&robot.name)
                && let Some(report) = self.file.report(&robot.name, tick)?
            {
                last_reports.insert(robot.name.clone(), report);
            }
            // A robot is shown from its first report on.
            if let Some(report) = last_reports.get(&robot.name) {
                robots.push(robot_frame(robot, report));
            }
        }

        Ok(ShownTick {
            tick,
            robots,
            guests_mm: recorded.frame.guests_mm,
            cuts: recorded.frame.cuts,
            awaiting: recorded.wall.awaited,
        })
    }
}

/// A robot as a frame of a run in progress has it.
fn robot_frame(robot: PlacedRobot, report: &Report) -> RobotFrame {
    RobotFrame {
        name: robot.name,
        location: robot.location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        blocked: robot.blocked,
        emotion_state: report.emotion_state.clone(),
        behavior_state: report.behavior_state.clone(),
        state_variables: report.state_variables.clone(),
        generation: report.generation,
        presence: match robot.missed {
            Some(_) => Presence::Gone,
            None => Presence::Here,
        },
    }
}

/// The fate of a command that an event states; `None` for other events.
fn flight(tick: Tick, event: &Event) -> Option<Flight> {
    let (from, to, seq, fate) = match event {
        Event::CommandSent { from, to, seq, .. } => (from, to, seq, Fate::Sent),
        Event::CommandDelivered { from, to, seq } => (from, to, seq, Fate::Delivered),
        Event::CommandDropped { from, to, seq, .. } => (from, to, seq, Fate::Dropped),
        _ => return None,
    };

    Some(Flight {
        tick,
        from: from.clone(),
        to: to.clone(),
        seq: *seq,
        command: command_text(event),
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
