//! In which emotion and behavior each robot is, and when it takes part: all that count it or show it agree with the events, also where
//! robots crash, hang and come back, in a further epoch, and in a run that was resumed.

use std::collections::BTreeMap;

use nix::sys::signal::Signal;
use roxmltree::{Document, ParsingOptions};
use serde_json::Value;
use system_tests::processes::{nobody_is_left, send};
use system_tests::{Lab, root};

const HALL: &str = "configs/hors_doeuvres.toml";
/// Length of its ticks, seconds.
const TICK_S: f64 = 0.5;
const FAULTS: &str = r#"fault=[
    { robot = "Leguin", do = "crash", at = "10 s", until = "25 s" },
    { robot = "Butler", do = "hang", at = "30 s", until = "34 s" },
    { robot = "Leguin", do = "crash", at = "50 s", until = "80 s" },
]"#;

/// Seconds by robot, kind of state, and state.
type Times = BTreeMap<(String, String, String), f64>;

fn key(robot: &str, kind: &str, state: &str) -> (String, String, String) {
    (robot.to_owned(), kind.to_owned(), state.to_owned())
}

/// The times of an epoch, counted tick by tick.
fn times_of(events: &[Value]) -> Times {
    let text = |event: &Value, field: &str| event[field].as_str().unwrap().to_owned();
    let last = events
        .iter()
        .filter(|event| event["event"] == "tick")
        .count()
        - 1;
    let mut states: BTreeMap<(String, String), String> = BTreeMap::new();
    let mut present: BTreeMap<String, bool> = BTreeMap::new();
    let mut times = Times::new();
    for event in events {
        let kind = event["event"].as_str().unwrap();
        match kind {
            "joined" => _ = present.insert(text(event, "robot"), true),
            "lost" => _ = present.insert(text(event, "robot"), false),
            "emotion" | "behavior" => {
                states.insert((text(event, "robot"), kind.to_owned()), text(event, "to"));
            }
            "tick" if event["tick"].as_u64().unwrap() < last as u64 => {
                for ((robot, kind), state) in &states {
                    if present[robot] {
                        *times.entry(key(robot, kind, state)).or_default() += TICK_S;
                    }
                }
            }
            _ => {}
        }
    }
    times
}

fn times_in_summary(summary: &Value) -> Times {
    let mut times = Times::new();
    for (robot, of_robot) in summary["robots"].as_object().unwrap() {
        for (kind, table) in [("emotion", "emotions_s"), ("behavior", "behaviors_s")] {
            for (state, time_s) in of_robot[table].as_object().unwrap() {
                times.insert(key(robot, kind, state), time_s.as_f64().unwrap());
            }
        }
    }
    times
}

fn parsed(text: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options).unwrap()
}

/// The tables of emotions and behaviors of a report.
fn times_in_report(html: &str) -> Times {
    let document = parsed(html);
    let mut times = Times::new();
    let mut kinds = ["emotion", "behavior"].into_iter();
    let all = document.descendants();
    for table in all.filter(|node| node.has_tag_name("table")) {
        let mut rows = Vec::new();
        for row in table.descendants().filter(|node| node.has_tag_name("tr")) {
            let mut cells = Vec::new();
            for cell in row.children().filter(roxmltree::Node::is_element) {
                let number = cell.children().find(|node| node.has_tag_name("data"));
                let parts = cell.descendants().filter(roxmltree::Node::is_text);
                let texts = parts.filter_map(|part| part.text());
                let value = number.and_then(|number| number.attribute("value"));
                cells.push(value.map_or_else(|| texts.collect(), str::to_owned));
            }
            rows.push(cells);
        }
        if rows[0].get(1).is_none_or(|head| head != "state") {
            continue;
        }
        let kind = kinds.next().unwrap();
        for row in &rows[1..] {
            times.insert(key(&row[0], kind, &row[1]), row[2].parse().unwrap());
        }
    }
    times
}

/// The durations of the emotions of an EmotionML document.
fn times_in_emotionml(xml: &str) -> Times {
    let document = parsed(xml);
    let mut times = Times::new();
    for emotion in document
        .descendants()
        .filter(|node| node.has_tag_name("emotion"))
    {
        let id = emotion.attribute("id").unwrap();
        let robot = id.split('.').nth(1).unwrap();
        let duration_ms: f64 = emotion.attribute("duration").unwrap().parse().unwrap();
        let category = emotion
            .children()
            .find(|node| node.has_tag_name("category"));
        let name = category.unwrap().attribute("name").unwrap();
        *times.entry(key(robot, "emotion", name)).or_default() += duration_ms / 1000.0;
    }
    times
}

fn assert_same_times(found: &Times, expected: &Times, where_: &str) {
    for (state, time_s) in expected {
        // A state of the last tick lasts for no time: it may be named or not.
        let found_s = found.get(state).copied().unwrap_or(0.0);
        assert!(
            (found_s - time_s).abs() < 1e-6,
            "{where_}: {state:?} {found_s} s, and not {time_s} s"
        );
    }
    for (state, time_s) in found {
        assert!(
            *time_s == 0.0 || expected.contains_key(state),
            "{where_}: {state:?} {time_s} s"
        );
    }
}

/// Compares everything that reads the record of a run with its events.
fn assert_all_readers_agree(lab: &Lab, run: &str) -> Times {
    let expected = times_of(&lab.events(run));
    assert_same_times(&times_in_summary(&lab.summary(run)), &expected, "summary");
    assert_same_times(
        &times_in_report(&lab.ok(&["report", run])),
        &expected,
        "report",
    );

    let emotions: Times = expected
        .iter()
        .filter(|((_, kind, _), _)| kind == "emotion")
        .map(|(state, time_s)| (state.clone(), *time_s))
        .collect();
    let xml = lab.ok(&["emotionml", run]);
    let mut found = Times::new();
    for ((robot, kind, category), time_s) in times_in_emotionml(&xml) {
        // Categories are written in lower case.
        let state = emotions.keys().find(|(one, _, state)| {
            *one == robot && state.to_lowercase().replace('_', "-") == category.to_lowercase()
        });
        let state = state.map_or(category.clone(), |(_, _, state)| state.clone());
        found.insert((robot, kind, state), time_s);
    }
    assert_same_times(&found, &emotions, "emotionml");
    expected
}

#[test]
fn all_readers_count_a_robot_that_is_lost_in_no_state() {
    let lab = Lab::new();
    let faulty = [
        "--set",
        FAULTS,
        "--set",
        "on_late=continue",
        "--duration",
        "100 s",
    ];
    let printed = lab.ok(&[&["run", HALL, "--run", "crash", "--seed", "1"], &faulty[..]].concat());
    let times = assert_all_readers_agree(&lab, "crash");

    let of = |robot: &str, kind: &str| {
        let states = times
            .iter()
            .filter(|((one, what, _), _)| one == robot && what == kind);
        states.map(|(_, time_s)| time_s).sum::<f64>()
    };
    for kind in ["emotion", "behavior"] {
        assert_eq!(of("Butler", kind), 100.0);
        assert_eq!(of("Leguin", kind), 55.0);
    }
    assert!(printed.contains("(takes no part)"), "{printed}");
    assert!(printed.contains("  45 %"), "{printed}");

    // The share of an experiment is the same number, as a part of the run.
    let scenario = root().join(HALL);
    let mut text = format!(
        "question = '?'\nscenario = {scenario:?}\nduration = '100 s'\nseeds = [1, 2]\n[[arm]]\nname = 'it'\n\
         set = ['''{FAULTS}''', 'on_late=continue']\n"
    );
    for (robot, kind, state) in times.keys() {
        text += &format!(
            "[[measure]]\nname = '{robot} {kind} {state}'\nshare = {{ robot = '{robot}', {kind} = '{state}' }}\n"
        );
    }
    let file = lab.write("shares.toml", &text);
    let out = lab.out().join("shares");
    let args = ["experiment", "run", file.to_str().unwrap(), "--json", "-o"];
    let args = [&args[..], &[out.to_str().unwrap()]].concat();
    let (code, printed) = lab.cars_without_out(&args);
    assert_eq!(code, 0, "{printed}");
    let json = &printed[printed.find('{').unwrap()..];
    let mut json = serde_json::Deserializer::from_str(json).into_iter::<Value>();
    let all = json.next().unwrap().unwrap();
    let measures = &all["runs"][0]["measures"];
    for ((robot, kind, state), time_s) in &times {
        let share = &measures[format!("{robot} {kind} {state}")]["value"];
        let found = share.as_f64().unwrap();
        assert!(
            (found - time_s / 100.0).abs() < 1e-9,
            "{robot} {state}: {found}"
        );
    }
}

#[test]
fn all_readers_agree_about_a_further_epoch_that_is_resumed() {
    let lab = Lab::new();
    let run = "states-resumed";
    let more = ["--no-console", "--set", FAULTS, "--set", "on_late=continue"];
    let more = [&more[..], &["--duration", "100 s"]].concat();
    let mut launch = lab.paused(run, "launch/hors_doeuvres.toml", &more);
    lab.step(run, 8);
    lab.ctl(run, &["init", "--seed", "7"]);
    lab.until_ready(run);
    // Leguin takes no part at this time.
    lab.step(run, 40);
    send(launch.process("cars-sim"), Signal::SIGKILL);
    assert!(!launch.wait().success());
    nobody_is_left(run);

    lab.ok(&["launch", "--no-console", "--resume", run, "--speed", "max"]);
    assert_all_readers_agree(&lab, run);
}
