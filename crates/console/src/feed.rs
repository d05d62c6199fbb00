//! What a run shows now. The live connection writes it; every browser reads it at its own pace.
//!
//! A browser has a [`Cursor`] and no queue: when it is ready, it takes what is new since its last batch. A frame replaces its
//! predecessor, so the newest wins, and comes with the panels of its tick: one of another tick is never shown. The last lines
//! of the log are kept, and a browser that is too slow for some is told how many it missed. So memory is bounded however slowly
//! a browser reads.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::extract::ws::Utf8Bytes;
use protocol::messages::{Flight, LogRecord, MAX_FLIGHTS, StaticWorld, TickPanel, WorldFrame};
use protocol::{Epoch, RobotName, Tick};
use tokio::sync::watch;

use crate::page::ServerMessage;

/// Lines of the log that are kept for browsers that connect later or read slowly.
pub(crate) const MAX_LINES: usize = 2000;
/// Most lines in one message.
const MAX_LINES_PER_MESSAGE: usize = 500;
/// Most bytes of panels, of all robots together: the number of robots and the size of a panel are not ours to choose.
const MAX_PANEL_BYTES: usize = 32 << 20;

/// What a run shows now.
pub(crate) struct Feed {
    state: Mutex<FeedState>,
    /// Notified of every change of `state`.
    changed: watch::Sender<()>,
}

#[derive(Default)]
struct FeedState {
    /// Whether the simulator's liveliness token is declared.
    is_present: bool,
    /// Whether it ever was.
    was_present: bool,
    frame: Option<EncodedFrame>,
    /// Number of the newest frame, from 1.
    frame_count: u64,
    /// The fates of commands, numbered like the frames that reported them.
    flights: VecDeque<Numbered<Flight>>,
    /// What does not change in the epoch, numbered like the frame that had it first.
    static_world: Option<Numbered<Arc<StaticWorld>>>,
    /// The panels of the frame's tick.
    panels: BTreeMap<RobotName, Numbered<Utf8Bytes>>,
    /// Number of the newest of these, counted over all robots, from 1.
    panel_count: u64,
    /// The newest panels of other ticks: robots put theirs before the simulator can put the frame of their tick.
    early_panels: BTreeMap<RobotName, EarlyPanel>,
    lines: VecDeque<Numbered<LogRecord>>,
    /// Lines that arrived since the simulator appeared, each with the number of lines that were lost before it. Those before
    /// them are yet to come.
    held_lines: Option<VecDeque<(LogRecord, u64)>>,
    /// Number of the next line; a gap in the numbers is lines that were lost.
    next_line: u64,
}

struct Numbered<T> {
    number: u64,
    value: T,
}

/// A panel whose frame has not arrived.
struct EarlyPanel {
    at: (Epoch, Tick),
    text: Utf8Bytes,
}

/// A frame, and the message for browsers that have seen the frame before.
#[derive(Clone)]
struct EncodedFrame {
    frame: Arc<WorldFrame>,
    text: Utf8Bytes,
}

/// How far a browser has read.
#[derive(Debug, Default)]
pub(crate) struct Cursor {
    is_present: Option<bool>,
    frame: u64,
    panel: u64,
    /// `None` before the first line.
    next_line: Option<u64>,
}

impl Feed {
    /// A feed without a simulator.
    pub(crate) fn new() -> Self {
        Self {
            state: Mutex::default(),
            changed: watch::Sender::new(()),
        }
    }

    fn lock(&self) -> MutexGuard<'_, FeedState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change<T>(&self, change: impl FnOnce(&mut FeedState) -> T) -> T {
        let outcome = change(&mut self.lock());
        // After the change and without its lock: a browser that wakes finds it, and need not wait.
        self.changed.send_replace(());
        outcome
    }

    /// Notifies of changes.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// The simulator's liveliness token was declared or undeclared. Lines of a simulator that has just appeared are held back
    /// until [`Feed::catch_up`].
    pub(crate) fn set_present(&self, is_present: bool) {
        self.change(|state| {
            if is_present && !state.is_present {
                // Lines put before this console could receive them are still to be fetched, and come
                // before these.
                state.held_lines = Some(VecDeque::new());
            }
            state.is_present = is_present;
            state.was_present |= is_present;
        });
    }

    /// Whether the simulator's liveliness token is declared.
    pub(crate) fn is_present(&self) -> bool {
        self.lock().is_present
    }

    /// Whether the simulator's liveliness token has been declared at least once.
    pub(crate) fn was_present(&self) -> bool {
        self.lock().was_present
    }

    /// Whether lines are held back.
    pub(crate) fn lacks_lines(&self) -> bool {
        self.lock().held_lines.is_some()
    }

    /// Number of frames so far.
    pub(crate) fn frame_count(&self) -> u64 {
        self.lock().frame_count
    }

    /// Replaces the frame. The panels that are shown are those of its tick.
    pub(crate) fn put_frame(&self, frame: WorldFrame) {
        let text = ServerMessage::Frame { frame: &frame }.text();
        let encoded = EncodedFrame {
            frame: Arc::new(frame),
            text,
        };

        self.change(|state| state.put_frame(encoded));
    }

    /// Replaces a robot's panel.
    ///
    /// # Errors
    /// All panels together would exceed [`MAX_PANEL_BYTES`].
    pub(crate) fn put_panel(&self, robot: &RobotName, panel: &TickPanel) -> Result<(), String> {
        let at = (panel.epoch, panel.tick);
        let text = ServerMessage::Panel { robot, panel }.text();

        self.change(|state| state.put_panel(robot, EarlyPanel { at, text }))
    }

    /// Adds the lines of the simulator before its first one that arrived here, of its last lines; without them, what has
    /// arrived here.
    pub(crate) fn catch_up(&self, lines: Option<Vec<LogRecord>>) {
        self.change(|state| state.catch_up(lines));
    }

    /// Adds a line of the log; `lost` lines before it could not be kept.
    pub(crate) fn add_line(&self, line: LogRecord, lost: u64) {
        self.change(|state| state.add_line(line, lost));
    }

    /// The messages that are new since `cursor`, which moves on; empty if nothing is new.
    pub(crate) fn take_new(&self, cursor: &mut Cursor) -> Vec<Utf8Bytes> {
        let mut messages = Vec::new();

        let state = self.lock();
        messages.extend(state.new_presence(cursor));
        messages.extend(state.new_panels(cursor));
        let lines = state.new_lines(cursor);
        let frame = state.new_frame(cursor);
        drop(state);

        // These are encoded for this browser alone, and therefore without the lock.
        messages.extend(lines.map(|lines| lines.message()));
        messages.extend(frame.map(NewFrame::message));
        messages
    }
}

impl FeedState {
    fn put_frame(&mut self, encoded: EncodedFrame) {
        let frame = &encoded.frame;
        let previous = self.frame.as_ref().map(|previous| &previous.frame);
        let is_new_epoch = previous.is_some_and(|previous| previous.epoch != frame.epoch);
        // Ticks of a new epoch begin at 0 again, and a replay that has been moved tells all anew: a flight of
        // before would be shown in it.
        let has_jumped = previous.is_some_and(|previous| previous.jumps != frame.jumps);
        if is_new_epoch || has_jumped {
            self.flights.clear();
        }
        if is_new_epoch {
            self.static_world = None;
        }

        self.frame_count += 1;
        let number = self.frame_count;
        if let Some(new) = &frame.static_world
            && self
                .static_world
                .as_ref()
                .is_none_or(|known| *known.value != *new)
        {
            let value = Arc::new(new.clone());
            self.static_world = Some(Numbered { number, value });
        }
        let flights = frame.flights.iter().cloned();
        self.flights
            .extend(flights.map(|value| Numbered { number, value }));
        let surplus = self.flights.len().saturating_sub(MAX_FLIGHTS);
        self.flights.drain(..surplus);

        let at = (frame.epoch, frame.tick);
        if previous.is_none_or(|previous| (previous.epoch, previous.tick) != at) {
            self.panels.clear();
        }
        self.frame = Some(encoded);
        for (robot, panel) in std::mem::take(&mut self.early_panels) {
            // The others are of a tick whose frame is yet to come, or of one that no frame has shown.
            if panel.at == at {
                self.show_panel(robot, panel.text);
            } else {
                self.early_panels.insert(robot, panel);
            }
        }
    }

    fn put_panel(&mut self, robot: &RobotName, panel: EarlyPanel) -> Result<(), String> {
        let is_of_frame = self
            .frame
            .as_ref()
            .is_some_and(|EncodedFrame { frame, .. }| (frame.epoch, frame.tick) == panel.at);
        // What it replaces does not count.
        if is_of_frame {
            self.panels.remove(robot);
        } else {
            self.early_panels.remove(robot);
        }
        if self.panel_bytes() + panel.text.len() > MAX_PANEL_BYTES {
            return Err(format!(
                "panels are larger than the {MAX_PANEL_BYTES} bytes allowed together"
            ));
        }

        if is_of_frame {
            self.show_panel(robot.clone(), panel.text);
        } else {
            self.early_panels.insert(robot.clone(), panel);
        }
        Ok(())
    }

    fn show_panel(&mut self, robot: RobotName, value: Utf8Bytes) {
        self.panel_count += 1;
        let number = self.panel_count;
        self.panels.insert(robot, Numbered { number, value });
    }

    fn panel_bytes(&self) -> usize {
        let shown = self.panels.values().map(|panel| panel.value.len());
        let early = self.early_panels.values().map(|panel| panel.text.len());
        shown.chain(early).sum()
    }

    /// Adds those of the simulator's last lines that are not known, and then those that were held and are newer.
    fn catch_up(&mut self, lines: Option<Vec<LogRecord>>) {
        let held = self.held_lines.take().unwrap_or_default();
        let lines = lines.unwrap_or_default();
        // A line that arrived while the others were fetched may be among these as well. It is left out
        // of those that were held, and so are all before it.
        let is_told = held.iter().rposition(|(line, _)| lines.contains(line));
        let newer = is_told.map_or(0, |index| index + 1);

        // After a simulator that has come back, the feed knows the first of them already.
        let last = self.lines.back().map(|line| &line.value);
        let is_known = lines.iter().rposition(|line| Some(line) == last);
        let new = is_known.map_or(0, |index| index + 1);
        for line in lines.into_iter().skip(new) {
            self.add_line(line, 0);
        }
        for (line, lost) in held.into_iter().skip(newer) {
            self.add_line(line, lost);
        }
    }

    fn add_line(&mut self, line: LogRecord, lost: u64) {
        if let Some(held) = &mut self.held_lines {
            if held.len() == MAX_LINES {
                held.pop_front();
            }
            held.push_back((line, lost));
            return;
        }

        // Lines that were lost have numbers, too: the gap is what a browser is told.
        let number = self.next_line + lost;
        self.next_line = number + 1;

        if self.lines.len() == MAX_LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(Numbered {
            number,
            value: line,
        });
    }

    fn new_presence(&self, cursor: &mut Cursor) -> Option<Utf8Bytes> {
        if cursor.is_present == Some(self.is_present) {
            return None;
        }
        cursor.is_present = Some(self.is_present);

        let message = ServerMessage::Simulator {
            present: self.is_present,
        };
        Some(message.text())
    }

    fn new_panels(&self, cursor: &mut Cursor) -> Vec<Utf8Bytes> {
        let seen = cursor.panel;
        cursor.panel = self.panel_count;

        self.panels
            .values()
            .filter(|panel| panel.number > seen)
            .map(|panel| panel.value.clone())
            .collect()
    }

    /// The newest frame, with the flights of the frames that the browser skipped.
    fn new_frame(&self, cursor: &mut Cursor) -> Option<NewFrame> {
        let encoded = self.frame.as_ref()?;
        let seen = cursor.frame;
        if seen == self.frame_count {
            return None;
        }
        cursor.frame = self.frame_count;

        // A browser that has just connected to a run in progress finds in its recording what was sent
        // before. Of a replay there is only what is kept here.
        let has_skipped = seen + 1 < self.frame_count;
        let is_told = has_skipped && (seen != 0 || encoded.frame.replay_of.is_some());
        let flights = self
            .flights
            .iter()
            .filter(|flight| is_told && flight.number > seen)
            .map(|flight| flight.value.clone())
            .collect();
        let known = self.static_world.as_ref();
        let unseen = known.filter(|known| known.number > seen);
        Some(NewFrame {
            encoded: encoded.clone(),
            flights,
            static_world: unseen.map(|known| known.value.clone()),
        })
    }

    fn new_lines(&self, cursor: &mut Cursor) -> Option<NewLines> {
        let oldest = self
            .lines
            .front()
            .map_or(self.next_line, |line| line.number);
        let wanted = cursor.next_line.unwrap_or(oldest);

        let from = self.lines.partition_point(|line| line.number < wanted);
        let to = self.lines.len().min(from + MAX_LINES_PER_MESSAGE);
        let new = self.lines.range(from..to);
        // Where nothing is new, the cursor stays.
        let next = new.clone().next_back()?.number + 1;
        cursor.next_line = Some(next);

        let lines: Vec<LogRecord> = new.map(|line| line.value.clone()).collect();
        // Numbers that no line has: those that were lost before they came here, and those that this
        // browser was too slow for.
        let dropped = next - wanted - lines.len() as u64;
        Some(NewLines { lines, dropped })
    }
}

/// A frame that is new for a browser.
struct NewFrame {
    encoded: EncodedFrame,
    /// Flights of the skipped frames and of this one; empty if none were skipped.
    flights: Vec<Flight>,
    /// What does not change in the epoch, if no frame that the browser got had it.
    static_world: Option<Arc<StaticWorld>>,
}

impl NewFrame {
    fn message(self) -> Utf8Bytes {
        let frame = self.encoded.frame;
        // Nothing was skipped: the text that all browsers share is enough.
        let has_flights = self.flights.len() <= frame.flights.len();
        let has_static_world = self.static_world.is_none() || frame.static_world.is_some();
        if has_flights && has_static_world {
            return self.encoded.text;
        }

        let mut frame = (*frame).clone();
        if !has_flights {
            frame.flights = self.flights;
        }
        if let Some(unseen) = self.static_world {
            frame.static_world = Some((*unseen).clone());
        }
        ServerMessage::Frame { frame: &frame }.text()
    }
}

/// Lines that are new for a browser.
struct NewLines {
    lines: Vec<LogRecord>,
    /// How many lines before them the browser missed.
    dropped: u64,
}

impl NewLines {
    fn message(&self) -> Utf8Bytes {
        let message = ServerMessage::Log {
            lines: &self.lines,
            dropped: self.dropped,
        };
        message.text()
    }
}

#[cfg(test)]
mod tests;
