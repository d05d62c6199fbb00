//! What observers see. Without observers it costs nothing, and no observer can hold the clock.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Publisher, Query};
use protocol::encode;
use protocol::keys::Keys;
use protocol::messages::{
    Awaited, ControlAnswer, Flight, LogKind, LogRecord, MAX_ENTRIES, MAX_FLIGHTS, Presence,
    RobotFrame, Status, WorldFrame,
};
use protocol::time::seconds;
use protocol::{Event, RobotName, Tick};

use crate::simulation::Simulation;

/// Pictures are for eyes: no more often than this.
pub(super) const FRAME_INTERVAL: Duration = Duration::from_millis(33);

/// In every tick the clock waits a short time for each robot.
const LATE_S: f64 = 0.5;

/// Most bytes of texts among the lines of the log that are kept: with escapes and the other fields, all of them fit into one
/// message.
const MAX_PAST_BYTES: usize = 128 << 10;

pub(super) struct Observers {
    world: Publisher,
    log: Publisher,
    painted: Instant,
    /// Whether a tick is complete that no frame has shown.
    is_owed: bool,
    /// For observers that come later.
    past_lines: PastLines,
    /// What became of commands since the last frame.
    flights: VecDeque<Flight>,
}

impl Observers {
    pub(super) fn new(bus: &Bus, keys: &Keys) -> Result<Self, BusError> {
        Ok(Self {
            world: bus.observer_publisher(&keys.world())?,
            log: bus.observer_publisher(&keys.log())?,
            painted: Instant::now(),
            is_owed: false,
            past_lines: PastLines::default(),
            flights: VecDeque::new(),
        })
    }

    pub(super) fn has_subscribers(&self) -> bool {
        self.world.has_subscribers()
    }

    /// A tick is complete: observers see it, unless another one is complete before it is time for a frame.
    pub(super) fn owe_frame(&mut self) {
        self.is_owed = self.world.has_subscribers();
    }

    /// After how long it is time for the frame that observers are owed; `None` if there is none.
    pub(super) fn frame_due_in(&self) -> Option<Duration> {
        let rest = FRAME_INTERVAL.saturating_sub(self.painted.elapsed());
        self.is_owed.then_some(rest)
    }

    pub(super) fn frame(&mut self, simulation: &Simulation, status: &Status) {
        self.put(paint(simulation, status));
    }

    /// Forgets what the next frame would show of earlier ticks.
    pub(super) fn forget(&mut self) {
        self.flights.clear();
    }

    /// Puts a frame, with the flights since the one before.
    pub(super) fn put(&mut self, mut frame: WorldFrame) {
        self.painted = Instant::now();
        self.is_owed = false;
        frame.flights = std::mem::take(&mut self.flights).into();
        show(&self.world, encode(&frame));
    }

    /// Notes what the next frame shows of the events of a tick.
    pub(super) fn note(&mut self, tick: Tick, events: &[Event]) {
        if !self.world.has_subscribers() {
            return;
        }
        for flight in events.iter().filter_map(|event| event.flight(tick)) {
            if self.flights.len() == MAX_FLIGHTS {
                self.flights.pop_front();
            }
            self.flights.push_back(flight);
        }
    }

    pub(super) fn log(&mut self, lines: &[LogRecord]) {
        for line in lines {
            self.past_lines.add(line);
        }
        if self.log.has_subscribers() {
            lines.iter().for_each(|line| show(&self.log, encode(line)));
        }
    }

    /// Answers an observer that has come later than the first lines of the log.
    pub(super) fn answer_log(&self, query: &Query) {
        let lines = self.past_lines.lines.iter().cloned().collect();
        let answer = ControlAnswer::Log { lines };
        query.reply(query.key(), encode(&answer));
    }

    /// The clock is held: say for whom. Returns the line of the log.
    pub(super) fn held(&mut self, simulation: &Simulation, status: &Status) -> Option<LogRecord> {
        if status.awaiting.is_empty() {
            return None;
        }
        let text = format!(
            "the clock is held at {} s: waiting for {}",
            seconds(status.time_s, simulation.scenario().tick_s),
            name_all(&status.awaiting)
        );
        let line = self.late(simulation, &text);
        self.frame(simulation, status);
        Some(line)
    }

    /// The clock goes on. Returns the line of the log.
    pub(super) fn released(&mut self, simulation: &Simulation, status: &Status) -> LogRecord {
        let line = self.late(simulation, "the clock goes on");
        self.frame(simulation, status);
        line
    }

    fn late(&mut self, simulation: &Simulation, text: &str) -> LogRecord {
        tracing::warn!("{text}");

        let tick = simulation.tick();
        let line = LogRecord {
            epoch: simulation.epoch(),
            tick,
            time_s: simulation.time_s(tick),
            tick_s: simulation.scenario().tick_s,
            source: "simulator".to_owned(),
            kind: LogKind::Late,
            text: text.to_owned(),
        };
        let line = line.fitted();

        self.log(std::slice::from_ref(&line));
        line
    }
}

/// The last lines of the log.
#[derive(Default)]
struct PastLines {
    lines: VecDeque<LogRecord>,
    /// Bytes of their texts.
    bytes: usize,
}

impl PastLines {
    fn add(&mut self, line: &LogRecord) {
        self.bytes += line.text.len();
        self.lines.push_back(line.clone());
        while self.lines.len() > MAX_ENTRIES || self.bytes > MAX_PAST_BYTES {
            let dropped = self.lines.pop_front();
            self.bytes -= dropped.map_or(self.bytes, |dropped| dropped.text.len());
        }
    }
}

/// Watchers come and go; a picture that cannot be shown is not worth more than a note.
fn show(to: &Publisher, message: Vec<u8>) {
    if let Err(error) = to.put(message) {
        tracing::debug!("{error}");
    }
}

fn name_all(awaiting: &[Awaited]) -> String {
    let one = |awaited: &Awaited| {
        format!(
            "{} ({}, since {:.1} s)",
            awaited.name, awaited.because, awaited.since_s
        )
    };
    awaiting.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The field now, without flights.
fn paint(simulation: &Simulation, status: &Status) -> WorldFrame {
    let world = simulation.world();
    let scenario = simulation.scenario();

    let mut late = Vec::new();
    for awaited in &status.awaiting {
        if awaited.since_s > LATE_S {
            late.push(awaited.name.clone());
        }
    }

    let mut robots = Vec::with_capacity(simulation.names().len());
    for name in simulation.names() {
        robots.push(robot_frame(simulation, status, name));
    }

    WorldFrame {
        run: status.run.clone(),
        epoch: status.epoch,
        tick: status.tick,
        time_s: status.time_s,
        duration_s: status.duration_s,
        tick_s: scenario.tick_s,
        seed: status.seed,
        replay_of: None,
        speed: status.speed,
        phase: status.phase,
        awaiting: status.awaiting.clone(),
        field_m: scenario.field_m,
        body_m: scenario.body_m,
        robots,
        // In whole millimeters, as in the recording: a tick looks the same live and recorded.
        guests: world
            .guests()
            .iter()
            .map(|guest| [millimeters(guest.x), millimeters(guest.y)])
            .collect(),
        obstacles: world
            .obstacles()
            .iter()
            .map(|obstacle| [obstacle.x, obstacle.y])
            .collect(),
        flights: Vec::new(),
        cuts: simulation.cuts(),
        faults: simulation.held_processes(&late),
        expectations: simulation.standings(),
    }
}

/// A robot now.
fn robot_frame(simulation: &Simulation, status: &Status, name: &RobotName) -> RobotFrame {
    let report = simulation.report(name);
    let process = status.robots.iter().find(|robot| robot.name == *name);

    RobotFrame {
        name: name.clone(),
        location: simulation.location(name).unwrap_or_default(),
        speed_mps: report.map_or(0.0, |report| report.speed_mps),
        direction_rad: report.map_or(0.0, |report| report.direction_rad),
        blocked: simulation.is_blocked(name),
        emotion_state: report
            .map(|report| report.emotion_state.clone())
            .unwrap_or_default(),
        behavior_state: report
            .map(|report| report.behavior_state.clone())
            .unwrap_or_default(),
        state_variables: report
            .map(|report| report.state_variables.clone())
            .unwrap_or_default(),
        generation: process.map_or(0, |process| process.generation),
        presence: process.map_or(Presence::Gone, |process| process.presence),
    }
}

/// A length in meters, rounded to whole millimeters.
fn millimeters(length_m: f64) -> f64 {
    (length_m * 1000.0).round() / 1000.0
}
