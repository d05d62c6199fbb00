//! In which emotion and behavior each robot is, when it takes part, what became of commands, and when links were cut: all that count
//! it or show it agree with the events, also where robots crash, hang and come back, where links are cut and messages lost, in a
//! further epoch, after changes by hand, and in a run that was resumed.

use std::collections::{BTreeMap, BTreeSet};

use hunts::{FaultCase, Subject, Trial};
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

const PARTITION: &str =
    r#"network.partition=[{ groups = [["Butler"], ["Leguin"]], from = "36 s", until = "46 s" }]"#;
const COMMANDS: &str = r#"network.commands={ loss = 0.2, duplication = 0.2, delay = { min = "0 s", mode = "1 s", max = "9 s" } }"#;

/// Seconds by robot, kind of state, and state.
type Times = BTreeMap<(String, String, String), f64>;

/// Commands that were sent, and copies of them that arrived and that were lost, by link.
type Commands = BTreeMap<String, [u64; 3]>;
/// Links that were cut, with the first second and the second in which they were healed.
type Cuts = BTreeSet<(String, String, String)>;

fn key(robot: &str, kind: &str, state: &str) -> (String, String, String) {
    (robot.to_owned(), kind.to_owned(), state.to_owned())
}

/// The times of an epoch, counted tick by tick; of all ticks, or of those that robots reported.
fn times_of(events: &[Value], only_reported: bool) -> Times {
    let text = |event: &Value, field: &str| event[field].as_str().unwrap().to_owned();
    let last = events
        .iter()
        .filter(|event| event["event"] == "tick")
        .count()
        - 1;
    let mut states: BTreeMap<(String, String), String> = BTreeMap::new();
    let mut present: BTreeMap<String, bool> = BTreeMap::new();
    let mut missed = BTreeSet::new();
    let mut times = Times::new();
    for event in events {
        let kind = event["event"].as_str().unwrap();
        match kind {
            "joined" => _ = present.insert(text(event, "robot"), true),
            "lost" => _ = present.insert(text(event, "robot"), false),
            "missed" if only_reported => _ = missed.insert(text(event, "robot")),
            "emotion" | "behavior" => {
                states.insert((text(event, "robot"), kind.to_owned()), text(event, "to"));
            }
            "tick" if event["tick"].as_u64().unwrap() < last as u64 => {
                for ((robot, kind), state) in &states {
                    if present[robot] && !missed.contains(robot) {
                        *times.entry(key(robot, kind, state)).or_default() += TICK_S;
                    }
                }
                missed.clear();
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

/// The tables of a report: rows of cells, the head first.
fn tables_of(html: &str) -> Vec<Vec<Vec<String>>> {
    let document = parsed(html);
    let mut tables = Vec::new();
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
        tables.push(rows);
    }
    tables
}

/// The rows of the tables of a report with this column, without their heads.
fn rows_of(html: &str, column: usize, head: &str) -> Vec<Vec<Vec<String>>> {
    let mut tables = tables_of(html);
    tables.retain(|rows| rows[0].get(column).is_some_and(|one| one == head));
    let mut bodies = Vec::new();
    for rows in tables {
        bodies.push(rows[1..].to_vec());
    }
    bodies
}

/// The tables of emotions and behaviors of a report. The share of a state is one of the whole run.
fn times_in_report(html: &str, time_s: f64) -> Times {
    let mut times = Times::new();
    let kinds = ["emotion", "behavior"];
    for (kind, rows) in kinds.iter().zip(rows_of(html, 1, "state")) {
        for row in rows {
            let in_state_s: f64 = row[2].parse().unwrap();
            let percent: f64 = row[3].parse().unwrap();
            assert!(
                (percent - 100.0 * in_state_s / time_s).abs() < 1e-6,
                "{row:?}"
            );
            times.insert(key(&row[0], kind, &row[1]), in_state_s);
        }
    }
    times
}

/// The ticks in a title of a diagram.
fn ticks_in(title: &str) -> Vec<u64> {
    let parts = title.split("tick ").skip(1);
    let numbers = parts.map(|part| part.split(|c: char| !c.is_ascii_digit()).next().unwrap());
    numbers.map(|number| number.parse().unwrap()).collect()
}

/// The titles of the groups of a class, with the sender and the target where they have them.
fn titles_in_diagram(svg: &str, class: &str) -> Vec<(String, String)> {
    let document = parsed(svg);
    let mut titles = Vec::new();
    for group in document.descendants().filter(|node| node.has_tag_name("g")) {
        let classes = group.attribute("class").unwrap_or_default();
        let title = group.children().find(|node| node.has_tag_name("title"));
        if let Some(title) = title
            && classes.split(' ').any(|one| one == class)
        {
            let end = |name: &str| group.attribute(name).unwrap_or_default().to_owned();
            let link = format!("{} -> {}", end("data-from"), end("data-to"));
            titles.push((link, title.text().unwrap().to_owned()));
        }
    }
    titles
}

/// The lengths of the bands of a diagram.
fn times_in_diagram(svg: &str, last: u64) -> Times {
    let mut times = Times::new();
    for kind in ["emotion", "behavior"] {
        for (_, title) in titles_in_diagram(svg, kind) {
            let (robot, rest) = title.split_once(": ").unwrap();
            let (_, rest) = rest.split_once(' ').unwrap();
            let (state, rest) = rest.split_once(", ").unwrap();
            let ticks = ticks_in(rest);
            let end = ticks.get(1).copied().unwrap_or(last);
            let time = times.entry(key(robot, kind, state)).or_default();
            *time += (end - ticks[0]) as f64 * TICK_S;
        }
    }
    times
}

/// The rows of the exported states of the last epoch.
fn times_in_table(csv: &str, last: u64) -> Times {
    let mut rows = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let rows: Vec<Vec<&str>> = rows.collect();
    let column = |name: &str| head.iter().position(|one| *one == name).unwrap();
    let epoch = rows.last().unwrap()[column("epoch")];

    let mut times = Times::new();
    for row in rows {
        let tick: u64 = row[column("tick")].parse().unwrap();
        for kind in ["emotion", "behavior"] {
            let state = row[column(kind)];
            if row[column("epoch")] == epoch && tick < last && !state.is_empty() {
                let state = key(row[column("robot")], kind, state);
                *times.entry(state).or_default() += TICK_S;
            }
        }
    }
    times
}

fn commands_of(events: &[Value]) -> Commands {
    let mut commands = Commands::new();
    for event in events {
        let index = match event["event"].as_str().unwrap() {
            "command_sent" => 0,
            "command_delivered" => 1,
            "command_dropped" => 2,
            _ => continue,
        };
        let end = |name: &str| event[name].as_str().unwrap().to_owned();
        let link = format!("{} -> {}", end("from"), end("to"));
        commands.entry(link).or_default()[index] += 1;
    }
    commands
}

fn commands_in_summary(summary: &Value) -> Commands {
    let mut commands = Commands::new();
    for (link, counts) in summary["network"]["links"].as_object().unwrap() {
        let dropped = counts["dropped"].as_object().unwrap().values();
        let dropped = dropped.map(|count| count.as_u64().unwrap()).sum();
        let count = |name: &str| counts[name].as_u64().unwrap();
        commands.insert(link.clone(), [count("sent"), count("delivered"), dropped]);
    }
    // Links on which there were only queries.
    commands.retain(|_, counts| *counts != [0; 3]);
    commands
}

fn commands_in_report(html: &str) -> Commands {
    let mut commands = Commands::new();
    for row in rows_of(html, 0, "Link").concat() {
        let count = |index: usize| row[index].parse().unwrap();
        commands.insert(row[0].replace('→', "->"), [count(1), count(2), count(3)]);
    }
    commands
}

fn commands_in_diagram(svg: &str) -> Commands {
    let mut commands = Commands::new();
    for (link, title) in titles_in_diagram(svg, "command") {
        let counts = commands.entry(link).or_default();
        counts[0] += 1;
        counts[1] += title.matches("; arrives in ").count() as u64;
        counts[2] += title.matches("; lost in ").count() as u64;
    }
    commands
}

fn cuts_of(events: &[Value]) -> Cuts {
    let mut open = BTreeMap::new();
    let mut cuts = Cuts::new();
    for event in events {
        let end = |name: &str| event[name].as_str().unwrap().to_owned();
        let time = || (event["tick"].as_u64().unwrap() as f64 * TICK_S).to_string();
        match event["event"].as_str().unwrap() {
            "link_cut" => {
                open.insert(format!("{} -> {}", end("from"), end("to")), time());
            }
            "link_healed" => {
                let link = format!("{} -> {}", end("from"), end("to"));
                let begin = open.remove(&link).unwrap();
                cuts.insert((link, begin, time()));
            }
            _ => {}
        }
    }
    assert!(open.is_empty(), "{open:?}");
    cuts
}

fn cuts_in_summary(summary: &Value) -> Cuts {
    let mut cuts = Cuts::new();
    for cut in summary["network"]["cuts"].as_array().unwrap() {
        let end = |name: &str| cut[name].as_str().unwrap();
        let time = |name: &str| cut[name].as_f64().unwrap().to_string();
        let link = format!("{} -> {}", end("from"), end("to"));
        cuts.insert((link, time("from_s"), time("until_s")));
    }
    cuts
}

fn cuts_in_report(html: &str) -> Cuts {
    let time = |cell: &str| cell.parse::<f64>().unwrap().to_string();
    let rows = rows_of(html, 1, "what").concat().into_iter();
    rows.filter(|row| row[1] == "cut")
        .map(|row| (row[2].replace('→', "->"), time(&row[3]), time(&row[4])))
        .collect()
}

fn cuts_in_diagram(svg: &str) -> Cuts {
    let mut cuts = Cuts::new();
    for (_, title) in titles_in_diagram(svg, "partition") {
        for cut in title.trim_start_matches("cut:").split_terminator(';') {
            let (link, period) = cut.trim().split_once(", commands and queries, ").unwrap();
            let ticks = ticks_in(period);
            let time = |tick: u64| (tick as f64 * TICK_S).to_string();
            cuts.insert((link.replace('→', "->"), time(ticks[0]), time(ticks[1])));
        }
    }
    cuts
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
    let events = lab.events(run);
    let summary = lab.summary(run);
    let report = lab.ok(&["report", run]);
    let diagram = lab.ok(&["diagram", run]);
    let last = summary["ticks"].as_u64().unwrap();

    let expected = times_of(&events, false);
    assert_same_times(&times_in_summary(&summary), &expected, "summary");
    let time_s = summary["time_s"].as_f64().unwrap();
    assert_same_times(&times_in_report(&report, time_s), &expected, "report");
    assert_same_times(&times_in_diagram(&diagram, last), &expected, "diagram");

    let tables = lab.out().join(format!("{run}-tables"));
    lab.ok(&["export", run, "--csv", "-o", tables.to_str().unwrap()]);
    let table = std::fs::read_to_string(tables.join("states.csv")).unwrap();
    let reported = times_of(&events, true);
    assert_same_times(&times_in_table(&table, last), &reported, "states.csv");

    let commands = commands_of(&events);
    assert!(!commands.is_empty());
    assert_eq!(commands_in_summary(&summary), commands);
    assert_eq!(commands_in_report(&report), commands);
    assert_eq!(commands_in_diagram(&diagram), commands);

    let cuts = cuts_of(&events);
    assert_eq!(cuts.len(), 2);
    assert_eq!(cuts_in_summary(&summary), cuts);
    assert_eq!(cuts_in_report(&report), cuts);
    assert_eq!(cuts_in_diagram(&diagram), cuts);

    let emotions: Times = expected
        .iter()
        .filter(|((_, kind, _), _)| kind == "emotion")
        .map(|(state, time_s)| (state.clone(), *time_s))
        .collect();
    let xml = lab.ok(&["export", run, "--emotionml"]);
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

/// A hunt plays the scenario of a run again: robots send the same commands.
fn assert_hunt_agrees(lab: &Lab, run: &str) {
    let subject = Subject::load(&lab.file(run, "scenario.toml"), &Default::default()).unwrap();
    let played = subject
        .play(&FaultCase::default(), &BTreeSet::new())
        .unwrap();

    let mut lost = BTreeSet::new();
    let mut sent = Vec::new();
    let id = |event: &Value| (event["from"].to_string(), event["seq"].to_string());
    let events = lab.events(run);
    for event in &events {
        match event["event"].as_str().unwrap() {
            "command_dropped" => _ = lost.insert(id(event)),
            "command_sent" => sent.push(event),
            _ => {}
        }
    }
    assert!(!lost.is_empty());
    assert_eq!(played.sent.len(), sent.len());
    for (played, event) in played.sent.iter().zip(sent) {
        assert_eq!(played.tick, event["tick"]);
        assert_eq!(*played.link.from.as_str(), event["from"]);
        assert_eq!(*played.link.to.as_str(), event["to"]);
        assert_eq!(played.text, event["command"]);
        assert_eq!(played.is_lost, lost.contains(&id(event)), "{event}");
    }
}

#[test]
fn all_readers_count_a_robot_that_is_lost_in_no_state() {
    let lab = Lab::new();
    let faulty = [
        "--set",
        FAULTS,
        "--set",
        "on_late=continue",
        "--set",
        PARTITION,
        "--set",
        COMMANDS,
        "--duration",
        "100 s",
    ];
    let printed = lab.ok(&[&["run", HALL, "--run", "crash", "--seed", "1"], &faulty[..]].concat());
    let times = assert_all_readers_agree(&lab, "crash");
    assert_hunt_agrees(&lab, "crash");

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
         set = ['''{FAULTS}''', '''{PARTITION}''', '''{COMMANDS}''', 'on_late=continue']\n"
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
    lab.step(run, 8);
    lab.ctl(run, &["cut", "Butler", "Leguin"]);
    lab.step(run, 8);
    lab.ctl(run, &["heal"]);
    lab.ctl(run, &["set", "robot.Butler.params.policy=rules"]);
    // Leguin takes no part at this time.
    lab.step(run, 24);
    send(launch.process("cars-sim"), Signal::SIGKILL);
    assert!(!launch.wait().success());
    nobody_is_left(run);

    lab.ok(&["launch", "--no-console", "--resume", run, "--speed", "max"]);
    assert_all_readers_agree(&lab, run);
}
