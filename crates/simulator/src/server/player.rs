//! The tick of a recording that a replay shows, and how it goes on or back.

use std::collections::BTreeMap;

use lockstep::{NoState, RecentStates, StateQuery};
use protocol::messages::{
    Flight, LogRecord, PublicState, RobotFrame, Status, TickPanel, WorldFrame,
};
use protocol::{Event, RobotName, Tick};
use recording::{
    Header, LastReports, PlacedRobot, RecordedTick, Recording, RecordingError, Ticks, Timelines,
};

use super::frame::empty_frame;

/// A recording, and the tick of it that is shown.
pub(super) struct Player {
    ticks: Ticks,
    timelines: Timelines,
    last_reports: LastReports,
    shown: ShownTick,
}

/// What observers see of a tick.
struct ShownTick {
    recorded: RecordedTick,
    robots: Vec<RobotFrame>,
    /// The last two states of each robot.
    states: BTreeMap<RobotName, RecentStates<PublicState>>,
}

impl Player {
    /// Shows tick 0 of a recording, which has one.
    pub(super) fn open(recording: Recording) -> Result<Self, RecordingError> {
        let mut last_reports = LastReports::default();
        let shown = ShownTick::at(0, &recording, &mut last_reports)?;
        let timelines = Timelines::of(&recording);
        let mut ticks = Ticks::of(recording);
        ticks.seek(1);

        Ok(Self {
            ticks,
            timelines,
            last_reports,
            shown,
        })
    }

    fn recording(&self) -> &Recording {
        self.ticks.recording()
    }

    pub(super) fn header(&self) -> &Header {
        self.recording().header()
    }

    /// The scenario of the recorded epoch, as a file.
    pub(super) fn scenario(&self) -> Result<String, RecordingError> {
        self.recording().scenario()
    }

    /// The tick that is shown.
    pub(super) fn tick(&self) -> Tick {
        self.shown.recorded.tick()
    }

    /// The last tick of the recording.
    pub(super) fn last(&self) -> Tick {
        self.recording().len().saturating_sub(1)
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.tick() >= self.last()
    }

    /// Shows the next tick, if there is one. Where it cannot be read, the tick that is shown stays.
    pub(super) fn advance(&mut self) -> Result<(), RecordingError> {
        let Some(recorded) = self.ticks.next_tick()? else {
            return Ok(());
        };

        let recording = self.ticks.recording();
        match self.last_reports.robots(recording, &recorded) {
            Ok(robots) => self.shown.robots = robots,
            Err(error) => {
                self.ticks.seek(recorded.tick());
                return Err(error);
            }
        }
        self.shown.enter(recorded);
        Ok(())
    }

    /// Shows a tick of the recording. Where it cannot be read, the tick that is shown stays.
    pub(super) fn seek(&mut self, tick: Tick) -> Result<(), RecordingError> {
        let recording = self.ticks.recording();
        self.shown = ShownTick::at(tick, recording, &mut self.last_reports)?;
        self.ticks.seek(tick + 1);
        Ok(())
    }

    /// The events of the tick.
    pub(super) fn events(&self) -> &[Event] {
        &self.shown.recorded.events
    }

    /// What observers know of commands before the tick. Damage there costs no more than that.
    pub(super) fn earlier_flights(&self) -> Vec<Flight> {
        match self.timelines.with_flights(self.recording(), self.tick()) {
            Ok((_, flights)) => flights,
            Err(error) => {
                tracing::warn!(
                    "commands sent before tick {} are not shown: {error}",
                    self.tick()
                );
                Vec::new()
            }
        }
    }

    /// The lines of the log about the tick.
    pub(super) fn log(&self) -> Vec<LogRecord> {
        self.shown.recorded.log(self.header())
    }

    /// The robots in the tick.
    pub(super) fn robots(&self) -> &[RobotFrame] {
        &self.shown.robots
    }

    /// The state that a robot reported for the tick; `None` if it missed the tick.
    pub(super) fn new_state(&self, robot: &RobotName) -> Option<PublicState> {
        let recorded = &self.shown.recorded;
        let report = recorded.reports.get(robot)?;
        let placed = recorded.frame.robots.iter().find(|r| r.name == *robot)?;
        Some(report.state(placed.location))
    }

    /// What a robot answers to a query during the tick.
    pub(super) fn state(
        &self,
        robot: &RobotName,
        query: StateQuery,
    ) -> Result<PublicState, NoState> {
        let states = self.shown.states.get(robot).ok_or(NoState::NotYet)?;
        states.answer(query)
    }

    /// The panel of a robot in the tick, if it was recorded.
    pub(super) fn panel(&self, robot: &RobotName) -> Option<TickPanel> {
        let panel = self.shown.recorded.panels.get(robot)?;
        Some(TickPanel::new(
            self.header().epoch,
            self.tick(),
            panel.clone(),
        ))
    }

    /// The frame of the tick, without flights.
    pub(super) fn frame(&self, status: &Status) -> WorldFrame {
        let header = self.header();
        let frame = &self.shown.recorded.frame;
        let mut guests = Vec::new();
        for guest in frame.guests_mm.chunks_exact(2) {
            guests.push([guest[0] as f64 / 1000.0, guest[1] as f64 / 1000.0]);
        }

        WorldFrame {
            robots: self.shown.robots.clone(),
            guests,
            guest_numbers: frame.guest_numbers.clone(),
            guest_moods: frame.guest_moods.clone(),
            obstacles: header.obstacles.clone(),
            sites: header.sites_of(frame),
            layers: header.layers_of(frame),
            cuts: frame.cuts.clone(),
            expectations: frame.standings(self.events()),
            measures: frame.measures.clone(),
            display_unit: header.display_unit,
            ..empty_frame(status, header.field_m, header.body_m)
        }
    }
}

impl ShownTick {
    /// What is shown of a tick, with what observers know from the ticks before.
    fn at(
        tick: Tick,
        recording: &Recording,
        last_reports: &mut LastReports,
    ) -> Result<Self, RecordingError> {
        let before = tick.saturating_sub(1);
        let read = recording.read(before, tick + 1);
        // Damage before the tick costs no more than what is shown of the ticks before.
        let read = read.or_else(|_| recording.read(tick, tick + 1))?;
        let mut ticks = read.into_iter();
        let Some(first) = ticks.next() else {
            unreachable!("a replay shows ticks of its recording only");
        };

        let mut states = BTreeMap::new();
        for robot in &first.frame.robots {
            if let Some(state) = last_state(recording, &first, robot)? {
                add_state(&mut states, &robot.name, state);
            }
        }
        let mut shown = Self {
            robots: Vec::new(),
            states,
            recorded: first,
        };
        for recorded in ticks {
            shown.enter(recorded);
        }
        shown.robots = last_reports.robots(recording, &shown.recorded)?;
        Ok(shown)
    }

    /// Goes on to the next tick; its robots are set elsewhere.
    fn enter(&mut self, recorded: RecordedTick) {
        for robot in &recorded.frame.robots {
            if let Some(report) = recorded.reports.get(&robot.name) {
                let state = report.state(robot.location);
                add_state(&mut self.states, &robot.name, state);
            }
        }
        self.recorded = recorded;
    }
}

fn add_state(
    states: &mut BTreeMap<RobotName, RecentStates<PublicState>>,
    robot: &RobotName,
    state: PublicState,
) {
    let states = states.entry(robot.clone()).or_default();
    states.add(state.epoch, state.tick, state);
}

/// The state of a robot's last report up to a tick.
fn last_state(
    recording: &Recording,
    recorded: &RecordedTick,
    robot: &PlacedRobot,
) -> Result<Option<PublicState>, RecordingError> {
    if let Some(report) = recorded.reports.get(&robot.name) {
        return Ok(Some(report.state(robot.location)));
    }
    let Some(tick) = robot.missed.and_then(|missed| missed.last_report) else {
        return Ok(None);
    };

    let Some(reported) = recording.read(tick, tick.saturating_add(1))?.pop() else {
        return Ok(None);
    };
    let report = reported.reports.get(&robot.name);
    let mut placed = reported.frame.robots.iter();
    let placed = placed.find(|placed| placed.name == robot.name);
    Ok(report
        .zip(placed)
        .map(|(report, placed)| report.state(placed.location)))
}
