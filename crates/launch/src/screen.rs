//! The terminal of a launch: lines and a progress bar. One thread writes and all others only queue what is to be shown, so
//! a slow terminal delays neither a robot nor the clock.

use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use protocol::event::log_line;
use protocol::messages::{LogKind, LogRecord};
use protocol::plain::{escape_line, escape_text};

use super::bar::{Bar, RunProgress};

/// Most lines in the queue; further ones are counted and not shown. The run's folder contains all lines.
const MAX_WAITING: usize = 10_000;
/// Most lines of one write.
const BATCH: usize = 512;
/// Interval of updates of the bar while the clock is held; it shows whole seconds.
const HELD_INTERVAL: Duration = Duration::from_secs(1);
/// ANSI colors of sources in turn, readable on dark and on light backgrounds.
const COLORS: [&str; 6] = ["36", "33", "35", "32", "34", "31"];

/// Something to show.
enum Show {
    Log(LogRecord),
    Output { index: usize, line: String },
    Notice(String),
    Progress(RunProgress),
    Finish,
}

/// How lines and the bar are shown.
#[derive(Debug, Clone)]
pub(super) struct ScreenOptions {
    /// Names of the processes by index.
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

impl ScreenOptions {
    /// Options for the standard streams of this process.
    pub(super) fn here(names: Vec<String>, is_quiet: bool) -> Self {
        let no_color = std::env::var_os("NO_COLOR").unwrap_or_default();
        let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let may_color = no_color.is_empty() && !is_dumb;
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

/// Queues what is to be shown.
#[derive(Debug, Clone)]
pub(super) struct ScreenHandle {
    queue: Sender<Show>,
    waiting: Arc<AtomicUsize>,
    dropped: Arc<AtomicUsize>,
    is_quiet: bool,
}

impl ScreenHandle {
    /// A line of the run's log. Quiet shows none: the observer is also there for faults and for the console.
    pub(super) fn log(&self, record: LogRecord) {
        // The simulator's error output and the bar show late robots already.
        if !self.is_quiet && record.kind != LogKind::Late {
            self.try_queue(Show::Log(record));
        }
    }

    /// A line that a process printed.
    pub(super) fn output(&self, index: usize, line: String, is_error: bool) {
        if is_error || !self.is_quiet {
            self.try_queue(Show::Output { index, line });
        }
    }

    /// Progress of the run.
    pub(super) fn progress(&self, progress: RunProgress) {
        self.try_queue(Show::Progress(progress));
    }

    /// A line of the launcher; never dropped.
    pub(super) fn notice(&self, text: impl Into<String>) {
        // The queue is closed only at the end of the launcher.
        let _unread = self.queue.send(Show::Notice(text.into()));
    }

    /// Queues something unless the queue is full; counts what is dropped.
    fn try_queue(&self, show: Show) {
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= MAX_WAITING {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            self.dropped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let _unread = self.queue.send(show);
    }
}

/// The thread that writes to the terminal.
pub(super) struct Screen {
    handle: ScreenHandle,
    thread: JoinHandle<()>,
}

impl Screen {
    /// Starts the thread, which writes to the standard output and the standard error.
    ///
    /// # Errors
    /// If the system starts no further thread.
    pub(super) fn open(look: ScreenOptions) -> std::io::Result<Self> {
        let bar = look.has_bar.then(|| Bar::new(look.has_colors_err));
        Self::to(
            look,
            Box::new(std::io::stdout()),
            Box::new(std::io::stderr()),
            bar,
        )
    }

    fn to(
        look: ScreenOptions,
        out: Writer,
        err: Writer,
        bar: Option<Bar>,
    ) -> std::io::Result<Self> {
        let (queue, shows) = std::sync::mpsc::channel();
        let handle = ScreenHandle {
            queue,
            waiting: Arc::default(),
            dropped: Arc::default(),
            is_quiet: look.is_quiet,
        };
        let painter = Painter {
            look,
            out,
            err,
            bar,
            handle: handle.clone(),
        };

        let thread = Builder::new()
            .name("screen".to_owned())
            .spawn(move || painter.paint(&shows))?;
        Ok(Self { handle, thread })
    }

    /// A handle to queue what is to be shown.
    pub(super) fn handle(&self) -> ScreenHandle {
        self.handle.clone()
    }

    /// Shows what is queued and ends the thread.
    pub(super) fn finish(self) {
        let _has_ended = self.handle.queue.send(Show::Finish);
        let _has_panicked = self.thread.join();
    }
}

type Writer = Box<dyn Write + Send>;

struct Painter {
    look: ScreenOptions,
    out: Writer,
    err: Writer,
    bar: Option<Bar>,
    handle: ScreenHandle,
}

/// Text for one of the two streams.
struct ScreenText {
    is_out: bool,
    text: String,
}

impl Painter {
    fn paint(mut self, shows: &Receiver<Show>) {
        loop {
            let mut batch: Vec<Show> = self.next(shows).into_iter().collect();
            batch.extend(shows.try_iter().take(BATCH));
            let is_last = batch.iter().any(|show| matches!(show, Show::Finish));

            self.show(batch);
            if is_last {
                break;
            }
        }

        self.report_dropped();
        if let Some(bar) = self.bar {
            bar.clear();
        }
    }

    /// Waits for the next thing to show; returns `None` once a second while the clock is held.
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

    /// Writes a batch: all lines first, then the newest progress.
    fn show(&mut self, batch: Vec<Show>) {
        let mut pieces: Vec<ScreenText> = Vec::new();
        let mut progress = None;
        for show in batch {
            if !matches!(show, Show::Notice(_) | Show::Finish) {
                self.handle.waiting.fetch_sub(1, Ordering::Relaxed);
            }

            match show {
                Show::Log(record) => append(&mut pieces, true, self.log_line(&record)),
                Show::Output { index, line } => {
                    append(&mut pieces, false, self.output_line(index, &line));
                }
                Show::Notice(text) => append(&mut pieces, false, self.notice_line(&text)),
                Show::Progress(newest) => progress = Some(newest),
                Show::Finish => {}
            }
        }

        self.write(&pieces);
        if let Some(bar) = &mut self.bar {
            bar.update(progress);
        }
        if self.handle.waiting.load(Ordering::Relaxed) == 0 {
            self.report_dropped();
        }
    }

    fn write(&mut self, pieces: &[ScreenText]) {
        if pieces.is_empty() {
            return;
        }

        let out = &mut self.out;
        let err = &mut self.err;
        match &self.bar {
            Some(bar) => bar.aside(|| write(pieces, out, err)),
            None => write(pieces, out, err),
        }
    }

    fn report_dropped(&mut self) {
        let count = self.handle.dropped.swap(0, Ordering::Relaxed);
        if count == 0 {
            return;
        }

        let text = format!(
            "{count} lines came too fast to be shown; the run's folder contains all of them"
        );
        let text = self.notice_line(&text);
        self.write(&[ScreenText {
            is_out: false,
            text,
        }]);
    }

    fn log_line(&self, record: &LogRecord) -> String {
        let line = log_line(record);
        if !self.look.has_colors_out {
            return line + "\n";
        }

        let text_bytes = escape_line(&record.text).len();
        let (head, text) = line.split_at(line.len() - text_bytes);
        format!("{}{text}\n", color(self.color_of(&record.source), head))
    }

    fn output_line(&self, index: usize, line: &str) -> String {
        let names = &self.look.names;
        let width = names.iter().map(String::len).max().unwrap_or_default();
        let name = names.get(index).map_or("", String::as_str);
        let mut head = format!("{name:<width$} |");
        if self.look.has_colors_err {
            head = color(index, &head);
        }

        format!("{head} {line}\n")
    }

    fn notice_line(&self, text: &str) -> String {
        let text = escape_text(text);
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

/// Appends a line to the last piece, or begins a new one if that belongs to the other stream.
fn append(pieces: &mut Vec<ScreenText>, is_out: bool, line: String) {
    match pieces.last_mut() {
        Some(piece) if piece.is_out == is_out => piece.text += &line,
        _ => pieces.push(ScreenText { is_out, text: line }),
    }
}

fn write(pieces: &[ScreenText], out: &mut Writer, err: &mut Writer) {
    for piece in pieces {
        let to = if piece.is_out { &mut *out } else { &mut *err };
        let written = to.write_all(piece.text.as_bytes());
        // A closed pipe (`| head`) does not end the run.
        let _unread = written.and_then(|()| to.flush());
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

    fn look(has_colors: bool) -> ScreenOptions {
        let names = ["simulator", "Leguin"].map(str::to_owned).to_vec();
        ScreenOptions {
            names,
            is_quiet: false,
            has_colors_out: has_colors,
            has_colors_err: has_colors,
            has_bar: false,
        }
    }

    fn record(text: &str) -> LogRecord {
        LogRecord {
            epoch: 1,
            tick: 3,
            time_s: 1.5,
            tick_s: 0.5,
            source: "Leguin".to_owned(),
            kind: LogKind::Say,
            text: text.to_owned(),
        }
    }

    /// Standard output and standard error after `show`.
    fn shown(look: ScreenOptions, show: impl FnOnce(&ScreenHandle)) -> (String, String) {
        let out = Buffer::default();
        let err = Buffer::default();
        let screen = Screen::to(look, Box::new(out.clone()), Box::new(err.clone()), None).unwrap();
        show(&screen.handle());
        screen.finish();
        (out.text(), err.text())
    }

    #[test]
    fn lines_are_prefixed_and_aligned() {
        let (out, err) = shown(look(false), |screen| {
            screen.output(0, "ready".to_owned(), true);
            screen.output(1, "here".to_owned(), false);
            screen.log(record("going home"));
            screen.notice("Leguin has left");
        });

        assert_eq!(
            err,
            "simulator | ready\nLeguin    | here\nLeguin has left\n"
        );
        assert_eq!(out, "      1.5 s  Leguin       going home\n");
    }

    #[test]
    fn colors_go_around_the_source_and_a_robot_cannot_steer_the_terminal() {
        let (out, err) = shown(look(true), |screen| {
            screen.output(1, "here".to_owned(), false);
            screen.log(record("\u{1b}[2Jhello"));
        });
        assert_eq!(err, "\u{1b}[33mLeguin    |\u{1b}[0m here\n");
        assert_eq!(
            out,
            "\u{1b}[33m      1.5 s  Leguin       \u{1b}[0m\\u{1b}[2Jhello\n"
        );
    }

    #[test]
    fn quiet_shows_errors_only() {
        let quiet = ScreenOptions {
            is_quiet: true,
            ..look(false)
        };
        let (out, err) = shown(quiet, |screen| {
            screen.log(record("going home"));
            screen.output(1, "chatter".to_owned(), false);
            screen.output(1, "trouble".to_owned(), true);
        });
        assert_eq!(err, "Leguin    | trouble\n");
        assert_eq!(out, "");
    }

    /// Blocks until released, like a terminal after Ctrl-S.
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
    fn a_blocked_terminal_loses_lines_and_blocks_nothing_else() {
        let terminal = Arc::new(Mutex::new(()));
        let err = Buffer::default();
        let stop = terminal.lock().unwrap();
        let screen = Screen::to(
            look(false),
            Box::new(Stuck(terminal.clone())),
            Box::new(err.clone()),
            None,
        )
        .unwrap();

        for _ in 0..3 * MAX_WAITING {
            screen.handle().log(record("busy"));
        }
        drop(stop);
        screen.finish();

        let text = err.text();
        assert!(text.contains("lines came too fast to be shown"), "{text}");
    }
}
