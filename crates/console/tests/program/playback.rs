//! Recording mode.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use protocol::messages::{Performative, Point, RecordedRobot, RecordedTick, RecordingHeader};
use protocol::{Event, Line, RobotName, RunName};
use serde_json::Value;

use crate::client::{Console, fails};

fn robot(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn header() -> RecordingHeader {
    RecordingHeader {
        run: RunName::new("past").unwrap(),
        epoch: 3,
        seed: 9_007_199_254_740_991,
        tick_s: 0.5,
        duration_s: 600.0,
        field_m: [15.24, 15.24],
        body_m: 0.6096,
        obstacles: vec![[1.0, 2.0]],
    }
}

fn recorded_tick(tick: u64) -> RecordedTick {
    let butler = RecordedRobot {
        name: robot("Butler"),
        location: Point::new(0.1 + 0.2, tick as f64),
        speed_mps: 1.0 / 3.0,
        direction_rad: 0.0,
        blocked: false,
        missed: false,
        emotion_state: "HAPPY".to_owned(),
        behavior_state: "SERVE".to_owned(),
        state_variables: [("treats".to_owned(), 7.0.into())].into(),
    };

    RecordedTick {
        tick,
        robots: vec![butler],
        guests_mm: vec![-1, tick as i64],
    }
}

/// The lines of a recording: a header and `ticks` ticks.
fn recording(ticks: u64) -> Vec<String> {
    let mut lines = vec![serde_json::to_string(&header()).unwrap()];
    for tick in 0..ticks {
        lines.push(serde_json::to_string(&recorded_tick(tick)).unwrap());
    }
    lines
}

/// The lines of its events: `Say` in every tick, a command in every tenth.
fn events(ticks: u64) -> Vec<String> {
    (0..ticks).flat_map(events_of_tick).collect()
}

fn events_of_tick(tick: u64) -> Vec<String> {
    let mut events = vec![Event::Say {
        robot: robot("Butler"),
        text: format!("tick {tick}"),
    }];
    if tick.is_multiple_of(10) {
        events.push(Event::CommandSent {
            from: robot("Butler"),
            to: robot("Leguin"),
            seq: tick / 10,
            performative: Performative::Achieve,
            command: "refill".to_owned(),
        });
    }
    events.push(Event::Tick {
        digest: "x".to_owned(),
        seal: None,
    });

    events
        .into_iter()
        .map(|event| Line { tick, event }.to_json())
        .collect()
}

fn write(folder: &Path, file: &str, lines: &[String]) {
    std::fs::write(folder.join(file), lines.join("\n") + "\n").unwrap();
}

/// The folder of a run of `ticks` ticks.
fn run_folder(ticks: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "recording.jsonl", &recording(ticks));
    write(folder.path(), "events.jsonl", &events(ticks));
    folder
}

fn open(path: &Path) -> Console {
    Console::start(&[
        "--bind",
        "127.0.0.1:0",
        "--recording",
        path.to_str().unwrap(),
    ])
}

fn get_range(console: &Console, from: u64, count: u64) -> Value {
    console
        .get(&format!("recording/ticks?from={from}&count={count}"))
        .json()
}

/// The tick of every element of one of the lists of a range.
fn ticks(list: &Value) -> Vec<u64> {
    list.as_array()
        .unwrap()
        .iter()
        .map(|element| element["tick"].as_u64().unwrap())
        .collect()
}

#[test]
fn the_header_is_what_was_recorded() {
    let folder = run_folder(1200);
    let header = open(folder.path()).get("recording").json();

    assert_eq!(header["ticks"], 1199);
    assert_eq!(header["run"], "past");
    assert_eq!(header["epoch"], 3);
    assert_eq!(header["seed"], 9_007_199_254_740_991_u64);
}

#[test]
fn a_range_has_its_ticks_and_their_events() {
    let folder = run_folder(1200);
    let console = open(folder.path());

    for (from, count, expected) in [
        (0, 1, 0..1),
        (0, 512, 0..512),
        (7, 20, 7..27),
        (1190, 512, 1190..1200),
        (1200, 1, 0..0),
        (u64::MAX, 512, 0..0),
        (5, 0, 0..0),
    ] {
        let range = get_range(&console, from, count);
        let expected_ticks: Vec<u64> = expected.clone().collect();
        assert_eq!(
            ticks(&range["ticks"]),
            expected_ticks,
            "{count} from {from}"
        );

        let log = ticks(&range["log"]);
        assert!(log.iter().all(|tick| expected.contains(tick)), "{log:?}");
        let commands = expected_ticks.iter().filter(|tick| *tick % 10 == 0).count();
        assert_eq!(log.len(), expected_ticks.len() + commands);
        assert_eq!(ticks(&range["flights"]).len(), commands);
    }
}

#[test]
fn a_tick_is_what_was_recorded() {
    let folder = run_folder(12);
    let range = get_range(&open(folder.path()), 10, 1);

    let tick = &range["ticks"][0];
    let location = serde_json::json!({"x": 0.1 + 0.2, "y": 10.0});
    assert_eq!(tick["robots"][0]["location"], location);
    assert_eq!(tick["guests_mm"], serde_json::json!([-1, 10]));

    let line = &range["log"][0];
    assert_eq!(line["time_s"], 5.0);
    assert_eq!(line["epoch"], 3);
    assert_eq!(line["kind"], "say");
    assert_eq!(line["source"], "Butler");
    assert_eq!(line["text"], "tick 10");

    let flight = &range["flights"][0];
    assert_eq!(flight["fate"], "sent");
    assert_eq!(flight["command"], "refill");
    assert_eq!(flight["tick"], 10);
}

#[test]
fn a_malformed_range_is_refused() {
    let folder = run_folder(3);
    let console = open(folder.path());

    for query in [
        "",
        "?from=1",
        "?from=-1&count=1",
        "?from=0&count=513",
        "?from=x&count=1",
    ] {
        let answer = console.get(&format!("recording/ticks{query}"));
        assert_eq!(answer.status, 400, "{query}: {answer:?}");
        assert!(answer.body.contains("up to 512"), "{query}: {answer:?}");
    }
}

#[test]
fn a_recording_cannot_be_changed() {
    let folder = run_folder(3);
    let console = open(folder.path());
    let mut page = console.page();
    let hello = page.until("hello");
    assert_eq!(hello["mode"], "recording");
    assert_eq!(hello["run"], "past");

    page.send_text(r#"{"type":"control","id":4,"control":{"do":"start"}}"#);

    let answer = page.until("answer");
    assert_eq!(answer["id"], 4);
    assert!(
        answer["error"].as_str().unwrap().contains("recording"),
        "{answer}"
    );
}

#[test]
fn a_last_line_that_a_crash_left_unfinished_is_ignored() {
    let folder = run_folder(100);
    for (file, lines) in [
        ("recording.jsonl", recording(100)),
        ("events.jsonl", events(100)),
    ] {
        let text = lines.join("\n");
        std::fs::write(folder.path().join(file), &text[..text.len() - 9]).unwrap();
    }

    let console = open(folder.path());

    assert_eq!(console.get("recording").json()["ticks"], 98);
    let range = get_range(&console, 98, 9);
    assert_eq!(ticks(&range["ticks"]), [98]);
}

#[test]
fn recording_and_events_may_end_at_different_ticks() {
    let folder = run_folder(100);

    write(folder.path(), "events.jsonl", &events(50));
    let range = get_range(&open(folder.path()), 48, 10);
    assert_eq!(ticks(&range["ticks"]).len(), 10);
    assert_eq!(ticks(&range["log"]).len(), 2);

    write(folder.path(), "events.jsonl", &events(150));
    let range = get_range(&open(folder.path()), 99, 10);
    assert_eq!(ticks(&range["ticks"]), [99]);
    assert_eq!(ticks(&range["log"]), [99]);
}

#[test]
fn the_recording_of_an_earlier_epoch_has_its_own_events() {
    let folder = run_folder(5);
    for file in ["recording", "events"] {
        let current = folder.path().join(format!("{file}.jsonl"));
        let earlier = folder.path().join(format!("{file}-epoch1.jsonl"));
        std::fs::rename(current, earlier).unwrap();
    }
    let other = ["not of this epoch".to_owned()];
    write(folder.path(), "events.jsonl", &other);

    let console = open(&folder.path().join("recording-epoch1.jsonl"));

    let range = get_range(&console, 0, 5);
    assert_eq!(ticks(&range["log"]).len(), 6);
}

/// The error output of a console that cannot show this folder.
fn refusal(folder: &Path) -> String {
    let folder = folder.to_str().unwrap();
    fails(&["--bind", "127.0.0.1:0", "--recording", folder])
}

fn with_line(lines: &[String], index: usize, line: &str) -> Vec<String> {
    let mut lines = lines.to_vec();
    lines[index] = line.to_owned();
    lines
}

#[test]
fn a_missing_file_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let text = refusal(empty.path());
    assert!(text.contains("recording.jsonl"), "{text}");
    assert!(text.contains("the folder of a run"), "{text}");

    let folder = run_folder(10);
    std::fs::remove_file(folder.path().join("events.jsonl")).unwrap();
    let text = refusal(folder.path());
    assert!(text.contains("events.jsonl"), "{text}");
}

#[test]
fn a_malformed_recording_is_refused_with_file_and_line() {
    let good = recording(10);

    for (lines, expected) in [
        (
            with_line(&good, 4, "{\"tick\":3}"),
            "recording.jsonl, line 5: missing field",
        ),
        (
            with_line(&good, 4, "garbage"),
            "recording.jsonl, line 5: expected value",
        ),
        (
            with_line(&good, 4, &good[7]),
            "line 5: tick 6 where tick 3 should be",
        ),
        (
            with_line(&good, 0, "{}"),
            "recording.jsonl, line 1: missing field `run`",
        ),
        (good[..1].to_vec(), "no tick was completed"),
        (Vec::new(), "recording.jsonl, line 1"),
    ] {
        let folder = run_folder(10);
        write(folder.path(), "recording.jsonl", &lines);
        let text = refusal(folder.path());
        assert!(text.contains(expected), "expected {expected:?} in {text}");
    }
}

#[test]
fn malformed_events_are_refused_with_file_and_line() {
    let good = events(10);

    for (lines, expected) in [
        (with_line(&good, 6, "[]"), "events.jsonl, line 7"),
        (
            with_line(&good, 20, &good[1]),
            "line 21: tick 0 after a later one",
        ),
    ] {
        let folder = run_folder(10);
        write(folder.path(), "events.jsonl", &lines);
        let text = refusal(folder.path());
        assert!(text.contains(expected), "expected {expected:?} in {text}");
    }
}

#[test]
fn a_large_range_is_answered_in_part() {
    let folder = run_folder(0);
    let guests = "1234,".repeat(200_000);
    let mut lines = recording(0);
    for tick in 0..40 {
        lines.push(format!(
            r#"{{"tick":{tick},"robots":[],"guests_mm":[{guests}0]}}"#
        ));
    }
    write(folder.path(), "recording.jsonl", &lines);
    write(folder.path(), "events.jsonl", &events(40));

    let range = get_range(&open(folder.path()), 0, 40);

    let ticks_in_range = ticks(&range["ticks"]);
    let count = ticks_in_range.len();
    assert!((6..40).contains(&count), "{count} ticks of a megabyte each");
    assert_eq!(ticks(&range["log"]).last(), ticks_in_range.last());
}
