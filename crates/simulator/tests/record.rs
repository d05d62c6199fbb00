//! The record of a run, as the recorder writes it.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fs::File;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use lockstep::{Exchange, Outcome};
use protocol::messages::{CommandText, End, News, Report};
use protocol::{RobotName, RunName, Tick};
use scenario::Scenario;
use scenario::diagnostic::Source;
use simulator::recorder::{EVENTS, RECORDING};
use simulator::{Recorder, RunFolder, Simulation};

/// Robots that miss every tick.
struct Absent;

impl Exchange<News, Arc<Report>, CommandText> for Absent {
    type Error = Infallible;

    fn exchange(
        &mut self,
        _tick: Tick,
        _news: BTreeMap<RobotName, News>,
    ) -> Result<Outcome<Arc<Report>, CommandText>, Infallible> {
        Ok(Outcome::default())
    }
}

#[test]
fn events_have_no_end_unless_the_recording_is_finished() {
    let out = tempfile::tempdir().unwrap();
    let run = RunName::new("unfinished").unwrap();
    let folder = RunFolder::new(out.path(), &run);
    let source = Source {
        name: "test".into(),
        text: "duration = \"10 s\"\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n".into(),
    };
    let scenario = Scenario::parse(&source, Path::new(".")).unwrap();
    let _lock = folder.create(&scenario).unwrap();

    // The recording is a pipe: what is written after its reader has gone is an error.
    let pipe = folder.file(RECORDING);
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let reader = std::thread::spawn(move || File::open(pipe).unwrap());
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut recorder = Recorder::begin(&folder, &run, &simulation).unwrap();
    let reader = reader.join().unwrap();
    let tick = simulation.init(&mut Absent).unwrap();
    recorder.write(&simulation, &tick).unwrap();
    drop(reader);

    let end = simulation.end(End::Finished);
    let error = recorder.write(&simulation, &end).unwrap_err();
    assert!(error.to_string().contains(RECORDING), "{error}");
    let events = std::fs::read_to_string(folder.file(EVENTS)).unwrap();
    assert!(events.contains("\"event\":\"tick\""), "{events}");
    assert!(!events.contains("\"event\":\"end\""), "{events}");
}

/// Plays ten seconds with twenty guests. Returns the events, those of the recording included, and how many lines the events had
/// after each tick was noted.
fn record(settings: &str, is_deferred: bool) -> (String, String, Vec<usize>) {
    let out = tempfile::tempdir().unwrap();
    let run = RunName::new("noted").unwrap();
    let folder = RunFolder::new(out.path(), &run);
    let source = Source {
        name: "test".into(),
        text: format!(
            "duration = \"10 s\"\nguests = {{ count = 20 }}\n{settings}\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n"
        ),
    };
    let scenario = Scenario::parse(&source, Path::new(".")).unwrap();
    let _lock = folder.create(&scenario).unwrap();
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut recorder = Recorder::begin(&folder, &run, &simulation).unwrap();
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
    let ticks = recording.read(0, 20).unwrap();
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
