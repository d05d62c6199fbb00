//! What observers see. Without observers it costs nothing, and no observer can hold the clock.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Query, WatchedPublisher};
use protocol::encode;
use protocol::keys::Keys;
use protocol::messages::{
    Awaited, ControlAnswer, Flight, LogKind, LogRecord, MAX_ENTRIES, MAX_FLIGHTS, Phase,
    StaticWorld, Status, WorldFrame,
};
use protocol::time::seconds;
use protocol::{Epoch, Event, Tick};

/// Frames are put no more often than this: people look at them.
pub(super) const FRAME_INTERVAL: Duration = Duration::from_millis(33);
/// Where the clock has a pace, panels are asked for no more often than this, so that a recording has those of every tick. At full
/// speed they are asked for with frames only: a tick takes less time than its panels.
const PANEL_INTERVAL: Duration = Duration::from_millis(5);

/// While the clock goes on, what does not change in an epoch is put no more often than this.
const STATIC_INTERVAL: Duration = Duration::from_secs(1);

/// Most bytes of texts among the lines of the log that are kept: with escapes and the other fields, all of them fit into one
/// message.
const MAX_PAST_BYTES: usize = 128 << 10;

/// What observers see of a tick. At full speed that is nothing of most ticks, which cost neither frame nor panels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TickVisibility {
    /// Nothing.
    Hidden,
    /// The panels, which are recorded.
    Panels,
    /// The panels, and then a frame.
    Frame,
}

pub(super) struct Observers {
    world: WatchedPublisher,
    log: WatchedPublisher,
    /// When the last tick began of which a frame is put; `None` puts one of the next tick.
    frame_at: Option<Instant>,
    /// When the last tick began whose panels were asked for.
    panels_at: Option<Instant>,
    /// For observers that come later.
    past_lines: PastLines,
    /// What became of commands since the last frame.
    flights: VecDeque<Flight>,
    /// How often a replay has been moved.
    jumps: u32,
    /// Epoch and tick of the last frame.
    last_frame: Option<(Epoch, Tick)>,
    /// The epoch of which the static world was put last, and when.
    static_world_at: Option<(Epoch, Instant)>,
}

impl Observers {
    pub(super) fn new(bus: &Bus, keys: &Keys) -> Result<Self, BusError> {
        Ok(Self {
            world: bus.observer_publisher(&keys.world())?,
            log: bus.observer_publisher(&keys.log())?,
            frame_at: None,
            panels_at: None,
            past_lines: PastLines::default(),
            flights: VecDeque::new(),
            jumps: 0,
            last_frame: None,
            static_world_at: None,
        })
    }

    pub(super) fn has_subscribers(&self) -> bool {
        self.world.has_subscribers()
    }

    /// A tick begins: what observers see of it. After a tick that `is_last` the clock stops.
    pub(super) fn begin_tick(&mut self, is_last: bool, is_paced: bool) -> TickVisibility {
        let is_due =
            |last: Option<Instant>, interval| last.is_none_or(|last| last.elapsed() >= interval);
        if is_last || is_due(self.frame_at, FRAME_INTERVAL) {
            self.frame_at = Some(Instant::now());
            self.panels_at = self.frame_at;
            TickVisibility::Frame
        } else if is_paced && is_due(self.panels_at, PANEL_INTERVAL) {
            self.panels_at = Some(Instant::now());
            TickVisibility::Panels
        } else {
            TickVisibility::Hidden
        }
    }

    /// A frame of the next tick is put, however soon it begins.
    pub(super) fn show_next(&mut self) {
        self.frame_at = None;
    }

    /// A replay has been moved: observers forget what they know of commands, and the next frame has what is known before its
    /// tick.
    pub(super) fn jump(&mut self, known: Vec<Flight>) {
        self.flights.clear();
        self.jumps += 1;
        self.add_flights(known);
    }

    /// Puts a frame, with the flights since the one before, and where it is due with what does not change in its epoch.
    pub(super) fn put(
        &mut self,
        mut frame: WorldFrame,
        static_world: impl FnOnce() -> StaticWorld,
    ) {
        let at = (frame.epoch, frame.tick);
        // A console that has just connected asks for a frame, and while the clock stands there is no other one.
        let is_again = self.last_frame.replace(at) == Some(at);
        let is_due = is_again
            || frame.phase != Phase::Running
            || self
                .static_world_at
                .is_none_or(|(epoch, at)| epoch != frame.epoch || at.elapsed() >= STATIC_INTERVAL);
        if is_due {
            frame.static_world = Some(static_world());
            self.static_world_at = Some((frame.epoch, Instant::now()));
        }
        // Also those of ticks that no frame has shown: what became of a command is seen once.
        frame.flights = std::mem::take(&mut self.flights).into();
        frame.jumps = self.jumps;
        put_lossy(&self.world, encode(&frame));
    }

    /// Notes what the next frame shows of the events of a tick.
    pub(super) fn note(&mut self, tick: Tick, events: &[Event]) {
        // Without observers nothing is noted, and so nothing grows.
        if !self.world.has_subscribers() {
            return;
        }
        self.add_flights(events.iter().filter_map(|event| event.flight(tick)));
    }

    fn add_flights(&mut self, flights: impl IntoIterator<Item = Flight>) {
        for flight in flights {
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
            lines
                .iter()
                .for_each(|line| put_lossy(&self.log, encode(line)));
        }
    }

    /// Answers an observer that has come later than the first lines of the log.
    pub(super) fn answer_log(&self, query: &Query) {
        let lines = self.past_lines.lines.iter().cloned().collect();
        let answer = ControlAnswer::Log { lines };
        query.reply(query.key(), encode(&answer));
    }

    /// Logs that the clock is held, and for whom. Returns the line.
    pub(super) fn log_held(&mut self, status: &Status) -> Option<LogRecord> {
        if status.awaiting.is_empty() {
            return None;
        }
        let text = format!(
            "the clock is held at {} s: waiting for {}",
            seconds(status.time_s, status.tick_s),
            name_all(&status.awaiting)
        );
        Some(self.log_late(status, &text))
    }

    /// Logs something about robots that are late. Returns the line.
    pub(super) fn log_late(&mut self, status: &Status, text: &str) -> LogRecord {
        tracing::warn!("{text}");
        self.log_line(status, LogKind::Late, text)
    }

    /// Logs something about how things stand. Returns the line.
    pub(super) fn log_line(&mut self, status: &Status, kind: LogKind, text: &str) -> LogRecord {
        let line = LogRecord {
            epoch: status.epoch,
            tick: status.tick,
            time_s: status.time_s,
            tick_s: status.tick_s,
            source: "simulator".to_owned(),
            kind,
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
        // Two limits, because an answer has both: entries of a list, and bytes of a message.
        while self.lines.len() > MAX_ENTRIES || self.bytes > MAX_PAST_BYTES {
            let dropped = self.lines.pop_front();
            self.bytes -= dropped.map_or(self.bytes, |dropped| dropped.text.len());
        }
    }
}

/// Puts what observers receive: what cannot be put is worth no more than a note.
pub(super) fn put_lossy(to: &WatchedPublisher, message: Vec<u8>) {
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
