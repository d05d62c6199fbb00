//! What browsers get of a made-up run.

use protocol::messages::{DisplayUnit, Fate, LogKind, Phase, Widget};
use serde_json::Value;

use super::*;

fn robot(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn frame(tick: u64) -> WorldFrame {
    let flight = Flight {
        tick,
        from: robot("A"),
        to: robot("B"),
        seq: tick,
        command: "x".to_owned(),
        fate: Fate::Sent,
        because: None,
    };

    WorldFrame {
        run: protocol::RunName::new("r").unwrap(),
        epoch: 1,
        tick,
        time_s: tick as f64,
        duration_s: 100.0,
        tick_s: 1.0,
        seed: 1,
        replay_of: None,
        jumps: 0,
        speed: None,
        phase: Phase::Running,
        awaiting: Vec::new(),
        field_m: [10.0, 10.0],
        body_m: 1.0,
        display_unit: DisplayUnit::default(),
        robots: Vec::new(),
        guests: vec![[1.0, 2.0]],
        guest_numbers: Vec::new(),
        guest_moods: BTreeMap::new(),
        obstacles: Vec::new(),
        static_world: None,
        sites: Vec::new(),
        layers: Vec::new(),
        flights: vec![flight],
        cuts: Vec::new(),
        faults: Vec::new(),
        expectations: Vec::new(),
        measures: BTreeMap::new(),
    }
}

fn line(tick: u64) -> LogRecord {
    LogRecord {
        epoch: 1,
        tick,
        time_s: 0.0,
        tick_s: 0.5,
        source: "simulator".to_owned(),
        kind: LogKind::Run,
        text: format!("line {tick}"),
    }
}

/// A panel of a tick, which has a picture of this size.
fn panel(tick: Tick, bytes: usize) -> TickPanel {
    let picture = Widget::Svg {
        label: String::new().into(),
        svg: "x".repeat(bytes),
    };
    TickPanel {
        epoch: 1,
        tick,
        widgets: vec![picture],
    }
}

fn take_new(feed: &Feed, cursor: &mut Cursor) -> Vec<Value> {
    feed.take_new(cursor)
        .iter()
        .map(|text| serde_json::from_str(text).unwrap())
        .collect()
}

fn types(messages: &[Value]) -> Vec<&str> {
    messages
        .iter()
        .map(|message| message["type"].as_str().unwrap())
        .collect()
}

fn flights(message: &Value) -> &[Value] {
    message["frame"]["flights"].as_array().unwrap()
}

#[test]
fn every_browser_gets_what_is_new_and_nothing_twice() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    assert_eq!(take_new(&feed, &mut cursor)[0]["present"], false);
    assert!(take_new(&feed, &mut cursor).is_empty());

    feed.set_present(true);
    feed.catch_up(None);
    feed.put_frame(frame(1));
    feed.add_line(line(1), 0);

    let new = take_new(&feed, &mut cursor);
    assert_eq!(types(&new), ["simulator", "log", "frame"]);
    assert!(take_new(&feed, &mut cursor).is_empty());
    let new_for_another = take_new(&feed, &mut Cursor::default());
    assert_eq!(types(&new_for_another), ["simulator", "log", "frame"]);
}

#[test]
fn a_slow_browser_gets_the_newest_frame_with_the_flights_of_all() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.put_frame(frame(1));
    assert_eq!(take_new(&feed, &mut cursor)[1]["frame"]["tick"], 1);

    for tick in 2..=400 {
        feed.put_frame(frame(tick));
    }

    let new = take_new(&feed, &mut cursor);
    assert_eq!(types(&new), ["frame"]);
    assert_eq!(new[0]["frame"]["tick"], 400);
    let shown = flights(&new[0]);
    assert_eq!(shown.len(), MAX_FLIGHTS);
    assert_eq!(shown[0]["tick"], 145);
    assert_eq!(shown[MAX_FLIGHTS - 1]["tick"], 400);

    feed.put_frame(frame(401));
    let next = take_new(&feed, &mut cursor);
    assert_eq!(flights(&next[0]).len(), 1);
}

#[test]
fn flights_of_an_earlier_epoch_are_dropped() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.put_frame(frame(401));
    take_new(&feed, &mut cursor);

    feed.put_frame(frame(402));
    feed.put_frame(WorldFrame {
        epoch: 2,
        ..frame(0)
    });

    let new = take_new(&feed, &mut cursor);
    assert_eq!(flights(&new[0]).len(), 1);
}

#[test]
fn a_replay_that_has_been_moved_tells_nothing_of_before() {
    let feed = Feed::new();
    let replayed = |tick, jumps| WorldFrame {
        replay_of: Some(protocol::RunName::new("r").unwrap()),
        jumps,
        ..frame(tick)
    };
    let mut cursor = Cursor::default();
    feed.put_frame(replayed(1, 0));
    take_new(&feed, &mut cursor);

    // The frame of the jump is skipped.
    for (tick, jumps) in [(2, 0), (50, 1), (51, 1)] {
        feed.put_frame(replayed(tick, jumps));
    }

    for mut cursor in [cursor, Cursor::default()] {
        let new = take_new(&feed, &mut cursor);
        let newest = new.last().unwrap();
        assert_eq!(newest["frame"]["jumps"], 1);
        let told: Vec<_> = flights(newest)
            .iter()
            .map(|flight| &flight["tick"])
            .collect();
        assert_eq!(told, [50, 51]);
    }
}

#[test]
fn every_browser_gets_what_does_not_change_once() {
    let feed = Feed::new();
    let walls = |message: &Value| message["frame"]["static_world"]["walls"].clone();
    let walled = |tick, from| WorldFrame {
        static_world: Some(StaticWorld {
            walls: vec![vec![[from, 0.0], [1.0, 1.0]]],
            ..StaticWorld::default()
        }),
        ..frame(tick)
    };
    let mut cursor = Cursor::default();
    feed.put_frame(frame(0));
    take_new(&feed, &mut cursor);

    // The frame with it is skipped.
    feed.put_frame(walled(1, 0.0));
    feed.put_frame(frame(2));

    let new = take_new(&feed, &mut cursor);
    assert_eq!(walls(&new[0])[0][0][0], 0.0);
    assert_eq!(flights(&new[0]).len(), 2);
    feed.put_frame(frame(3));
    assert_eq!(walls(&take_new(&feed, &mut cursor)[0]), Value::Null);
    let late = take_new(&feed, &mut Cursor::default());
    assert_eq!(walls(&late[1])[0][0][0], 0.0);

    feed.put_frame(walled(4, 0.5));
    feed.put_frame(frame(5));
    assert_eq!(walls(&take_new(&feed, &mut cursor)[0])[0][0][0], 0.5);
    feed.put_frame(WorldFrame {
        epoch: 2,
        ..frame(0)
    });
    assert_eq!(walls(&take_new(&feed, &mut cursor)[0]), Value::Null);
}

fn ticks(messages: &[Value]) -> Vec<u64> {
    let lines = messages.iter().filter_map(|one| one["lines"].as_array());
    lines
        .flatten()
        .filter_map(|line| line["tick"].as_u64())
        .collect()
}

#[test]
fn lines_before_the_first_that_arrived_are_added_once_and_in_order() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.set_present(true);
    feed.add_line(line(3), 0);
    assert!(ticks(&take_new(&feed, &mut cursor)).is_empty());

    feed.add_line(line(4), 0);
    feed.add_line(line(5), 0);
    let so_far = (1..=4).map(line).collect();
    feed.catch_up(Some(so_far));
    feed.add_line(line(6), 0);

    assert_eq!(ticks(&take_new(&feed, &mut cursor)), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn a_simulator_that_returns_tells_what_was_missed() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.set_present(true);
    feed.catch_up(Some((1..=4).map(line).collect()));
    feed.set_present(false);
    feed.set_present(true);
    feed.add_line(line(7), 0);

    feed.catch_up(Some((2..=7).map(line).collect()));

    let lines = ticks(&take_new(&feed, &mut cursor));
    assert_eq!(lines, [1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn without_the_log_so_far_there_is_what_arrived() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.set_present(true);
    for tick in 1..=3000 {
        feed.add_line(line(tick), 0);
    }

    feed.catch_up(None);

    let lines = ticks(&take_new(&feed, &mut cursor));
    assert_eq!(lines.first(), Some(&1001), "what is held is bounded");
}

#[test]
fn missed_lines_are_counted() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.add_line(line(0), 0);
    assert_eq!(take_new(&feed, &mut cursor)[1]["dropped"], 0);

    for tick in 1..=2100 {
        feed.add_line(line(tick), 0);
    }
    let mut ticks = Vec::new();
    let mut dropped = Vec::new();
    while let Some(log) = take_new(&feed, &mut cursor).pop() {
        dropped.push(log["dropped"].as_u64().unwrap());
        for line in log["lines"].as_array().unwrap() {
            ticks.push(line["tick"].as_u64().unwrap());
        }
    }
    assert_eq!(ticks, (101..=2100).collect::<Vec<_>>());
    assert_eq!(dropped, [100, 0, 0, 0]);

    feed.add_line(line(2101), 7);
    let log = &take_new(&feed, &mut cursor)[0];
    assert_eq!(log["dropped"], 7, "lost before they reached the feed");

    let late = take_new(&feed, &mut Cursor::default()).pop().unwrap();
    assert_eq!(late["dropped"], 0, "a new browser has missed nothing");
}

#[test]
fn a_panel_is_shown_with_the_frame_of_its_tick_and_with_no_other_one() {
    let feed = Feed::new();
    let mut cursor = Cursor::default();
    feed.put_panel(&robot("A"), &panel(1, 1)).unwrap();
    assert_eq!(types(&take_new(&feed, &mut cursor)), ["simulator"]);

    feed.put_frame(frame(1));
    let new = take_new(&feed, &mut cursor);
    assert_eq!(types(&new), ["panel", "frame"], "the panel first");
    assert_eq!(new[0]["panel"]["tick"], 1);

    // Of the next tick, whose frame is yet to come.
    feed.put_panel(&robot("A"), &panel(2, 2)).unwrap();
    assert!(take_new(&feed, &mut cursor).is_empty());
    let late = take_new(&feed, &mut Cursor::default());
    assert_eq!(late[1]["panel"]["tick"], 1, "for another browser, too");

    // Of a tick that is not shown.
    feed.put_frame(frame(3));
    assert_eq!(types(&take_new(&feed, &mut cursor)), ["frame"]);

    // After its frame, and again.
    feed.put_panel(&robot("A"), &panel(3, 3)).unwrap();
    feed.put_panel(&robot("A"), &panel(3, 4)).unwrap();
    let new = take_new(&feed, &mut cursor);
    assert_eq!(types(&new), ["panel"]);
    assert_eq!(new[0]["panel"]["widgets"][0]["svg"], "xxxx");

    // The same tick, now paused, and then another one of another epoch.
    feed.put_frame(frame(3));
    let new = take_new(&feed, &mut Cursor::default());
    assert_eq!(types(&new), ["simulator", "panel", "frame"]);
    feed.put_frame(WorldFrame {
        epoch: 2,
        ..frame(3)
    });
    let new = take_new(&feed, &mut Cursor::default());
    assert_eq!(types(&new), ["simulator", "frame"]);
}

#[test]
fn a_replay_that_goes_back_shows_the_panel_of_that_tick() {
    let feed = Feed::new();
    feed.put_frame(frame(9));
    feed.put_panel(&robot("A"), &panel(4, 1)).unwrap();
    feed.put_frame(frame(4));

    let new = take_new(&feed, &mut Cursor::default());
    assert_eq!(types(&new), ["simulator", "panel", "frame"]);
}

#[test]
fn panels_are_bounded_together() {
    let feed = Feed::new();
    feed.put_frame(frame(1));
    // Those that are shown, and those that are early.
    let refused = (0..100).find(|i| {
        let name = robot(&format!("r{i}"));
        feed.put_panel(&name, &panel(i % 2, 1 << 20)).is_err()
    });
    let accepted = refused.expect("there is a limit");
    assert!((25..40).contains(&accepted), "{accepted}");
}
