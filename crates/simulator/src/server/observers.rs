//! What is shown to those who watch. Nobody watching costs nothing, and no watcher can hold the clock.

use std::time::{Duration, Instant};

use protocol::bus::{Bus, BusError, Publisher};
use protocol::encode;
use protocol::keys::Keys;
use protocol::messages::{Awaited, LogKind, LogRecord, RobotFrame, Status, WorldFrame};

use crate::simulation::Simulation;

/// Pictures are for eyes: no more often than this.
const FRAME_INTERVAL: Duration = Duration::from_millis(33);

pub(super) struct Observers {
    world: Publisher,
    log: Publisher,
    painted: Instant,
}

impl Observers {
    pub(super) fn new(bus: &Bus, keys: &Keys) -> Result<Self, BusError> {
        Ok(Self {
            world: bus.observer_publisher(&keys.world())?,
            log: bus.observer_publisher(&keys.log())?,
            painted: Instant::now(),
        })
    }

    pub(super) fn is_watched(&self) -> bool {
        self.world.is_watched()
    }

    pub(super) fn is_frame_due(&self) -> bool {
        self.world.is_watched() && self.painted.elapsed() >= FRAME_INTERVAL
    }

    pub(super) fn frame(&mut self, simulation: &Simulation, status: &Status) {
        self.painted = Instant::now();
        show(&self.world, encode(&paint(simulation, status)));
    }

    pub(super) fn log(&self, lines: &[LogRecord]) {
        if self.log.is_watched() {
            lines.iter().for_each(|line| show(&self.log, encode(line)));
        }
    }

    /// The clock is held: say for whom.
    pub(super) fn held(&mut self, simulation: &Simulation, status: &Status) {
        if status.awaiting.is_empty() {
            return;
        }
        let text = format!(
            "the clock is held at {:.1} s: waiting for {}",
            status.time_s,
            name_all(&status.awaiting)
        );
        self.late(simulation, &text);
        self.frame(simulation, status);
    }

    /// The clock goes on.
    pub(super) fn released(&mut self, simulation: &Simulation, status: &Status) {
        self.late(simulation, "the clock goes on");
        self.frame(simulation, status);
    }

    fn late(&self, simulation: &Simulation, text: &str) {
        tracing::warn!("{text}");
        let (epoch, tick) = (simulation.epoch(), simulation.tick());
        let (source, kind) = ("simulator".to_owned(), LogKind::Late);
        let line =
            LogRecord { epoch, tick, time_s: simulation.time_s(tick), source, kind, text: text.to_owned() };
        show(&self.log, encode(&line));
    }
}

/// Watchers come and go; a picture that cannot be shown is not worth more than a note.
fn show(to: &Publisher, message: Vec<u8>) {
    if let Err(error) = to.put(message) {
        tracing::debug!("{error}");
    }
}

fn name_all(awaiting: &[Awaited]) -> String {
    let one =
        |awaited: &Awaited| format!("{} ({}, since {:.1} s)", awaited.name, awaited.because, awaited.since_s);
    awaiting.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn paint(simulation: &Simulation, status: &Status) -> WorldFrame {
    let (world, scenario) = (simulation.world(), simulation.scenario());
    let robot = |name: &protocol::RobotName| {
        let report = simulation.report(name);
        RobotFrame {
            name: name.clone(),
            location: simulation.location(name).unwrap_or_default(),
            blocked: simulation.is_blocked(name),
            emotion_state: report.map(|report| report.emotion_state.clone()).unwrap_or_default(),
            behavior_state: report.map(|report| report.behavior_state.clone()).unwrap_or_default(),
        }
    };
    WorldFrame {
        run: status.run.clone(),
        epoch: status.epoch,
        tick: status.tick,
        time_s: status.time_s,
        duration_s: status.duration_s,
        phase: status.phase,
        awaiting: status.awaiting.clone(),
        field_m: scenario.field_m,
        body_m: scenario.body_m,
        robots: simulation.names().iter().map(robot).collect(),
        guests: world.guests().iter().map(|guest| [guest.x, guest.y]).collect(),
        obstacles: world.obstacles().iter().map(|obstacle| [obstacle.x, obstacle.y]).collect(),
    }
}
