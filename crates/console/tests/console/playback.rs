//! Recording mode.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use protocol::messages::{
    Awaited, Cut, DisplayUnit, FaultKind, LayerFrame, Panel, Performative, Point, Reason, Report,
    Widget,
};
use protocol::{Event, RobotName, RunName};
use recording::content::Missed;
use recording::{Frame, Header, PlacedRobot, RecordedTick, WallTimes, Writer};
use serde_json::{Value, json};
use timeline::{Span, StateSpan, Timeline};

use crate::client::{Console, fails};

fn robot(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn header() -> Header {
    Header {
        run: RunName::new("past").unwrap(),
        epoch: 3,
        seed: 9_007_199_254_740_991,
        version: "1.2.3".to_owned(),
        commit: None,
        protocol: 2,
        tick_s: 0.5,
        duration_s: 600.0,
        field_m: [15.24, 15.24],
        body_m: 0.6096,
        display_unit: DisplayUnit::Feet,
        sites: Vec::new(),
        layers: Vec::new(),
        obstacles: vec![[1.0, 2.0]],
        static_world: Default::default(),
        robots: vec![robot("Butler")],
    }
}

fn report(tick: u64) -> Report {
    Report {
        epoch: 3,
        tick,
        generation: 2,
        proposal: Point::new(1.0, 1.0),
        speed_mps: 1.0 / 3.0,
        direction_rad: 0.0,
        emotion_state: "HAPPY".to_owned(),
        behavior_state: "SERVE".to_owned(),
        state_variables: [("treats".to_owned(), (tick as f64).into())].into(),
        commands: 0,
        log: Vec::new(),
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

/// `Say` in every tick, a command in every tenth.
fn events(tick: u64) -> Vec<Event> {
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
            payload: None,
            payload_of: None,
        });
    }
    events
}

fn recorded_tick(tick: u64) -> RecordedTick {
    let butler = PlacedRobot {
        name: robot("Butler"),
        location: Point::new(0.1 + 0.2, tick as f64),
        heading_rad: (tick == 1).then_some(0.5),
        blocked: false,
        missed: None,
    };

    RecordedTick {
        frame: Frame {
            tick,
            robots: vec![butler],
            guests_mm: vec![-1, tick as i64],
            ..Frame::default()
        },
        events: events(tick).into(),
        reports: [(robot("Butler"), report(tick).into())].into(),
        panels: BTreeMap::new(),
        wall: WallTimes::default(),
    }
}

fn write(file: &Path, ticks: impl IntoIterator<Item = RecordedTick>) {
    let mut writer = Writer::create(file, &header(), "").unwrap();
    for tick in ticks {
        writer.tick(tick).unwrap();
    }
    writer.finish().unwrap();
}

fn file(folder: &Path) -> PathBuf {
    folder.join("run.mcap")
}

/// The folder of a run of `ticks` ticks.
fn run_folder(ticks: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(&file(folder.path()), (0..ticks).map(recorded_tick));
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

/// A layer of one cell.
fn layer(number: f64) -> LayerFrame {
    LayerFrame {
        name: "dust".to_owned(),
        cell_m: 20.0,
        columns: 1,
        rows: 1,
        min: number,
        max: number,
        scale: [0.0, 9.0],
        levels: "AA==".to_owned(),
    }
}

#[test]
fn a_tick_has_the_layers_that_are_not_as_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let header = Header {
        layers: vec![layer(9.0)],
        ..header()
    };
    let mut writer = Writer::create(&file(folder.path()), &header, "").unwrap();
    for tick in 0..6 {
        let mut recorded = recorded_tick(tick);
        if tick >= 2 {
            recorded.frame.layers = vec![layer(9.0 - tick as f64)];
        }
        writer.tick(recorded).unwrap();
    }
    writer.finish().unwrap();

    let console = open(folder.path());
    let start = &console.get("recording").json()["layers"];
    assert_eq!(start[0]["max"], 9.0);
    let later = [
        (3, [json!(6.0), json!(5.0)]),
        (1, [Value::Null, json!(7.0)]),
    ];
    for (from, expected) in later {
        let range = get_range(&console, from, 2);
        let ticks = range["ticks"].as_array().unwrap().iter();
        let shown: Vec<Value> = ticks.map(|tick| tick["layers"][0]["max"].clone()).collect();
        assert_eq!(shown, expected);
    }
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
fn a_range_has_the_commands_and_faults_of_before_that_its_ticks_show() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = (0..60).map(|tick| {
        let mut recorded = recorded_tick(tick);
        if tick == 12 || tick == 24 {
            Arc::make_mut(&mut recorded.events).push(Event::CommandDelivered {
                from: robot("Butler"),
                to: robot("Leguin"),
                seq: tick / 10,
            });
        }
        if tick == 15 || tick == 30 {
            Arc::make_mut(&mut recorded.events).push(Event::Fault {
                robot: robot("Leguin"),
                kind: FaultKind::Hang,
                begins: tick == 15,
            });
        }
        recorded
    });
    write(&file(folder.path()), recorded);
    let console = open(folder.path());

    // That of tick 10 arrived long ago; that of tick 20 within two seconds, four ticks.
    let range = get_range(&console, 27, 1);
    let earlier = &range["earlier_flights"];
    assert_eq!(ticks(earlier), [0, 20, 24]);
    assert_eq!(earlier[1]["command"], "refill");
    assert_eq!(earlier[2]["fate"], "delivered");
    let held = json!([{"robot": "Leguin", "kind": "hang"}]);
    assert_eq!(range["ticks"][0]["faults"], held);

    let range = get_range(&console, 40, 1);
    assert_eq!(ticks(&range["earlier_flights"]), [0, 30]);
    assert_eq!(ticks(&range["flights"]), [40]);
    assert_eq!(range["ticks"][0]["faults"], json!([]));
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
fn a_diagram_has_the_window_and_what_began_before_it() {
    let folder = run_folder(1200);
    let console = open(folder.path());

    // The same window is drawn alike whatever was read before.
    let late = console.get("recording/diagram?from=1085&count=20&width=900");
    assert_eq!(late.status, 200, "{late:?}");
    assert_eq!(late.header("content-type"), "image/svg+xml");
    for (from, first, last) in [
        (0, 0, 19),
        (1085, 1085, 1104),
        (1195, 1195, 1199),
        (9999, 1199, 1199),
    ] {
        let answer = console.get(&format!("recording/diagram?from={from}&count=20&width=900"));
        let window = format!("data-from=\"{first}\" data-to=\"{last}\"");
        assert!(answer.body.contains(&window), "{answer:?}");
    }
    let again = console.get("recording/diagram?from=1085&count=20&width=900");
    assert_eq!(again.body, late.body);

    // A command that was sent in tick 1080 and has not arrived is under way; the one of 1090 begins in the window.
    assert!(
        late.body
            .contains("command 108: achieve “refill”; sent in tick 1080")
    );
    assert!(
        late.body
            .contains("command 109: achieve “refill”; sent in tick 1090")
    );
    assert!(
        !late.body.contains("<style"),
        "the page has the style sheet"
    );
    let style = console.get("assets/diagram.css");
    assert_eq!(style.header("content-type"), "text/css; charset=utf-8");
    assert!(style.body.contains(".cars-diagram .e0"));
}

#[test]
fn a_malformed_window_is_refused() {
    let folder = run_folder(3);
    let console = open(folder.path());

    for query in [
        "",
        "?from=0&count=1",
        "?from=0&count=0&width=900",
        "?from=0&count=4097&width=900",
        "?from=0&count=1&width=299",
        "?from=0&count=1&width=NaN",
        "?from=-1&count=1&width=900",
        "?from=0&count=1&width=900&queries=perhaps",
    ] {
        let answer = console.get(&format!("recording/diagram{query}"));
        assert_eq!(answer.status, 400, "{query}: {answer:?}");
        assert!(answer.body.contains("up to 4096"), "{query}: {answer:?}");
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
fn a_robot_that_misses_ticks_is_shown_with_its_last_report() {
    let folder = tempfile::tempdir().unwrap();
    let ticks = (0..2000).map(|tick| {
        let mut recorded = recorded_tick(tick);
        if tick >= 3 {
            recorded.reports.clear();
            recorded.frame.robots[0].missed = Some(Missed {
                last_report: Some(2),
            });
        }
        if tick == 700 {
            let robot = robot("Butler");
            Arc::make_mut(&mut recorded.events).push(Event::Lost { robot });
        }
        recorded
    });
    write(&file(folder.path()), ticks);
    let console = open(folder.path());

    for (tick, presence, treats) in [
        (2, "here", 2.0),
        (3, "gone", 2.0),
        (1999, "lost", 2.0),
        (699, "gone", 2.0),
        (700, "lost", 2.0),
    ] {
        let butler = &get_range(&console, tick, 1)["ticks"][0]["robots"][0];
        assert_eq!(butler["presence"], presence, "{tick}");
        assert_eq!(butler["state_variables"]["treats"], treats, "{tick}");
        assert_eq!(butler["location"]["y"], tick as f64);
        assert_eq!(butler["generation"], 2);
    }
}

#[test]
fn cuts_panels_and_who_held_the_clock_up_are_shown() {
    let panel = |text: &str| Panel {
        widgets: vec![Widget::Text {
            label: "why".into(),
            text: text.into(),
        }],
    };
    let cut = Cut {
        from: robot("Butler"),
        to: robot("Leguin"),
        commands: true,
        queries: false,
    };
    let awaited = Awaited {
        name: robot("Butler"),
        since_s: 0.75,
        because: Reason::Silent,
    };
    let folder = tempfile::tempdir().unwrap();
    let ticks = (0..2000).map(|tick| {
        let mut recorded = recorded_tick(tick);
        if tick == 1 || tick == 9 {
            let text = format!("at {tick}");
            recorded.panels.insert(robot("Butler"), panel(&text));
        }
        if tick == 9 {
            recorded.frame.cuts.push(cut.clone());
            recorded.wall.awaited.push(awaited.clone());
        }
        recorded
    });
    write(&file(folder.path()), ticks);
    let console = open(folder.path());

    let ticks = get_range(&console, 0, 12)["ticks"].clone();
    for tick in 0..12 {
        let cuts = if tick == 9 { json!([cut]) } else { json!([]) };
        assert_eq!(ticks[tick]["cuts"], cuts, "{tick}");
        let awaiting = if tick == 9 {
            json!([awaited])
        } else {
            json!([])
        };
        assert_eq!(ticks[tick]["awaiting"], awaiting, "{tick}");
    }

    // A panel is of its tick, and of none that follows.
    let shown =
        |tick: u64| json!({"tick": tick, "robot": "Butler", "panel": panel(&format!("at {tick}"))});
    for (from, expected) in [
        (0, json!([shown(1), shown(9)])),
        (1, json!([shown(1), shown(9)])),
        (2, json!([shown(9)])),
        (9, json!([shown(9)])),
        (10, json!([])),
    ] {
        assert_eq!(get_range(&console, from, 20)["panels"], expected, "{from}");
    }
}

#[test]
fn a_recording_that_a_crash_cut_off_is_shown_as_far_as_it_goes() {
    let folder = run_folder(20_000);
    let bytes = std::fs::read(file(folder.path())).unwrap();
    std::fs::write(file(folder.path()), &bytes[..bytes.len() / 2]).unwrap();

    let console = open(folder.path());

    let last = console.get("recording").json()["ticks"].as_u64().unwrap();
    assert!((100..20_000).contains(&last), "{last}");
    let range = get_range(&console, last, 9);
    assert_eq!(ticks(&range["ticks"]), [last]);
}

#[test]
fn the_recording_of_an_earlier_epoch_is_shown_by_its_file() {
    let folder = run_folder(3);
    let earlier = folder.path().join("run-epoch1.mcap");
    write(&earlier, (0..5).map(recorded_tick));

    let console = open(&earlier);

    let range = get_range(&console, 0, 9);
    assert_eq!(ticks(&range["ticks"]).len(), 5);
    assert_eq!(ticks(&range["log"]).len(), 6);
}

/// The error output of a console that cannot show this folder.
fn refusal(folder: &Path) -> String {
    let folder = folder.to_str().unwrap();
    fails(&["--bind", "127.0.0.1:0", "--recording", folder])
}

#[test]
fn a_recording_that_cannot_be_shown_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let text = refusal(empty.path());
    assert!(text.contains("run.mcap"), "{text}");
    assert!(text.contains("the folder of a run"), "{text}");

    let folder = run_folder(0);
    let text = refusal(folder.path());
    assert!(text.contains("run.mcap: no tick was completed"), "{text}");

    for content in ["", "{}\n"] {
        std::fs::write(file(folder.path()), content).unwrap();
        let text = refusal(folder.path());
        assert!(text.contains("run.mcap is not a recording"), "{text}");
    }
}

#[test]
fn damage_is_reported_with_its_place_where_it_is_read() {
    let folder = run_folder(20_000);
    let mut bytes = std::fs::read(file(folder.path())).unwrap();
    // In the content of a chunk, which begins with these bytes.
    let middle = bytes.len() / 2;
    let content = bytes[middle..].windows(4);
    let mut starts = content
        .enumerate()
        .filter(|(_, bytes)| *bytes == [0x28, 0xb5, 0x2f, 0xfd]);
    let start = starts.next().unwrap().0;
    bytes[middle + start + 100] ^= 1;
    std::fs::write(file(folder.path()), bytes).unwrap();
    let console = open(folder.path());

    // A chunk has more than a hundred of these ticks.
    let mut answers = Vec::new();
    for from in (0..20_000).step_by(100) {
        answers.push(console.get(&format!("recording/ticks?from={from}&count=1")));
    }
    let is_damaged = |body: &str| body.contains("run.mcap: damaged at byte ");
    let damaged = answers.iter().filter(|answer| is_damaged(&answer.body));
    let good = answers.iter().filter(|answer| answer.status == 200);
    let counts = (damaged.count(), good.count());
    assert!(counts.0 > 0 && counts.1 > 0, "{counts:?}");
    assert_eq!(counts.0 + counts.1, answers.len());
}

#[test]
fn a_large_range_is_answered_in_part() {
    let folder = tempfile::tempdir().unwrap();
    let large = (0..40).map(|tick| {
        let mut recorded = recorded_tick(tick);
        recorded.frame.guests_mm = vec![1234; 200_000];
        recorded
    });
    write(&file(folder.path()), large);

    let range = get_range(&open(folder.path()), 0, 40);

    let ticks_in_range = ticks(&range["ticks"]);
    let count = ticks_in_range.len();
    assert!((6..40).contains(&count), "{count} ticks of a megabyte each");
    assert_eq!(ticks(&range["log"]).last(), ticks_in_range.last());
}

/// A console of a run in progress whose folder is known. No simulator answers.
fn open_growing(folder: &Path, run: &str) -> Console {
    Console::start(&[
        "--bind",
        "127.0.0.1:0",
        "--connect",
        "tcp/127.0.0.1:1",
        "--run",
        run,
        "--folder",
        folder.to_str().unwrap(),
    ])
}

/// A recording of an epoch that goes on.
fn begin(folder: &Path, epoch: u32) -> Writer {
    let header = Header { epoch, ..header() };
    Writer::create(&file(folder), &header, "").unwrap()
}

/// Records ticks and waits until they can be read.
fn go_on(writer: &mut Writer, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        writer.tick(recorded_tick(tick)).unwrap();
    }
    writer.sync().unwrap();
}

#[test]
fn a_run_in_progress_has_the_past_that_is_recorded_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let console = open_growing(folder.path(), "past");
    let missing = console.get("recording").json();
    let reason = missing["missing"].as_str().unwrap();
    assert!(reason.contains("nothing is recorded yet"), "{reason}");

    let mut writer = begin(folder.path(), 1);
    for end in [1_u64, 30, 31, 700] {
        let begin = console.get("recording").json()["ticks"].as_u64();
        go_on(&mut writer, begin.map_or(0, |last| last + 1)..end);

        let summary = console.get("recording").json();
        assert_eq!(summary["ticks"], end - 1, "{summary}");
        assert_eq!(summary["is_finished"], false);
        assert_eq!(summary["epochs"], json!([1]));
        assert_eq!(summary["number"], 1);
        let range = get_range(&console, end - 1, 9);
        assert_eq!(ticks(&range["ticks"]), [end - 1]);
        assert_eq!(range["end"], end);
        let diagram = console.get(&format!(
            "recording/diagram?from={}&count=20&width=900",
            end - 1
        ));
        assert_eq!(diagram.status, 200, "{diagram:?}");
    }

    writer.finish().unwrap();
    assert_eq!(console.get("recording").json()["is_finished"], true);
}

#[test]
fn earlier_epochs_stay_and_another_run_of_the_name_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let console = open_growing(folder.path(), "past");
    for epoch in 1..=7 {
        let mut writer = begin(folder.path(), epoch);
        go_on(&mut writer, 0..u64::from(epoch) * 10);
        let summary = console.get("recording").json();
        assert_eq!(summary["epoch"], epoch);
        assert_eq!(summary["epochs"], json!((1..=epoch).collect::<Vec<_>>()));

        drop(writer);
        let ended = folder.path().join(format!("run-epoch{epoch}.mcap"));
        std::fs::rename(file(folder.path()), ended).unwrap();
    }
    let mut writer = begin(folder.path(), 8);
    go_on(&mut writer, 0..1);

    // More than are kept open, and again.
    for epoch in (1..=7_u64).chain(1..=7) {
        let summary = console.get(&format!("recording?epoch={epoch}")).json();
        assert_eq!(summary["ticks"], epoch * 10 - 1);
        let query = format!(
            "recording/ticks?from={}&count=1&epoch={epoch}",
            epoch * 10 - 1
        );
        assert_eq!(
            ticks(&console.get(&query).json()["ticks"]),
            [epoch * 10 - 1]
        );
    }
    let missing = console.get("recording?epoch=9").json();
    assert!(
        missing["missing"].as_str().unwrap().contains("epoch9"),
        "{missing}"
    );
    assert_eq!(
        console.get("recording/ticks?from=0&count=1&epoch=9").status,
        404
    );

    let number = console.get("recording").json()["number"].as_u64();
    std::fs::remove_file(file(folder.path())).unwrap();
    let mut anew = begin(folder.path(), 8);
    go_on(&mut anew, 0..2);
    let summary = console.get("recording").json();
    assert_eq!(summary["ticks"], 1);
    assert!(summary["number"].as_u64() > number);
}

#[test]
fn the_folder_of_another_run_is_not_shown() {
    let folder = run_folder(10);
    let console = open_growing(folder.path(), "other");
    let missing = console.get("recording").json();
    assert!(
        missing["missing"].as_str().unwrap().contains("another run"),
        "{missing}"
    );
    assert_eq!(console.get("recording/ticks?from=0&count=1").status, 404);
}

#[test]
fn without_its_folder_a_run_in_progress_has_no_past() {
    let console = Console::live();
    let missing = console.get("recording").json();
    assert!(
        missing["missing"].as_str().unwrap().contains("--folder"),
        "{missing}"
    );
    for part in ["ticks?from=0&count=1", "diagram?from=0&count=9&width=900"] {
        assert_eq!(console.get(&format!("recording/{part}")).status, 404);
    }
}

fn emotion(name: &str, to: &str) -> Event {
    let (robot, to) = (robot(name), to.to_owned());
    let from = None;
    Event::Emotion { robot, from, to }
}

fn behavior(name: &str, to: &str) -> Event {
    let (robot, to) = (robot(name), to.to_owned());
    let from = None;
    Event::Behavior { robot, from, to }
}

#[test]
fn samples_have_the_whole_log_and_the_last_reports() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = (0..9000).map(|tick| {
        let mut recorded = recorded_tick(tick);
        if tick == 1234 {
            Arc::make_mut(&mut recorded.events).push(emotion("Butler", "ANGRY"));
        }
        if tick > 1250 {
            recorded.reports.clear();
            let last_report = Some(1250);
            recorded.frame.robots[0].missed = Some(Missed { last_report });
        }
        recorded
    });
    write(&file(folder.path()), recorded);
    let console = open(folder.path());

    let range = console
        .get("recording/ticks?from=1000&count=4096&every=500")
        .json();
    let expected = [1000, 1500, 2000, 2500, 3000, 3500, 4000, 4500, 5000];
    assert_eq!(ticks(&range["ticks"]), expected);
    assert_eq!(range["end"], 5096);
    let sample = &range["ticks"][0];
    assert_eq!(sample["guests_mm"], json!([]));
    let treats = |index: usize| &range["ticks"][index]["robots"][0]["state_variables"]["treats"];
    assert_eq!(treats(0), 1000.0);
    assert_eq!(treats(1), 1250.0, "also of a tick that is no sample");
    assert_eq!(range["flights"], json!([]));
    // A line of each tick, the commands, and the change.
    assert_eq!(ticks(&range["log"]).len(), 4096 + 410 + 1);
    let stay =
        json!({"robot": "Butler", "kind": "emotion", "state": "ANGRY", "begin": 1234, "end": null});
    assert_eq!(range["spans"], json!([stay]));

    for query in ["count=4097&every=9", "count=9&every=0", "count=9&every=-1"] {
        let answer = console.get(&format!("recording/ticks?from=0&{query}"));
        assert_eq!(answer.status, 400, "{query}: {answer:?}");
    }
}

/// Two robots that change their states every few ticks. One crashes twice and comes back once, the other one hangs, and a link is
/// cut.
fn eventful(tick: u64, epoch: u64) -> Vec<Event> {
    let joined = |name: &str, generation| Event::Joined {
        robot: robot(name),
        generation,
        at: Point::new(1.0, 1.0),
    };
    let lost = |name: &str| Event::Lost { robot: robot(name) };
    let hang = |begins| Event::Fault {
        robot: robot("Butler"),
        kind: FaultKind::Hang,
        begins,
    };
    let (from, to) = (robot("Butler"), robot("Leguin"));

    let mut events = match tick {
        0 => vec![joined("Butler", None), joined("Leguin", None)],
        41 | 200 => vec![lost("Leguin")],
        90 => vec![joined("Leguin", Some(2))],
        120 => vec![hang(true)],
        128 => vec![hang(false)],
        150 => vec![Event::LinkCut {
            from,
            to,
            commands: true,
            queries: true,
        }],
        170 => vec![Event::LinkHealed { from, to }],
        _ => Vec::new(),
    };
    let hangs = (120..128).contains(&tick);
    if hangs {
        let robot = robot("Butler");
        events.push(Event::Missed { robot });
    }
    let is_lost = (41..90).contains(&tick) || tick >= 200;
    let names = ["HAPPY", "BUSY", "", "LONELY"];
    for (name, every, is_there) in [("Butler", 7, !hangs), ("Leguin", 11, !is_lost)] {
        let turn = |every| names[((tick / every + epoch) % 4) as usize];
        if is_there && tick.is_multiple_of(every) {
            events.push(emotion(name, turn(every)));
        }
        if is_there && tick.is_multiple_of(every + 3) {
            events.push(behavior(name, turn(every + 3)));
        }
    }
    events
}

/// The stays of a run, as the timeline over all of its ticks has them; without an end, they go on after the last one.
fn stays(ticks: u64, events: impl Fn(u64) -> Vec<Event>) -> Vec<StateSpan> {
    let mut timeline = Timeline::new(&header().robots);
    let mut spans = Vec::new();
    for tick in 0..ticks {
        spans.extend(timeline.tick(tick, &events(tick)));
    }
    spans.extend(timeline.in_progress());
    let stays = spans.into_iter().filter_map(|span| match span {
        Span::Stay(stay) => Some(stay),
        _ => None,
    });
    stays.collect()
}

/// What an answer says of the stays of a run, in any order.
fn told(stays: &[StateSpan], from: u64, end: u64) -> Vec<String> {
    let mut told = Vec::new();
    for stay in stays {
        if stay.period.begin < end && stay.period.lasts_to(from) {
            let kind = stay.kind.as_str();
            let end = stay.period.end.filter(|over| *over < end);
            let begin = stay.period.begin;
            let stay = json!({"robot": stay.robot, "kind": kind, "state": stay.name, "begin": begin, "end": end});
            told.push(stay.to_string());
        }
    }
    told.sort();
    told
}

fn spans_of(range: &Value) -> Vec<String> {
    let spans = range["spans"].as_array().unwrap().iter();
    let mut spans: Vec<String> = spans.map(Value::to_string).collect();
    spans.sort();
    spans
}

#[test]
fn spans_are_those_of_the_timeline_of_the_whole_epoch_in_any_pieces() {
    let lengths = [(2, 130), (3, 1300)];
    let folder = tempfile::tempdir().unwrap();
    for (epoch, length) in lengths {
        let name = if epoch == 2 {
            "run-epoch2.mcap"
        } else {
            "run.mcap"
        };
        let recorded = (0..length).map(|tick| RecordedTick {
            events: eventful(tick, epoch).into(),
            ..recorded_tick(tick)
        });
        let header = Header {
            epoch: u32::try_from(epoch).unwrap(),
            ..header()
        };
        let mut writer = Writer::create(&folder.path().join(name), &header, "").unwrap();
        for tick in recorded {
            writer.tick(tick).unwrap();
        }
        writer.finish().unwrap();
    }
    let console = open(folder.path());

    for (epoch, length) in lengths {
        let stays = stays(length, |tick| eventful(tick, epoch));
        assert!(stays.len() > 20);
        for (count, every) in [(4096, 1), (4096, 5000), (512, 10), (41, 3), (1, 7)] {
            let mut from = 0;
            while from < length.min(300 * count) {
                let query = format!("from={from}&count={count}&every={every}&epoch={epoch}");
                let range = console.get(&format!("recording/ticks?{query}")).json();
                let end = range["end"].as_u64().unwrap();
                assert_eq!(end, length.min(from + count), "{query}");
                assert_eq!(spans_of(&range), told(&stays, from, end), "{query}");
                from = end;
            }
        }
    }

    let whole = get_range(&console, 0, 300);
    assert_eq!(whole["spans"], json!([]), "they are with samples");
}

#[test]
fn an_answer_has_fewer_ticks_if_it_has_many_spans() {
    let every_tick = |tick: u64| {
        let to = ["ONE", "OTHER"][(tick % 2) as usize];
        let names = ["A", "B", "C", "D", "E"];
        let events = names.map(|name| [emotion(name, to), behavior(name, to)]);
        events.concat()
    };
    let folder = tempfile::tempdir().unwrap();
    let recorded = (0..4096).map(|tick| RecordedTick {
        events: every_tick(tick).into(),
        ..recorded_tick(tick)
    });
    write(&file(folder.path()), recorded);
    let console = open(folder.path());
    let stays = stays(4096, every_tick);

    let mut from = 0;
    for expected in [3278, 4096] {
        let query = format!("recording/ticks?from={from}&count=4096&every=1000");
        let range = console.get(&query).json();
        // Ten stays are over in each tick but the first: with the 3277th such tick there are 32,768, and ten go on.
        let end = range["end"].as_u64().unwrap();
        assert_eq!(end, expected);
        let spans = spans_of(&range);
        assert!(spans.len() <= 32_768 + 20, "{}", spans.len());
        assert_eq!(spans, told(&stays, from, end));
        assert_eq!(ticks(&range["log"]).last(), Some(&(end - 1)));
        from = end;
    }
}

/// A run of 21 ticks whose digest after tick N is "digest N", with answers of `cars why` in its folder.
fn explained_run() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let ticks = (0..21).map(|tick| {
        let mut recorded = recorded_tick(tick);
        Arc::make_mut(&mut recorded.events).push(Event::Tick {
            digest: format!("digest {tick}"),
            seal: None,
        });
        recorded
    });
    write(&file(folder.path()), ticks);

    let outcomes =
        |value: f64| json!({"n": 200, "value": value, "low": value - 0.05, "high": value + 0.05});
    let mut answer = json!({
        "digest": "digest 20",
        "question": {"kind": "measure", "name": "waited"},
        "is_share": false, "tick_s": 0.5, "last": 20, "sentence": "waited is 3.",
        "curve": [{"tick": 0, "n": 64, "value": 1.0, "low": 0.5, "high": 1.5}, {"tick": 20, "n": 1, "value": 3.0, "low": null, "high": null}],
        "jumps": [{"tick": 7, "before": outcomes(1.0), "after": outcomes(3.0), "p": 0.001, "events": [], "cause": null, "tried": []}],
        "kinds": [], "planned": [], "forks": 600,
    });
    let why = folder.path().join("why");
    std::fs::create_dir(&why).unwrap();
    std::fs::write(why.join("waited-1.json"), answer.to_string()).unwrap();
    std::fs::write(why.join("waited-2.json"), "{").unwrap();
    answer["digest"] = "of another run".into();
    std::fs::write(why.join("waited-3.json"), answer.to_string()).unwrap();
    folder
}

#[test]
fn what_decided_the_run_is_shown_with_what_is_damaged() {
    let folder = explained_run();
    let console = open(folder.path());
    let found = console.get("recording/decisions?epoch=3").json();
    let [answer] = &found["answers"].as_array().unwrap()[..] else {
        panic!("that of another run is not shown: {found}");
    };
    assert_eq!(answer["sentence"], "waited is 3.");
    assert_eq!(
        answer["curve"][1],
        json!({"tick": 20, "n": 1, "failed": 0, "value": 3.0, "low": null, "high": null})
    );
    assert_eq!(answer["range"], json!([0.5, 3.0]));
    assert_eq!(answer["told"], json!(["3.5 s, tick 7: 1 → 3"]));
    let notes = found["notes"].as_array().unwrap();
    assert_eq!(notes.len(), 1);
    assert!(
        notes[0]
            .as_str()
            .unwrap()
            .starts_with("why/waited-2.json cannot be shown")
    );

    assert_eq!(console.get("recording/decisions?epoch=x").status, 400);
    let other = console.get("recording/decisions?epoch=2").json();
    assert_eq!(other["answers"], json!([]));
}

#[test]
fn a_run_that_nobody_asked_about_has_no_answers() {
    let folder = run_folder(3);
    let found = open(folder.path()).get("recording/decisions").json();
    assert_eq!(found, json!({"answers": [], "notes": []}));
}
