//! Where the wall-clock time of a run goes: a trace in the JSON form of the Trace Event Format, which Perfetto
//! (<https://ui.perfetto.dev>) and Chromium's `about:tracing` read.
//!
//! Times are microseconds since the epoch began. The recording is read and the trace written tick by tick.

use std::collections::BTreeMap;
use std::io::Write;

use protocol::messages::Awaited;
use protocol::time::time_s;
use protocol::{RobotName, Tick};
use record::RecordError;
use recording::{RecordedTick, Recording};
use serde_json::{Value, json};

use crate::ExportError;

/// Ticks that are read from the recording in one go.
const AT_ONCE: Tick = 64;
/// The number of ticks per second is stated at most once in this time, so that single ticks do not hide it.
const RATE_INTERVAL_NS: u64 = 100_000_000;

/// The process of the ticks.
const SIMULATOR: u32 = 1;
/// The process of the robots.
const ROBOTS: u32 = 2;
/// Threads of [`SIMULATOR`].
const TICKS: u32 = 1;
const HELD_UP: u32 = 2;

/// Writes the trace of the ticks from `first` to `last` of an epoch, without them from its first and to its last one. Returns
/// what it lacks, for people, a sentence each.
///
/// # Errors
/// [`ExportError`] if the recording has none of these ticks or cannot be read to its end, or the trace cannot be written.
pub fn write(
    recording: &Recording,
    first: Option<Tick>,
    last: Option<Tick>,
    out: &mut impl Write,
) -> Result<Vec<String>, ExportError> {
    let first = first.unwrap_or(0);
    let end = last.map_or(Tick::MAX, |last| last.saturating_add(1));
    let end = end.min(recording.len());
    if first >= end {
        let wanted = last.map_or_else(String::new, |last| format!(" to {last}"));
        let reason = match recording.len() {
            0 => "the recording has no complete tick".to_owned(),
            len => format!(
                "the recording has ticks 0 to {}, none of {first}{wanted}",
                len - 1
            ),
        };
        return Err(RecordError::unusable(reason).into());
    }

    let header = recording.header();
    let mut writer = TraceWriter::begin(out, &header.robots)?;
    let mut next = first;
    while next < end {
        let to = next.saturating_add(AT_ONCE).min(end);
        for tick in recording.read(next, to)? {
            writer.tick(&tick, header.tick_s)?;
        }
        next = to;
    }

    let notes = notes(recording, first, end, &writer);
    let other_data = json!({
        "run": header.run,
        "epoch": header.epoch,
        "seed": header.seed,
        "version": header.version,
        "tick_s": header.tick_s,
        "first_tick": first,
        "last_tick": end - 1,
        "notes": notes,
    });
    write!(writer.out, "\n],\"otherData\":{other_data}}}\n")?;
    writer.out.flush()?;
    Ok(notes)
}

/// What the trace of the ticks from `first` to before `end` lacks.
fn notes<W: Write>(
    recording: &Recording,
    first: Tick,
    end: Tick,
    writer: &TraceWriter<W>,
) -> Vec<String> {
    let mut notes = Vec::new();
    if !writer.has_reports && writer.untimed < end - first {
        notes.push(
            "the robots ran in the simulator's process: when each of them reported is not known"
                .to_owned(),
        );
    }
    if writer.untimed > 0 {
        notes.push(format!(
            "{} ticks have no times and are left out: they were executed again when the run was resumed",
            writer.untimed
        ));
    }
    if !recording.is_finished() && end == recording.len() {
        notes.push(format!(
            "the recording was not finished: the trace ends with tick {}",
            end - 1
        ));
    }

    notes
}

/// Writes the events of a trace. Their kind is `ph`: `X` is a slice of time, `i` an instant, `C` the value of counters, `M` the
/// name of a track.
struct TraceWriter<'a, W: Write> {
    out: &'a mut W,
    /// The threads of the robots.
    threads: BTreeMap<RobotName, u32>,
    is_first: bool,
    rate: TickRate,
    /// Whether any robot's report had a time.
    has_reports: bool,
    /// Ticks without times.
    untimed: u64,
}

/// Ticks per second since it was stated last.
#[derive(Default)]
struct TickRate {
    since_ns: Option<u64>,
    ticks: u32,
}

impl TickRate {
    /// Counts a tick. Returns the rate if it is to be stated now, ticks per second.
    fn count(&mut self, completed_ns: u64) -> Option<f64> {
        let since_ns = *self.since_ns.get_or_insert(completed_ns);
        let elapsed_ns = completed_ns.saturating_sub(since_ns);
        if elapsed_ns == 0 {
            return None;
        }

        self.ticks += 1;
        if elapsed_ns < RATE_INTERVAL_NS {
            return None;
        }
        let rate = f64::from(self.ticks) / (elapsed_ns as f64 / 1e9);
        self.since_ns = Some(completed_ns);
        self.ticks = 0;
        Some(rate)
    }
}

impl<'a, W: Write> TraceWriter<'a, W> {
    /// Writes the names of the tracks.
    fn begin(out: &'a mut W, robots: &[RobotName]) -> std::io::Result<Self> {
        out.write_all(b"{\"displayTimeUnit\":\"ms\",\"traceEvents\":[")?;
        let mut threads = BTreeMap::new();
        for (robot, thread) in robots.iter().zip(1..) {
            threads.insert(robot.clone(), thread);
        }
        let mut writer = Self {
            out,
            threads: threads.clone(),
            is_first: true,
            rate: TickRate::default(),
            has_reports: false,
            untimed: 0,
        };

        writer.name("process_name", SIMULATOR, TICKS, "simulator")?;
        writer.name("thread_name", SIMULATOR, TICKS, "ticks")?;
        writer.name("thread_name", SIMULATOR, HELD_UP, "held up")?;
        writer.name("process_name", ROBOTS, 1, "robots")?;
        for (robot, thread) in &threads {
            writer.name("thread_name", ROBOTS, *thread, robot.as_str())?;
        }
        Ok(writer)
    }

    fn name(&mut self, what: &str, pid: u32, tid: u32, name: &str) -> std::io::Result<()> {
        let args = json!({ "name": name });
        self.add(&json!({ "name": what, "ph": "M", "pid": pid, "tid": tid, "args": args }))
    }

    /// Writes what happened in a tick.
    fn tick(&mut self, tick: &RecordedTick, tick_s: f64) -> std::io::Result<()> {
        let wall = &tick.wall;
        if wall.completed_ns == 0 {
            self.untimed += 1;
            return Ok(());
        }

        let number = tick.tick();
        let mut args = json!({ "tick": number, "time_s": time_s(number, tick_s) });
        // The robot that reported last is the one that the clock waited for.
        let last = wall.reports_ns.iter().max_by_key(|(_, arrived)| **arrived);
        if let Some((robot, arrived)) = last {
            let waited_ms = arrived.saturating_sub(wall.opened_ns) as f64 / 1e6;
            args["waited_for"] = json!(robot);
            args["waited_ms"] = json!(waited_ms);
            self.counter("ms to the last report", wall.opened_ns, waited_ms)?;
        }
        self.slice(
            SIMULATOR,
            TICKS,
            "tick",
            (wall.opened_ns, wall.completed_ns),
            &args,
        )?;
        for awaited in &wall.awaited {
            self.held_up(tick, awaited)?;
        }
        self.reports(tick)?;

        if let Some(rate) = self.rate.count(wall.completed_ns) {
            self.counter("ticks per second", wall.completed_ns, rate)?;
        }
        Ok(())
    }

    /// Writes that a tick was held up, and by which robot.
    fn held_up(&mut self, tick: &RecordedTick, awaited: &Awaited) -> std::io::Result<()> {
        let span = (tick.wall.opened_ns, tick.wall.completed_ns);
        let name = format!("{} {}", awaited.name, awaited.because);
        let args = json!({
            "tick": tick.tick(),
            "robot": awaited.name,
            "because": awaited.because.to_string(),
            "noticed_after_s": awaited.since_s,
        });
        self.slice(SIMULATOR, HELD_UP, &name, span, &args)
    }

    /// Writes when the robots reported.
    fn reports(&mut self, tick: &RecordedTick) -> std::io::Result<()> {
        let number = tick.tick();
        for robot in &tick.frame.robots {
            let Some(thread) = self.threads.get(&robot.name).copied() else {
                continue;
            };

            let args = json!({ "tick": number });
            if let Some(arrived) = tick.wall.reports_ns.get(&robot.name) {
                self.has_reports = true;
                let span = (tick.wall.opened_ns, *arrived);
                self.slice(ROBOTS, thread, "report", span, &args)?;
            } else if robot.missed.is_some() {
                let ts = microseconds(tick.wall.completed_ns);
                // The scope of the instant is its thread.
                self.add(&json!({
                    "name": "missed", "ph": "i", "s": "t", "pid": ROBOTS, "tid": thread, "ts": ts, "args": args,
                }))?;
            }
        }

        Ok(())
    }

    fn slice(
        &mut self,
        pid: u32,
        tid: u32,
        name: &str,
        (begin_ns, end_ns): (u64, u64),
        args: &Value,
    ) -> std::io::Result<()> {
        let ts = microseconds(begin_ns);
        let dur = microseconds(end_ns.saturating_sub(begin_ns));
        self.add(&json!({
            "name": name, "ph": "X", "pid": pid, "tid": tid, "ts": ts, "dur": dur, "args": args,
        }))
    }

    fn counter(&mut self, name: &str, at_ns: u64, value: f64) -> std::io::Result<()> {
        let ts = microseconds(at_ns);
        let args = json!({ "value": value });
        self.add(&json!({
            "name": name, "ph": "C", "pid": SIMULATOR, "tid": TICKS, "ts": ts, "args": args,
        }))
    }

    fn add(&mut self, event: &Value) -> std::io::Result<()> {
        let separator = if self.is_first { "" } else { "," };
        self.is_first = false;
        write!(self.out, "{separator}\n{event}")
    }
}

fn microseconds(ns: u64) -> f64 {
    ns as f64 / 1000.0
}
