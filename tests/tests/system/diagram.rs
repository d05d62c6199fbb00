//! `cars diagram` over real runs: the picture has as many things of each kind as the record.

use roxmltree::{Document, Node};
use serde_json::Value;
use system_tests::Lab;

use super::report::explain;

/// A picture, by its structure.
struct Picture {
    svg: String,
}

impl Picture {
    /// Draws a run; `args` follow its name.
    fn of(lab: &Lab, run: &str, args: &[&str]) -> Self {
        let svg = lab.ok(&[&["diagram", run], args].concat());
        Self { svg }
    }

    fn count(&self, is_counted: impl Fn(&Node<'_, '_>) -> bool) -> usize {
        let document = Document::parse(&self.svg).unwrap();
        document
            .descendants()
            .filter(|node| is_counted(node))
            .count()
    }

    /// Number of elements with a class.
    fn of_class(&self, class: &str) -> usize {
        self.count(|node| has_class(node, class))
    }

    /// The sum of an attribute over all elements with a class.
    fn sum(&self, class: &str, attribute: &str) -> usize {
        let document = Document::parse(&self.svg).unwrap();
        let found = document.descendants().filter(|node| has_class(node, class));
        found
            .map(|node| node.attribute(attribute).unwrap().parse::<usize>().unwrap())
            .sum()
    }
}

fn has_class(node: &Node<'_, '_>, class: &str) -> bool {
    let classes = node.attribute("class").unwrap_or_default();
    classes.split(' ').any(|one| one == class)
}

fn count(events: &[Value], kind: &str) -> usize {
    events.iter().filter(|event| event["event"] == kind).count()
}

/// Events about one robot.
fn count_of(events: &[Value], kind: &str, robot: &str) -> usize {
    let of_kind = events.iter().filter(|event| event["event"] == kind);
    of_kind.filter(|event| event["robot"] == robot).count()
}

/// What every picture of a run to its end has.
fn assert_agrees(picture: &Picture, events: &[Value]) {
    assert_agrees_up_to_the_end(picture, events);
    assert_eq!(picture.of_class("head"), count(events, "command_delivered"));
    assert_eq!(
        picture.of_class("fault"),
        count(events, "fault").div_ceil(2)
    );
    assert_eq!(picture.of_class("absence"), count(events, "lost"));
    assert_eq!(picture.sum("missed", "data-ticks"), count(events, "missed"));
    assert_eq!(picture.of_class("end-of-run"), 1);
}

#[test]
fn the_hall_with_and_without_a_recording() {
    let lab = Lab::new();
    lab.ok(&["run", "configs/hors_doeuvres.toml", "--run", "hall"]);
    let whole = Picture::of(&lab, "hall", &[]);
    let events = lab.events("hall");
    assert_agrees(&whole, &events);
    assert_eq!(whole.of_class("emotion"), count(&events, "emotion"));
    assert_eq!(whole.of_class("behavior"), count(&events, "behavior"));

    // Wall clock is all that a diagram takes from a recording, and in one process no clock was held.
    std::fs::remove_file(lab.file("hall", "run.mcap")).unwrap();
    assert_eq!(Picture::of(&lab, "hall", &[]).svg, whole.svg);
}

#[test]
fn a_window_has_what_began_before_it() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "hall",
        "--duration",
        "120 s",
    ]);
    let by_tick = Picture::of(&lab, "hall", &["--from", "102", "--to", "162"]);
    let by_time = Picture::of(&lab, "hall", &["--from", "51 s", "--to", "81 s"]);
    assert_eq!(by_tick.svg, by_time.svg);

    let events = lab.events("hall");
    let in_window = |event: &&Value| (102..=162).contains(&event["tick"].as_u64().unwrap());
    let changes = events
        .iter()
        .filter(in_window)
        .filter(|event| event["event"] == "emotion");
    assert_eq!(
        by_tick.of_class("emotion"),
        changes.count() + 2,
        "one band of each robot is from before"
    );

    let file = lab.out().join("window.svg");
    lab.ok(&[
        "diagram",
        "hall",
        "--from",
        "102",
        "--to",
        "162",
        "-o",
        file.to_str().unwrap(),
    ]);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), by_tick.svg);
}

#[test]
fn a_partition_is_shaded_for_its_time() {
    let lab = Lab::new();
    lab.ok(&["run", "configs/partition.toml", "--run", "cut"]);
    let picture = Picture::of(&lab, "cut", &["--whole"]);
    let events = lab.events("cut");
    assert_agrees(&picture, &events);
    assert!(count(&events, "command_dropped") > 0);
    assert_eq!(picture.of_class("partition"), 1);
    let document = Document::parse(&picture.svg).unwrap();
    let area = document
        .descendants()
        .find(|node| has_class(node, "partition"))
        .unwrap();
    assert_eq!(area.attribute("data-tick"), Some("240"));
}

#[test]
fn losses_are_breaks() {
    let lab = Lab::new();
    let set = [
        "network.commands.loss=0.3",
        "network.commands.duplication=0.3",
        r#"network.commands.delay={min="0 s",mode="1 s",max="5 s"}"#,
        "network.queries.loss=0.3",
    ];
    let mut args = vec!["run", "configs/three_robots.toml", "--run", "loss"];
    for change in &set {
        args.extend(["--set", change]);
    }
    lab.ok(&args);

    let events = lab.events("loss");
    for kind in [
        "command_dropped",
        "command_delayed",
        "command_duplicated",
        "query_lost",
    ] {
        assert!(count(&events, kind) > 0, "{kind}");
    }
    let picture = Picture::of(&lab, "loss", &[]);
    assert_agrees_up_to_the_end(&picture, &events);
    assert_eq!(picture.of_class("queries"), 0);
    let picture = Picture::of(&lab, "loss", &["--queries"]);
    assert_eq!(
        picture.sum("queries", "data-ticks"),
        count(&events, "query_lost")
    );
}

/// Commands may be under way when a run ends.
fn assert_agrees_up_to_the_end(picture: &Picture, events: &[Value]) {
    let sent = count(events, "command_sent");
    assert_eq!(picture.of_class("command"), sent);
    assert_eq!(picture.of_class("break"), count(events, "command_dropped"));
    assert_eq!(
        picture.of_class("delayed"),
        count(events, "command_delayed")
    );
    assert_eq!(
        picture.of_class("doubled"),
        count(events, "command_duplicated")
    );
}

#[test]
fn a_crash_and_a_return_are_marked() {
    let lab = Lab::new();
    let fault = r#"fault=[{ robot = "Leguin", do = "crash", at = "40 s", until = "70 s" }]"#;
    let args = [
        "launch",
        "launch/hors_doeuvres.toml",
        "--speed",
        "max",
        "--duration",
        "120 s",
        "--set",
        fault,
        "--set",
        "on_late=continue",
        "--set",
        "deadline=10 s",
    ];
    lab.start("crash", &args).finish();

    let events = lab.events("crash");
    let picture = Picture::of(&lab, "crash", &[]);
    assert_agrees(&picture, &events);
    assert_eq!(count_of(&events, "lost", "Leguin"), 1);
    assert_eq!(picture.of_class("joined"), 1);
}

#[test]
fn an_unfinished_run_is_drawn_up_to_where_it_is_recorded() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "hall",
        "--duration",
        "60 s",
    ]);
    let whole = lab.bytes("hall");
    let events = lab.file("hall", "events.jsonl");
    std::fs::write(&events, &whole[..whole.len() / 2]).unwrap();

    let picture = Picture::of(&lab, "hall", &[]);
    assert_eq!(picture.of_class("end-of-run"), 0);
    assert_eq!(picture.of_class("lane"), 2);
    let output = lab.cars(&["diagram", "hall"]).output().unwrap();
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(notes.contains("has no end"), "{notes}");
    assert!(!notes.contains("held up"), "{notes}");

    // Of the recording less is left than of the events: who was waited for is not known from there on.
    let recording = lab.file("hall", "run.mcap");
    let bytes = std::fs::read(&recording).unwrap();
    std::fs::write(&recording, &bytes[..bytes.len() / 3]).unwrap();
    let len = lab.recorded("hall").len();
    let output = lab.cars(&["diagram", "hall"]).output().unwrap();
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    let note = format!("ends before tick {len}: from there on it is not known");
    assert!(notes.contains(&note), "{notes}");
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "hall",
        "--duration",
        "30 s",
    ]);
    let events = lab.file("hall", "events.jsonl");

    let events = events.to_str().unwrap();
    refused(&lab, &["--from", "1000"], "ends with tick 60");
    refused(&lab, &["--from", "20", "--to", "10"], "the window is empty");
    refused(&lab, &["--from", "soon"], "neither a tick");
    refused(&lab, &["--epoch", "7"], "has no epoch 7, the last one is 1");
    refused(&lab, &["-o", events], "is part of the record of a run");
}

fn refused(lab: &Lab, args: &[&str], reason: &str) {
    let (_, text) = lab.fails(&[&["diagram", "hall"], args].concat());
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    assert!(words.join(" ").contains(reason), "{args:?}: {text}");
}

#[test]
fn what_decided_the_run_is_a_row_below_the_axis() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "hall",
        "--duration",
        "100 s",
    ]);
    let without = Picture::of(&lab, "hall", &[]);
    explain(&lab, "hall");
    let with = Picture::of(&lab, "hall", &[]);
    assert_eq!(
        (without.of_class("decision"), with.of_class("decision")),
        (0, 1)
    );
    assert_eq!(with.sum("jump", "data-tick"), 60);

    // Without the answer it is as it was, byte for byte.
    std::fs::remove_dir_all(lab.file("hall", "why")).unwrap();
    assert_eq!(Picture::of(&lab, "hall", &[]).svg, without.svg);
}
