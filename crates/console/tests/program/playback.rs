//! Recording mode.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use protocol::messages::{Performative, Point, RecordedRobot, RecordedTick, RecordingHeader};
use protocol::{Event, Line, RobotName, RunName};
use serde_json::Value;

use crate::client::{Console, fails};

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// The lines of a recording of `ticks` ticks, with its header.
fn recording(ticks: u64) -> Vec<String> {
    let run = RunName::new("past").unwrap();
    let header = RecordingHeader {
        run,
        epoch: 3,
        seed: 9_007_199_254_740_991,
        tick_s: 0.5,
        duration_s: 600.0,
        field_m: [15.24, 15.24],
        body_m: 0.6096,
        obstacles: vec![[1.0, 2.0]],
    };
    let robot = |tick: u64| RecordedRobot {
        name: name("Butler"),
        location: Point::new(0.1 + 0.2, tick as f64),
        speed_mps: 1.0 / 3.0,
        direction_rad: 0.0,
        blocked: false,
        missed: false,
        emotion_state: "HAPPY".to_owned(),
        behavior_state: "SERVE".to_owned(),
        state_variables: [("treats".to_owned(), 7.0.into())].into(),
    };
    let tick = |tick| RecordedTick {
        tick,
        robots: vec![robot(tick)],
        guests_mm: vec![-1, tick as i64],
    };
    let mut lines = vec![serde_json::to_string(&header).unwrap()];
    lines.extend((0..ticks).map(|number| serde_json::to_string(&tick(number)).unwrap()));
    lines
}

/// The lines of its events: something said every tick, a command every tenth.
fn events(ticks: u64) -> Vec<String> {
    let line = |tick, event| Line { tick, event }.to_json();
    let sent = |seq| Event::CommandSent {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
        performative: Performative::Achieve,
        command: "refill".to_owned(),
    };
    let of_tick = |tick: u64| {
        let mut lines = vec![line(
            tick,
            Event::Say {
                robot: name("Butler"),
                text: format!("tick {tick}"),
            },
        )];
        if tick.is_multiple_of(10) {
            lines.push(line(tick, sent(tick / 10)));
        }
        lines.push(line(
            tick,
            Event::Tick {
                digest: "x".to_owned(),
            },
        ));
        lines
    };
    (0..ticks).flat_map(of_tick).collect()
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

fn ticks(range: &Value) -> Vec<u64> {
    range["ticks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|tick| tick["tick"].as_u64().unwrap())
        .collect()
}

#[test]
fn ranges_are_what_was_recorded() {
    let folder = run_folder(1200);
    let console = open(folder.path());
    let header = console.get("/recording").json();
    assert_eq!(
        (&header["ticks"], &header["run"], &header["epoch"]),
        (&1199.into(), &"past".into(), &3.into())
    );
    assert_eq!(header["seed"], 9_007_199_254_740_991_u64);
    let get = |from: u64, count: u64| {
        console
            .get(&format!("/recording/ticks?from={from}&count={count}"))
            .json()
    };
    for (from, count, expected) in [
        (0, 1, 0..1),
        (0, 512, 0..512),
        (7, 20, 7..27),
        (1190, 512, 1190..1200),
    ] {
        let range = get(from, count);
        assert_eq!(
            ticks(&range),
            expected.clone().collect::<Vec<_>>(),
            "{count} from {from}"
        );
        let said: Vec<u64> = range["log"]
            .as_array()
            .unwrap()
            .iter()
            .map(|line| line["tick"].as_u64().unwrap())
            .collect();
        assert!(said.iter().all(|tick| expected.contains(tick)), "{said:?}");
        let sent = expected.clone().filter(|tick| tick % 10 == 0).count();
        assert_eq!(said.len(), expected.clone().count() + sent);
        assert_eq!(range["flights"].as_array().unwrap().len(), sent);
    }
    let range = get(10, 1);
    assert_eq!(
        range["ticks"][0]["robots"][0]["location"],
        serde_json::json!({"x": 0.1 + 0.2, "y": 10.0})
    );
    assert_eq!(range["ticks"][0]["guests_mm"], serde_json::json!([-1, 10]));
    let line = &range["log"][0];
    assert_eq!(
        (&line["time_s"], &line["epoch"], &line["kind"]),
        (&5.0.into(), &3.into(), &"say".into())
    );
    assert_eq!(
        (&line["source"], &line["text"]),
        (&"Butler".into(), &"tick 10".into())
    );
    let flight = &range["flights"][0];
    assert_eq!(
        (&flight["fate"], &flight["command"], &flight["tick"]),
        (&"sent".into(), &"refill".into(), &10.into())
    );
    for (from, count) in [(1200, 1), (u64::MAX, 512), (5, 0)] {
        assert_eq!(
            ticks(&get(from, count)),
            Vec::<u64>::new(),
            "{count} from {from}"
        );
    }
    for bad in [
        "",
        "?from=1",
        "?from=-1&count=1",
        "?from=0&count=513",
        "?from=x&count=1",
    ] {
        let answer = console.get(&format!("/recording/ticks{bad}"));
        assert!(
            answer.status == 400 && answer.body.contains("up to 512"),
            "{bad}: {answer:?}"
        );
    }
}

#[test]
fn a_recording_can_be_looked_at_and_not_changed() {
    let folder = run_folder(3);
    let console = open(folder.path());
    let mut page = console.page();
    let hello = page.until("hello");
    assert_eq!(
        (&hello["mode"], &hello["run"]),
        (&"recording".into(), &"past".into())
    );
    page.say(r#"{"type":"control","id":4,"control":{"do":"start"}}"#);
    let answer = page.until("answer");
    assert!(
        answer["id"] == 4 && answer["error"].as_str().unwrap().contains("recording"),
        "{answer}"
    );
}

#[test]
fn what_a_crash_left_can_be_looked_at() {
    let folder = run_folder(100);
    for (file, lines) in [
        ("recording.jsonl", recording(100)),
        ("events.jsonl", events(100)),
    ] {
        let text = lines.join("\n");
        std::fs::write(folder.path().join(file), &text[..text.len() - 9]).unwrap();
    }
    let console = open(folder.path());
    assert_eq!(console.get("/recording").json()["ticks"], 98);
    assert_eq!(
        ticks(&console.get("/recording/ticks?from=98&count=9").json()),
        [98]
    );
    // Nor do both have to end at the same tick.
    write(folder.path(), "events.jsonl", &events(50));
    let range = open(folder.path())
        .get("/recording/ticks?from=48&count=10")
        .json();
    assert_eq!(
        (ticks(&range).len(), range["log"].as_array().unwrap().len()),
        (10, 2)
    );
    write(folder.path(), "events.jsonl", &events(150));
    let range = open(folder.path())
        .get("/recording/ticks?from=98&count=10")
        .json();
    assert_eq!(
        (ticks(&range).len(), range["log"].as_array().unwrap().len()),
        (1, 1)
    );
}

#[test]
fn the_recording_of_an_earlier_epoch_has_its_own_events() {
    let folder = run_folder(5);
    for file in ["recording", "events"] {
        let at = |suffix: &str| folder.path().join(format!("{file}{suffix}.jsonl"));
        std::fs::rename(at(""), at("-epoch1")).unwrap();
    }
    write(
        folder.path(),
        "events.jsonl",
        &["not of this epoch".to_owned()],
    );
    let console = open(&folder.path().join("recording-epoch1.jsonl"));
    assert_eq!(
        console.get("/recording/ticks?from=0&count=5").json()["log"]
            .as_array()
            .unwrap()
            .len(),
        6
    );
}

#[test]
fn what_is_no_recording_is_refused_with_file_and_line() {
    let refusal = |folder: &Path| {
        fails(&[
            "--bind",
            "127.0.0.1:0",
            "--recording",
            folder.to_str().unwrap(),
        ])
    };
    let empty = tempfile::tempdir().unwrap();
    let text = refusal(empty.path());
    assert!(
        text.contains("recording.jsonl") && text.contains("the folder of a run"),
        "{text}"
    );
    let (good_ticks, good_events) = (recording(10), events(10));
    let changed = |lines: &[String], at: usize, line: &str| {
        let mut lines = lines.to_vec();
        lines[at] = line.to_owned();
        lines
    };
    for (file, lines, says) in [
        (
            "recording.jsonl",
            changed(&good_ticks, 4, "{\"tick\":3}"),
            "recording.jsonl, line 5: missing field",
        ),
        (
            "recording.jsonl",
            changed(&good_ticks, 4, "garbage"),
            "recording.jsonl, line 5: expected value",
        ),
        (
            "recording.jsonl",
            changed(&good_ticks, 4, &good_ticks[7]),
            "line 5: tick 6 where tick 3 should be",
        ),
        (
            "recording.jsonl",
            changed(&good_ticks, 0, "{}"),
            "recording.jsonl, line 1: missing field `run`",
        ),
        (
            "recording.jsonl",
            good_ticks[..1].to_vec(),
            "no tick was completed",
        ),
        ("recording.jsonl", Vec::new(), "recording.jsonl, line 1"),
        (
            "events.jsonl",
            changed(&good_events, 6, "[]"),
            "events.jsonl, line 7",
        ),
        (
            "events.jsonl",
            changed(&good_events, 20, &good_events[1]),
            "line 21: tick 0 after a later one",
        ),
    ] {
        let folder = run_folder(10);
        write(folder.path(), file, &lines);
        let text = refusal(folder.path());
        assert!(text.contains(says), "wanted {says:?} in {text}");
    }
    let folder = run_folder(10);
    std::fs::remove_file(folder.path().join("events.jsonl")).unwrap();
    assert!(refusal(folder.path()).contains("events.jsonl"));
}

#[test]
fn a_large_range_is_answered_in_part() {
    let folder = run_folder(0);
    let mut lines = recording(40);
    let guests = "1234,".repeat(200_000);
    for (tick, line) in lines.iter_mut().skip(1).enumerate() {
        *line = format!(r#"{{"tick":{tick},"robots":[],"guests_mm":[{guests}0]}}"#);
    }
    write(folder.path(), "recording.jsonl", &lines);
    write(folder.path(), "events.jsonl", &events(40));
    let console = open(folder.path());
    let range = console.get("/recording/ticks?from=0&count=40").json();
    let got = ticks(&range);
    assert!(
        got.len() > 5 && got.len() < 40,
        "{} ticks of a megabyte each",
        got.len()
    );
    assert_eq!(
        range["log"].as_array().unwrap().last().unwrap()["tick"],
        *got.last().unwrap()
    );
}
