//! What people see of a launch: lines and a progress bar. One thread writes; whoever has something to show hands it
//! over and goes on, so that a slow terminal holds neither a robot nor the clock.

use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

use protocol::event::log_line;
use protocol::messages::{LogKind, LogRecord};

use super::bar::{Bar, Progress};
use super::lines::harmless;

/// Lines that may wait for the terminal; more are counted and not shown. The run's folder has them all.
const MAX_WAITING: usize = 10_000;
/// Lines that are written in one go.
const BATCH: usize = 512;
/// While the clock is held the bar says for how long, to the second.
const HELD_INTERVAL: Duration = Duration::from_secs(1);
/// Colors of sources, one after the other: readable on dark and on light.
const COLORS: [&str; 6] = ["36", "33", "35", "32", "34", "31"];

/// Something to show.
enum Show {
    Log(LogRecord),
    Output { index: usize, line: String },
    Notice(String),
    Progress(Progress),
    Finish,
}

/// How things are shown.
#[derive(Debug, Clone)]
pub(super) struct Look {
    /// Names of the processes, in their order.
    pub(super) names: Vec<String>,
    /// Whether only warnings and errors are wanted.
    pub(super) is_quiet: bool,
    /// Whether standard output may have colors.
    pub(super) has_colors_out: bool,
    /// Whether the error output may have colors.
    pub(super) has_colors_err: bool,
    /// Whether a progress bar is drawn.
    pub(super) has_bar: bool,
}

impl Look {
    /// As this process's terminal, if it has one, can show it.
    pub(super) fn here(names: Vec<String>, is_quiet: bool) -> Self {
        let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let may_color = !is_set("NO_COLOR") && !is_dumb;
        let is_terminal = std::io::stderr().is_terminal();

        Self {
            names,
            is_quiet,
            has_colors_out: may_color && std::io::stdout().is_terminal(),
            has_colors_err: may_color && is_terminal,
            has_bar: is_terminal && !is_dumb && !is_quiet,
        }
    }
}

/// Hands things over to be shown.
#[derive(Debug, Clone)]
pub(super) struct Tell {
    queue: Sender<Show>,
    waiting: Arc<AtomicUsize>,
    dropped: Arc<AtomicUsize>,
    is_quiet: bool,
}

impl Tell {
    /// A line of the run's log.
    pub(super) fn log(&self, record: LogRecord) {
        // The simulator's own error output says at once for whom the clock waits, and the bar for how long.
        if record.kind != LogKind::Late {
            self.if_there_is_room(Show::Log(record));
        }
    }

    /// A line that a process printed.
    pub(super) fn output(&self, index: usize, line: String, is_error: bool) {
        if is_error || !self.is_quiet {
            self.if_there_is_room(Show::Output { index, line });
        }
    }

    /// How far the run is.
    pub(super) fn progress(&self, progress: Progress) {
        self.if_there_is_room(Show::Progress(progress));
    }

    /// The launcher's own words; never dropped.
    pub(super) fn notice(&self, text: impl Into<String>) {
        // Nobody is left to read it only when the launcher itself is at its end.
        let _unread = self.queue.send(Show::Notice(text.into()));
    }

    fn if_there_is_room(&self, show: Show) {
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= MAX_WAITING {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            self.dropped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let _unread = self.queue.send(show);
    }
}

/// The thread that writes.
pub(super) struct Screen {
    tell: Tell,
    thread: JoinHandle<()>,
}

impl Screen {
    /// Begins to show things on standard output and the error output.
    pub(super) fn open(look: Look) -> Self {
        let bar = look.has_bar.then(|| Bar::new(look.has_colors_err));
        Self::to(
            look,
            Box::new(std::io::stdout()),
            Box::new(std::io::stderr()),
            bar,
        )
    }

    fn to(look: Look, out: Writer, err: Writer, bar: Option<Bar>) -> Self {
        let (queue, shows) = std::sync::mpsc::channel();
        let (waiting, dropped) = (Arc::<AtomicUsize>::default(), Arc::<AtomicUsize>::default());
        let tell = Tell {
            queue,
            waiting,
            dropped,
            is_quiet: look.is_quiet,
        };
        let painter = Painter {
            look,
            out,
            err,
            bar,
            tell: tell.clone(),
        };

        Self {
            tell,
            thread: std::thread::spawn(move || painter.paint(&shows)),
        }
    }

    /// Where to hand things over.
    pub(super) fn tell(&self) -> Tell {
        self.tell.clone()
    }

    /// Shows what is waiting, and ends.
    pub(super) fn finish(self) {
        let _gone = self.tell.queue.send(Show::Finish);
        let _gone = self.thread.join();
    }
}

type Writer = Box<dyn Write + Send>;

struct Painter {
    look: Look,
    out: Writer,
    err: Writer,
    bar: Option<Bar>,
    tell: Tell,
}

/// Text for one of the two outputs.
struct Piece {
    is_out: bool,
    text: String,
}

impl Painter {
    fn paint(mut self, shows: &Receiver<Show>) {
        loop {
            let mut batch: Vec<Show> = self.next(shows).into_iter().collect();
            batch.extend(shows.try_iter().take(BATCH));
            let is_last = batch.iter().any(|show| matches!(show, Show::Finish));
            self.batch(batch);
            if is_last {
                break;
            }
        }

        self.say_dropped();

        if let Some(bar) = self.bar {
            bar.clear();
        }
    }

    /// The next thing to show, or nothing once a second while the clock is held.
    fn next(&self, shows: &Receiver<Show>) -> Option<Show> {
        if !self.bar.as_ref().is_some_and(Bar::is_held) {
            return Some(shows.recv().unwrap_or(Show::Finish));
        }
        match shows.recv_timeout(HELD_INTERVAL) {
            Ok(show) => Some(show),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Show::Finish),
        }
    }

    fn batch(&mut self, batch: Vec<Show>) {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut progress = None;
        for show in batch {
            if !matches!(show, Show::Notice(_) | Show::Finish) {
                self.tell.waiting.fetch_sub(1, Ordering::Relaxed);
            }
            let (is_out, line) = match show {
                Show::Log(record) => (true, self.log_line(&record)),
                Show::Output { index, line } => (false, self.output_line(index, &line)),
                Show::Notice(text) => (false, self.notice_line(&text)),
                Show::Progress(newest) => {
                    progress = Some(newest);
                    continue;
                }
                Show::Finish => continue,
            };
            match pieces.last_mut() {
                Some(piece) if piece.is_out == is_out => piece.text += &line,
                _ => pieces.push(Piece { is_out, text: line }),
            }
        }

        self.write(&pieces);

        if let Some(bar) = &mut self.bar {
            bar.update(progress);
        }

        if self.tell.waiting.load(Ordering::Relaxed) == 0 {
            self.say_dropped();
        }
    }

    fn write(&mut self, pieces: &[Piece]) {
        if pieces.is_empty() {
            return;
        }

        let (out, err) = (&mut self.out, &mut self.err);
        let mut write = || {
            for piece in pieces {
                let to = if piece.is_out { &mut *out } else { &mut *err };
                // A reader that has gone away (`| head`) does not end the run.
                let _unread = to
                    .write_all(piece.text.as_bytes())
                    .and_then(|()| to.flush());
            }
        };

        match &self.bar {
            Some(bar) => bar.aside(write),
            None => write(),
        }
    }

    fn say_dropped(&mut self) {
        let count = self.tell.dropped.swap(0, Ordering::Relaxed);
        if count > 0 {
            let text =
                format!("{count} lines came too fast to be shown; the run's folder has them all");
            let text = self.notice_line(&text);
            self.write(&[Piece {
                is_out: false,
                text,
            }]);
        }
    }

    fn log_line(&self, record: &LogRecord) -> String {
        // What a robot says is its own affair; what it does to a terminal is not.
        let record = LogRecord {
            text: harmless(&record.text),
            source: harmless(&record.source),
            ..record.clone()
        };
        let line = log_line(&record);

        if !self.look.has_colors_out {
            return line + "\n";
        }

        let (head, text) = line.split_at(line.len() - record.text.len());
        format!("{}{text}\n", color(self.color_of(&record.source), head))
    }

    fn output_line(&self, index: usize, line: &str) -> String {
        let width = self
            .look
            .names
            .iter()
            .map(String::len)
            .max()
            .unwrap_or_default();
        let name = self.look.names.get(index).map_or("", String::as_str);
        let head = format!("{name:<width$} |");
        let head = if self.look.has_colors_err {
            color(index, &head)
        } else {
            head
        };

        format!("{head} {line}\n")
    }

    fn notice_line(&self, text: &str) -> String {
        if self.look.has_colors_err {
            format!("\u{1b}[1m{text}\u{1b}[0m\n")
        } else {
            format!("{text}\n")
        }
    }

    /// The color of a process is also that of the robot with its name.
    fn color_of(&self, source: &str) -> usize {
        let named = self.look.names.iter().position(|name| name == source);
        named.unwrap_or_else(|| source.bytes().map(usize::from).sum())
    }
}

fn color(index: usize, text: &str) -> String {
    format!("\u{1b}[{}m{text}\u{1b}[0m", COLORS[index % COLORS.len()])
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Clone, Default)]
    struct Buffer(Arc<Mutex<Vec<u8>>>);

    impl Write for Buffer {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Buffer {
        fn text(&self) -> String {
            String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
        }
    }

    fn look(has_colors: bool) -> Look {
        let names = ["simulator", "Leguin"].map(str::to_owned).to_vec();
        Look {
            names,
            is_quiet: false,
            has_colors_out: has_colors,
            has_colors_err: has_colors,
            has_bar: false,
        }
    }

    fn record(text: &str) -> LogRecord {
        let (source, kind) = ("Leguin".to_owned(), LogKind::Say);
        LogRecord {
            epoch: 1,
            tick: 3,
            time_s: 1.5,
            source,
            kind,
            text: text.to_owned(),
        }
    }

    fn shown(look: Look, tell: impl FnOnce(&Tell)) -> (String, String) {
        let (out, err) = (Buffer::default(), Buffer::default());
        let screen = Screen::to(look, Box::new(out.clone()), Box::new(err.clone()), None);
        tell(&screen.tell());
        screen.finish();
        (out.text(), err.text())
    }

    #[test]
    fn lines_are_prefixed_and_aligned() {
        let (out, err) = shown(look(false), |tell| {
            tell.output(0, "ready".to_owned(), true);
            tell.output(1, "here".to_owned(), false);
            tell.log(record("going home"));
            tell.notice("Leguin has left");
        });

        assert_eq!(
            err,
            "simulator | ready\nLeguin    | here\nLeguin has left\n"
        );
        assert_eq!(out, "      1.5 s  Leguin       going home\n");
    }

    #[test]
    fn colors_go_around_the_source_and_a_robot_cannot_steer_the_terminal() {
        let (out, err) = shown(look(true), |tell| {
            tell.output(1, "here".to_owned(), false);
            tell.log(record("\u{1b}[2Jhello"));
        });
        assert_eq!(err, "\u{1b}[33mLeguin    |\u{1b}[0m here\n");
        assert_eq!(
            out,
            "\u{1b}[33m      1.5 s  Leguin       \u{1b}[0m\u{fffd}[2Jhello\n"
        );
    }

    #[test]
    fn quiet_shows_errors_only() {
        let (_, err) = shown(
            Look {
                is_quiet: true,
                ..look(false)
            },
            |tell| {
                tell.output(1, "chatter".to_owned(), false);
                tell.output(1, "trouble".to_owned(), true);
            },
        );

        assert_eq!(err, "Leguin    | trouble\n");
    }

    /// Blocks until released, as a terminal that somebody has stopped.
    struct Stuck(Arc<Mutex<()>>);

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let _released = self.0.lock().unwrap();
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_terminal_that_is_stuck_costs_lines_and_nothing_else() {
        let (terminal, err) = (Arc::new(Mutex::new(())), Buffer::default());
        let stop = terminal.lock().unwrap();
        let screen = Screen::to(
            look(false),
            Box::new(Stuck(terminal.clone())),
            Box::new(err.clone()),
            None,
        );
        let tell = screen.tell();
        (0..3 * MAX_WAITING).for_each(|_| tell.log(record("busy")));
        drop(stop);
        screen.finish();
        assert!(
            err.text().contains("lines came too fast to be shown"),
            "{}",
            err.text()
        );
    }
}
