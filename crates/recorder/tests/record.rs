//! The record of a run, as the recorder writes it.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use environment::Simulation;
use lockstep::{Bulletin, Exchange, TickOutcome};
use protocol::messages::{CommandText, End, Report, TickUpdate};
use protocol::{RunName, Tick};
use record::RunFolder;
use record::RunLock;
use record::names::{EVENTS, RECORDING};
use recorder::Recorder;
use scenario::Scenario;
use scenario::diagnostic::Source;

/// Robots that miss every tick.
struct Absent;

impl Exchange<TickUpdate, Arc<Report>, CommandText> for Absent {
    type Error = Infallible;

    fn exchange(
        &mut self,
        _tick: Tick,
        _news: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        Ok(TickOutcome::default())
    }
}

/// A folder for the record of a run of ten seconds with one robot, and its scenario with further settings.
fn prepare(out: &Path, settings: &str) -> (RunFolder, RunLock, Scenario) {
    let folder = RunFolder::new(out, &run());
    let source = Source {
        name: "test".into(),
        text: format!(
            "duration = \"10 s\"\n{settings}\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n"
        ),
    };
    let scenario = Scenario::parse(&source, Path::new(".")).unwrap();
    let lock = folder.create(&scenario).unwrap();
    (folder, lock, scenario)
}

fn run() -> RunName {
    RunName::new("recorded").unwrap()
}

/// Plays a run with twenty guests. Returns the events, what is in the recording, and how many lines the events had after each
/// tick was noted.
fn record(settings: &str, is_deferred: bool) -> (String, String, Vec<usize>) {
    let out = tempfile::tempdir().unwrap();
    let settings = format!("guests = {{ count = 20 }}\n{settings}");
    let (folder, _lock, scenario) = prepare(out.path(), &settings);
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut recorder = Recorder::begin(&folder, &run(), &simulation).unwrap();
    let events = || std::fs::read_to_string(folder.file(EVENTS)).unwrap();

    let mut lines = Vec::new();
    let mut tick = simulation.init(&mut Absent).unwrap();
    for _ in 0..20 {
        recorder.note(&simulation, &tick).unwrap();
        lines.push(events().lines().count());
        if !is_deferred {
            recorder.write_noted().unwrap();
        }
        tick = simulation.step(&mut Absent).unwrap();
        recorder.write_noted().unwrap();
    }
    recorder.write(&simulation, &tick).unwrap();
    let end = simulation.end(End::Finished);
    recorder.write(&simulation, &end).unwrap();

    let recording = recording::Recording::open(&folder.file(RECORDING)).unwrap();
    let ticks = recording.read(0, 21).unwrap();
    let frames: Vec<_> = ticks
        .iter()
        .map(|tick| (&tick.frame, &tick.events))
        .collect();
    (events(), format!("{frames:?}"), lines)
}

#[test]
fn a_tick_that_is_written_after_the_next_one_is_the_same() {
    let (events, frames, lines) = record("", false);
    let (later_events, later_frames, _) = record("", true);
    assert_eq!(events, later_events);
    assert_eq!(frames, later_frames);
    assert_eq!(lines[0], 0, "noted ticks are not written yet: {lines:?}");
}

#[test]
fn with_sync_at_each_tick_a_noted_tick_is_written_at_once() {
    let (events, _, lines) = record("[record]\nsync = \"tick\"", true);
    let first = events
        .lines()
        .position(|line| line.contains("\"event\":\"tick\""));
    assert_eq!(lines[0], first.unwrap() + 1, "{events}");
}

#[test]
fn a_tick_is_complete_when_it_is_noted_and_not_when_it_is_written() {
    let out = tempfile::tempdir().unwrap();
    let (folder, _lock, scenario) = prepare(out.path(), "");
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut recorder = Recorder::begin(&folder, &run(), &simulation).unwrap();
    let opened = Instant::now();
    let tick = simulation.init(&mut Absent).unwrap();
    recorder.observed().unwrap().opened = Some(opened);
    recorder.note(&simulation, &tick).unwrap();
    let most = opened.elapsed();

    // However long the tick waits to be written.
    std::thread::sleep(Duration::from_millis(5));
    recorder.write_noted().unwrap();
    let end = simulation.end(End::Finished);
    recorder.write(&simulation, &end).unwrap();

    let recording = recording::Recording::open(&folder.file(RECORDING)).unwrap();
    let wall = &recording.read(0, 1).unwrap()[0].wall;
    let took = Duration::from_nanos(wall.completed_ns - wall.opened_ns);
    assert!(took <= most, "{took:?} of at most {most:?}");
}
