//! What there is to see now. The bus writes on it, browsers read from it, each at its own pace.
//!
//! A browser has a [`Cursor`] and no queue: when it is ready for more it takes what is new since the last time. Pictures
//! and panels are replaced, so the newest wins; lines of the log are kept for a while, so a browser that comes too late
//! for some is told how many it missed. However slow somebody reads, nothing piles up anywhere.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::extract::ws::Utf8Bytes;
use protocol::RobotName;
use protocol::messages::{Flight, LogRecord, MAX_FLIGHTS, Panel, WorldFrame};
use tokio::sync::watch;

use crate::page::ToPage;

/// Lines of the log that are kept for those who come late.
pub(crate) const MAX_LINES: usize = 2000;
/// Most lines in one message.
const LINES_AT_ONCE: usize = 500;
/// Most bytes of panels, all robots together: robots choose their panels, and their number is theirs to choose, too.
const MAX_PANEL_BYTES: usize = 32 << 20;

/// What there is to see.
pub(crate) struct Board {
    inner: Mutex<Inner>,
    /// Changes whenever something is new.
    changed: watch::Sender<()>,
}

#[derive(Default)]
struct Inner {
    /// Whether the simulator is there.
    is_present: bool,
    picture: Option<Picture>,
    /// Number of the newest picture, from 1.
    pictures: u64,
    /// What became of commands, with the number of the picture that told it.
    flights: VecDeque<(u64, Flight)>,
    panels: BTreeMap<RobotName, (u64, Utf8Bytes)>,
    /// Number of the newest panel, of all robots, from 1.
    painted: u64,
    lines: VecDeque<(u64, LogRecord)>,
    /// Number of the next line; a gap before it is lines that were lost.
    next_line: u64,
}

/// The newest frame, and the message that shows it to those who have seen the one before.
#[derive(Clone)]
struct Picture {
    frame: Arc<WorldFrame>,
    text: Utf8Bytes,
}

/// How far somebody has seen.
#[derive(Debug, Default)]
pub(crate) struct Cursor {
    present: Option<bool>,
    picture: u64,
    panel: u64,
    line: Option<u64>,
}

impl Board {
    /// An empty board.
    pub(crate) fn new() -> Self {
        Self {
            inner: Mutex::default(),
            changed: watch::Sender::new(()),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change<T>(&self, change: impl FnOnce(&mut Inner) -> T) -> T {
        let outcome = change(&mut self.lock());
        self.changed.send_replace(());
        outcome
    }

    /// Tells when something is new.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// The simulator came or went.
    pub(crate) fn set_present(&self, is_present: bool) {
        self.change(|inner| inner.is_present = is_present);
    }

    /// Whether the simulator is there.
    pub(crate) fn is_present(&self) -> bool {
        self.lock().is_present
    }

    /// Number of the newest picture.
    pub(crate) fn pictures(&self) -> u64 {
        self.lock().pictures
    }

    /// A new picture replaces the one before. Panels of robots that are not in it are taken away.
    pub(crate) fn show(&self, frame: WorldFrame) {
        let text = ToPage::Frame { frame: &frame }.text();
        self.change(|inner| {
            inner.pictures += 1;
            if inner
                .picture
                .as_ref()
                .is_some_and(|picture| picture.frame.epoch != frame.epoch)
            {
                inner.flights.clear();
            }
            let number = inner.pictures;
            inner
                .flights
                .extend(frame.flights.iter().map(|flight| (number, flight.clone())));
            let surplus = inner.flights.len().saturating_sub(MAX_FLIGHTS);
            inner.flights.drain(..surplus);
            inner
                .panels
                .retain(|name, _| frame.robots.iter().any(|robot| robot.name == *name));
            inner.picture = Some(Picture {
                frame: Arc::new(frame),
                text,
            });
        });
    }

    /// A robot's new panel replaces the one before.
    ///
    /// # Errors
    /// Why it is not shown: too much of them.
    pub(crate) fn paint(&self, robot: &RobotName, panel: &Panel) -> Result<(), String> {
        let text = ToPage::Panel { robot, panel }.text();
        self.change(|inner| {
            let others = inner.panels.iter().filter(|(name, _)| *name != robot);
            let bytes: usize = others.map(|(_, (_, text))| text.len()).sum();
            if bytes + text.len() > MAX_PANEL_BYTES {
                return Err(format!(
                    "panels are larger than the {MAX_PANEL_BYTES} bytes allowed together"
                ));
            }
            inner.painted += 1;
            inner.panels.insert(robot.clone(), (inner.painted, text));
            Ok(())
        })
    }

    /// A line of the log; `lost` before it could not be kept.
    pub(crate) fn log(&self, line: LogRecord, lost: u64) {
        self.change(|inner| {
            let number = inner.next_line + lost;
            inner.next_line = number + 1;
            if inner.lines.len() == MAX_LINES {
                inner.lines.pop_front();
            }
            inner.lines.push_back((number, line));
        });
    }

    /// What is new for somebody, as messages; afterwards it is not new any more. Empty if there is nothing.
    pub(crate) fn news(&self, cursor: &mut Cursor) -> Vec<Utf8Bytes> {
        let mut news = Vec::new();
        let inner = self.lock();
        if cursor.present != Some(inner.is_present) {
            cursor.present = Some(inner.is_present);
            news.push(
                ToPage::Simulator {
                    present: inner.is_present,
                }
                .text(),
            );
        }
        let skipped = inner.skipped(cursor);
        for (_, text) in inner
            .panels
            .values()
            .filter(|(number, _)| *number > cursor.panel)
        {
            news.push(text.clone());
        }
        cursor.panel = inner.painted;
        let (lines, dropped) = inner.lines_from(cursor);
        drop(inner);
        // Nobody waits for the lock while a browser's own messages are written.
        if !lines.is_empty() {
            news.push(
                ToPage::Log {
                    lines: &lines,
                    dropped,
                }
                .text(),
            );
        }
        news.extend(skipped.map(|(picture, flights)| picture.with(flights)));
        news
    }
}

impl Inner {
    /// The newest picture if it is new for somebody, and what the pictures in between told of commands.
    fn skipped(&self, cursor: &mut Cursor) -> Option<(Picture, Vec<Flight>)> {
        let picture = self
            .picture
            .clone()
            .filter(|_| self.pictures > cursor.picture)?;
        let is_next = cursor.picture + 1 == self.pictures || cursor.picture == 0;
        let told = self
            .flights
            .iter()
            .filter(|(number, _)| !is_next && *number > cursor.picture);
        let flights = told.map(|(_, flight)| flight.clone()).collect();
        cursor.picture = self.pictures;
        Some((picture, flights))
    }

    /// The next lines for somebody, and how many are missing before them.
    fn lines_from(&self, cursor: &mut Cursor) -> (Vec<LogRecord>, u64) {
        let oldest = self
            .lines
            .front()
            .map_or(self.next_line, |(number, _)| *number);
        let wanted = cursor.line.unwrap_or(oldest);
        let from = self.lines.partition_point(|(number, _)| *number < wanted);
        let taken = self.lines.range(from..).take(LINES_AT_ONCE);
        let Some((last, _)) = taken.clone().next_back() else {
            return (Vec::new(), 0);
        };
        let lines: Vec<LogRecord> = taken.map(|(_, line)| line.clone()).collect();
        let dropped = last + 1 - wanted - lines.len() as u64;
        cursor.line = Some(last + 1);
        (lines, dropped)
    }
}

impl Picture {
    /// The message for somebody who has not seen what `flights` tells.
    fn with(self, flights: Vec<Flight>) -> Utf8Bytes {
        if flights.len() <= self.frame.flights.len() {
            return self.text;
        }
        let frame = WorldFrame {
            flights,
            ..(*self.frame).clone()
        };
        ToPage::Frame { frame: &frame }.text()
    }
}

#[cfg(test)]
mod tests {
    use protocol::messages::{Fate, LogKind, Phase};
    use serde_json::Value;

    use super::*;

    fn frame(tick: u64) -> WorldFrame {
        let name = |name| RobotName::new(name).unwrap();
        let flight = Flight {
            tick,
            from: name("A"),
            to: name("B"),
            seq: tick,
            command: "x".to_owned(),
            fate: Fate::Sent,
        };
        WorldFrame {
            run: protocol::RunName::new("r").unwrap(),
            epoch: 1,
            tick,
            time_s: tick as f64,
            duration_s: 100.0,
            tick_s: 1.0,
            seed: 1,
            speed: None,
            phase: Phase::Running,
            awaiting: Vec::new(),
            field_m: [10.0, 10.0],
            body_m: 1.0,
            robots: Vec::new(),
            guests: vec![[1.0, 2.0]],
            obstacles: Vec::new(),
            flights: vec![flight],
            cuts: Vec::new(),
        }
    }

    fn line(tick: u64) -> LogRecord {
        let (source, text) = ("simulator".to_owned(), format!("line {tick}"));
        LogRecord {
            epoch: 1,
            tick,
            time_s: 0.0,
            source,
            kind: LogKind::Run,
            text,
        }
    }

    /// What is new, by type of message.
    fn news(board: &Board, cursor: &mut Cursor) -> Vec<(String, Value)> {
        let read = |text: Utf8Bytes| {
            let value: Value = serde_json::from_str(&text).unwrap();
            (value["type"].as_str().unwrap().to_owned(), value)
        };
        board.news(cursor).into_iter().map(read).collect()
    }

    #[test]
    fn everybody_is_told_what_is_new_and_nothing_twice() {
        let (board, mut cursor) = (Board::new(), Cursor::default());
        assert_eq!(news(&board, &mut cursor)[0].1["present"], false);
        assert!(news(&board, &mut cursor).is_empty());
        board.set_present(true);
        board.show(frame(1));
        board.log(line(1), 0);
        let kinds = |news: &[(String, Value)]| {
            news.iter()
                .map(|(kind, _)| kind.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            kinds(&news(&board, &mut cursor)),
            ["simulator", "log", "frame"]
        );
        assert!(news(&board, &mut cursor).is_empty());
        assert_eq!(
            kinds(&news(&board, &mut Cursor::default())),
            ["simulator", "log", "frame"]
        );
    }

    #[test]
    fn a_slow_browser_gets_the_newest_picture_with_the_flights_of_all() {
        let (board, mut cursor) = (Board::new(), Cursor::default());
        board.show(frame(1));
        assert_eq!(news(&board, &mut cursor)[1].1["frame"]["tick"], 1);
        for tick in 2..=400 {
            board.show(frame(tick));
        }
        let all = news(&board, &mut cursor);
        let [(_, shown)] = all.as_slice() else {
            panic!("{all:?}")
        };
        assert_eq!(shown["frame"]["tick"], 400);
        let flights = shown["frame"]["flights"].as_array().unwrap();
        assert_eq!(flights.len(), MAX_FLIGHTS);
        assert_eq!(
            (&flights[0]["tick"], &flights[MAX_FLIGHTS - 1]["tick"]),
            (&145.into(), &400.into())
        );
        board.show(frame(401));
        assert_eq!(
            news(&board, &mut cursor)[0].1["frame"]["flights"]
                .as_array()
                .unwrap()
                .len(),
            1
        );
        board.show(frame(402));
        board.show(WorldFrame {
            epoch: 2,
            ..frame(0)
        });
        let flights = &news(&board, &mut cursor)[0].1["frame"]["flights"];
        assert_eq!(
            flights.as_array().unwrap().len(),
            1,
            "those of an epoch before are over"
        );
    }

    #[test]
    fn missed_lines_are_counted() {
        let (board, mut cursor) = (Board::new(), Cursor::default());
        board.log(line(0), 0);
        assert_eq!(news(&board, &mut cursor)[1].1["dropped"], 0);
        for tick in 1..=2100 {
            board.log(line(tick), 0);
        }
        let mut seen = Vec::new();
        let mut dropped = Vec::new();
        while let Some((_, log)) = news(&board, &mut cursor).pop() {
            dropped.push(log["dropped"].as_u64().unwrap());
            seen.extend(
                log["lines"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|line| line["tick"].as_u64().unwrap()),
            );
        }
        assert_eq!(seen, (101..=2100).collect::<Vec<_>>());
        assert_eq!(dropped, [100, 0, 0, 0]);
        board.log(line(2101), 7);
        assert_eq!(
            news(&board, &mut cursor)[0].1["dropped"],
            7,
            "lost before they came here"
        );
        let late = news(&board, &mut Cursor::default()).pop().unwrap().1;
        assert_eq!(late["dropped"], 0, "who comes late has missed nothing");
    }

    #[test]
    fn panels_are_replaced_bounded_and_go_with_their_robots() {
        let board = Board::new();
        let name = |i: usize| RobotName::new(&format!("r{i}")).unwrap();
        let svg = |bytes: usize| Panel {
            widgets: vec![protocol::messages::Widget::Svg {
                label: String::new(),
                svg: "x".repeat(bytes),
            }],
        };
        let mut cursor = Cursor::default();
        board.paint(&name(1), &svg(1)).unwrap();
        board.paint(&name(1), &svg(2)).unwrap();
        assert_eq!(
            news(&board, &mut cursor)[1].1["panel"]["widgets"][0]["svg"],
            "xx"
        );
        let refused = (0..100).find(|i| board.paint(&name(*i), &svg(1 << 20)).is_err());
        assert!(
            (25..40).contains(&refused.expect("there is a limit")),
            "{refused:?}"
        );
        board.show(frame(1));
        assert_eq!(
            news(&board, &mut Cursor::default()).len(),
            2,
            "nobody of them is in the picture"
        );
    }
}
