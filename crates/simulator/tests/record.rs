//! The record of a run, as the recorder writes it.

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
