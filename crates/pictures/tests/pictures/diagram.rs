//! What is in the picture, by its structure.

use pictures::diagram::{Diagram, DiagramOptions, MAX_ITEMS, TooMuch};
use pictures::{style, width_px};
use protocol::event::Cause;
use protocol::messages::{Awaited, FaultKind, Performative, Point, Reason, SiteRefusal};
use protocol::{Event, RobotName, Tick};
use roxmltree::{Document, Node};
use timeline::{
    DecisionJump, DecisionPoint, DecisionQuestion, ForkOutcomes, RunDecision, Timeline,
};

fn name(text: &str) -> RobotName {
    RobotName::new(text).unwrap()
}

fn emotion(robot: &str, to: &str) -> Event {
    Event::Emotion {
        robot: name(robot),
        from: None,
        to: to.to_owned(),
    }
}

fn behavior(robot: &str, to: &str) -> Event {
    Event::Behavior {
        robot: name(robot),
        from: None,
        to: to.to_owned(),
    }
}

fn sent(seq: u64, text: &str) -> Event {
    Event::CommandSent {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
        performative: Performative::Achieve,
        command: text.to_owned(),
        payload: None,
        payload_of: None,
    }
}

fn delivered(seq: u64) -> Event {
    Event::CommandDelivered {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
    }
}

fn dropped(seq: u64, because: Cause) -> Event {
    Event::CommandDropped {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
        because,
    }
}

fn delayed(seq: u64, until: Tick) -> Event {
    Event::CommandDelayed {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
        until,
        because: None,
    }
}

fn doubled(seq: u64) -> Event {
    Event::CommandDuplicated {
        from: name("Butler"),
        to: name("Leguin"),
        seq,
        because: None,
    }
}

fn joined(robot: &str, generation: Option<u32>) -> Event {
    Event::Joined {
        robot: name(robot),
        generation,
        at: Point { x: 0.0, y: 0.0 },
    }
}

fn cut(from: &str, to: &str) -> Event {
    Event::LinkCut {
        from: name(from),
        to: name(to),
        commands: true,
        queries: true,
    }
}

fn healed(from: &str, to: &str) -> Event {
    Event::LinkHealed {
        from: name(from),
        to: name(to),
    }
}

fn fault(robot: &str, kind: FaultKind, begins: bool) -> Event {
    Event::Fault {
        robot: name(robot),
        kind,
        begins,
    }
}

/// The beginning of every run here.
fn start() -> Vec<Event> {
    vec![
        joined("Butler", None),
        joined("Leguin", None),
        emotion("Butler", "HAPPY"),
        behavior("Butler", "SERVE"),
        emotion("Leguin", "HAPPY"),
        behavior("Leguin", "WAIT"),
    ]
}

/// Draws the ticks from `from` to `to` of a run with these events after its beginning.
fn draw_with(
    events: &[(Tick, Event)],
    from: Tick,
    to: Tick,
    options: DiagramOptions,
) -> Result<String, TooMuch> {
    let of_tick = |tick: Tick| -> Vec<Event> {
        let mut all = if tick == 0 { start() } else { Vec::new() };
        all.extend(
            events
                .iter()
                .filter(|(at, _)| *at == tick)
                .map(|(_, event)| event.clone()),
        );
        all
    };

    let mut timeline = Timeline::new(&[name("Butler"), name("Leguin")]);
    for tick in 0..from {
        timeline.tick(tick, &of_tick(tick));
    }
    let mut diagram = Diagram::new(timeline, 0.5, from, options);
    for tick in from..=to {
        diagram.tick(tick, &of_tick(tick), &[]);
    }
    diagram.to_svg()
}

fn draw(events: &[(Tick, Event)], from: Tick, to: Tick) -> String {
    draw_with(events, from, to, DiagramOptions::default()).unwrap()
}

/// The elements of a class, in their order.
fn of_class<'a, 'input>(document: &'a Document<'input>, class: &str) -> Vec<Node<'a, 'input>> {
    let has_class = |node: &Node<'_, '_>| {
        let classes = node.attribute("class").unwrap_or_default();
        classes.split(' ').any(|one| one == class)
    };
    document.descendants().filter(has_class).collect()
}

/// The parts of one element that have a class.
fn parts<'a, 'input>(node: Node<'a, 'input>, class: &str) -> Vec<Node<'a, 'input>> {
    let all = node.descendants();
    all.filter(|part| part.attribute("class") == Some(class))
        .collect()
}

fn title<'a>(node: Node<'a, '_>) -> &'a str {
    node.first_element_child().unwrap().text().unwrap()
}

fn tick(node: Node<'_, '_>) -> Tick {
    node.attribute("data-tick").unwrap().parse().unwrap()
}

fn number(node: Node<'_, '_>, attribute: &str) -> f64 {
    node.attribute(attribute).unwrap().parse().unwrap()
}

/// The points of a path of straight lines.
fn points(path: Node<'_, '_>) -> Vec<(f64, f64)> {
    let d = path.attribute("d").unwrap();
    d.split(['M', 'L'])
        .filter(|point| !point.is_empty())
        .map(|point| {
            let (x, y) = point.split_once(' ').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        })
        .collect()
}

/// Where a tick begins, by the attribute of the root from which programs find it.
fn x_of(document: &Document<'_>, tick: Tick) -> f64 {
    let scale = document.root_element().attribute("data-scale").unwrap();
    let mut before: Option<(f64, f64)> = None;
    for knot in scale.split(", ") {
        let (x, at) = knot.split_once(' ').unwrap();
        let knot: (f64, f64) = (x.parse().unwrap(), at.parse().unwrap());
        if let Some(before) = before
            && tick as f64 <= knot.1
        {
            let share = (tick as f64 - before.1) / (knot.1 - before.1);
            return before.0 + share * (knot.0 - before.0);
        }
        before = Some(knot);
    }
    panic!("tick {tick} is not in the window");
}

fn is_at(document: &Document<'_>, x: f64, tick: Tick) -> bool {
    (x - x_of(document, tick)).abs() < 0.2
}

#[test]
fn a_command_is_a_line_from_its_tick_to_that_of_its_arrival() {
    let events = [(10, sent(1, "refill")), (11, delivered(1))];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let [command] = of_class(&document, "command")[..] else {
        panic!("{svg}");
    };
    assert_eq!(command.attribute("class"), Some("command delivered"));
    assert_eq!(tick(command), 10);
    assert_eq!(command.attribute("data-to"), Some("Leguin"));
    assert_eq!(
        title(command),
        "Butler → Leguin, command 1: achieve “refill”; sent in tick 10 (5 s); arrives in tick 11 (5.5 s)"
    );
    let [line] = parts(command, "line")[..] else {
        panic!("{svg}");
    };
    let [from, to] = points(line)[..] else {
        panic!("{svg}");
    };
    assert!(
        is_at(&document, from.0, 10) && is_at(&document, to.0, 11),
        "{svg}"
    );
    assert!(from.1 < to.1, "Butler is above Leguin");
    assert_eq!(parts(command, "head").len(), 1);
    assert_eq!(of_class(&document, "break").len(), 0);
    let label = of_class(&document, "text")[0];
    let text: String = label.descendants().filter_map(|node| node.text()).collect();
    assert!(text.contains("refill"), "{text}");
}

#[test]
fn a_lost_command_ends_in_a_break_with_its_reason() {
    let events = [(10, sent(1, "refill")), (11, dropped(1, Cause::Burst))];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let command = of_class(&document, "command")[0];
    assert_eq!(command.attribute("class"), Some("command lost"));
    assert_eq!(parts(command, "break").len(), 1);
    assert_eq!(parts(command, "head").len(), 0);
    assert!(title(command).ends_with("lost in tick 11 (5.5 s), in a burst"));
    let end = *points(parts(command, "line")[0]).last().unwrap();
    assert!(is_at(&document, end.0, 11));
    let leguin = number(parts(of_class(&document, "emotion")[1], "band e0")[0], "y");
    assert!(end.1 + 20.0 < leguin, "the line ends before Leguin's lane");
    assert_eq!(of_class(&document, "reason")[0].text(), Some("burst"));
}

#[test]
fn a_delayed_command_waits_beside_the_lane_of_its_target() {
    let events = [
        (10, sent(1, "refill")),
        (11, delayed(1, 20)),
        (20, delivered(1)),
    ];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let command = of_class(&document, "command")[0];
    assert_eq!(
        command.attribute("class"),
        Some("command delivered delayed")
    );
    let [begin, end] = points(parts(command, "wait")[0])[..] else {
        panic!("{svg}");
    };
    assert!(is_at(&document, begin.0, 11), "{svg}");
    assert_eq!(begin.1, end.1);
    let head = points(parts(command, "head")[0])[0];
    assert!(is_at(&document, head.0, 20) && head.0 > end.0);
    assert!(title(command).contains("held back until tick 20 (10 s)"));
}

#[test]
fn a_command_in_the_queue_of_a_radio_says_so() {
    let queued = Event::CommandDelayed {
        from: name("Butler"),
        to: name("Leguin"),
        seq: 1,
        until: 20,
        because: Some(Cause::Queue),
    };
    let events = [(10, sent(1, "refill")), (11, queued), (20, delivered(1))];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();
    let command = of_class(&document, "command")[0];
    let expected = format!("held back until tick 20 (10 s), {}", Cause::Queue);
    assert!(title(command).contains(&expected), "{}", title(command));
    assert!(svg.contains(">in the queue<"), "the legend");

    let both = [&events[..], &[(10, sent(2, "hurry")), (11, delayed(2, 14))]].concat();
    assert!(draw(&both, 0, 40).contains(">held back or in the queue<"));
}

#[test]
fn a_doubled_command_forks() {
    let events = [
        (10, sent(1, "refill")),
        (11, doubled(1)),
        (11, delivered(1)),
        (11, delivered(1)),
        (20, sent(2, "hurry")),
        (21, doubled(2)),
        (21, delivered(2)),
        (21, dropped(2, Cause::Overflow)),
    ];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let commands = of_class(&document, "command");
    assert_eq!(
        commands[0].attribute("class"),
        Some("command delivered doubled")
    );
    assert_eq!(parts(commands[0], "head").len(), 2);
    assert_eq!(parts(commands[0], "line").len(), 3);
    assert_eq!(commands[1].attribute("class"), Some("command lost doubled"));
    assert_eq!(parts(commands[1], "head").len(), 1);
    assert_eq!(parts(commands[1], "break").len(), 1);
}

#[test]
fn commands_enter_from_before_the_window_and_leave_after_it() {
    let events = [
        (10, sent(1, "early")),
        (11, delayed(1, 30)),
        (30, delivered(1)),
        (39, sent(2, "late")),
        (40, delayed(2, 90)),
        (40, sent(3, "last")),
    ];
    let svg = draw(&events, 20, 40);
    let document = Document::parse(&svg).unwrap();

    let commands = of_class(&document, "command");
    let classes: Vec<_> = commands
        .iter()
        .map(|command| command.attribute("class").unwrap())
        .collect();
    assert_eq!(
        classes,
        [
            "command delivered delayed enters",
            "command under-way delayed leaves",
            "command under-way leaves"
        ]
    );
    let wait = points(parts(commands[0], "wait")[0]);
    assert!(
        wait[0].0 < x_of(&document, 20),
        "it waits from before the window on"
    );
    assert_eq!(parts(commands[0], "start").len(), 0);
    assert_eq!(tick(commands[0]), 20);
    for command in &commands[1..] {
        assert!(title(*command).ends_with("under way at the end of the window"));
        assert_eq!(parts(*command, "head").len(), 0);
    }
    let wait = points(parts(commands[1], "wait")[0]);
    assert!(
        wait[1].0 > x_of(&document, 41),
        "it waits on after the window"
    );
}

#[test]
fn states_are_bands_from_before_the_window_to_its_end() {
    let events = [
        (15, emotion("Butler", "CONCERNED")),
        (30, emotion("Butler", "BORED")),
    ];
    let svg = draw(&events, 10, 40);
    let document = Document::parse(&svg).unwrap();

    let titles: Vec<_> = of_class(&document, "emotion")
        .into_iter()
        .map(title)
        .collect();
    assert_eq!(
        titles,
        [
            "Butler: emotion HAPPY, tick 0 (0 s) to tick 15 (7.5 s)",
            "Butler: emotion CONCERNED, tick 15 (7.5 s) to tick 30 (15 s)",
            "Butler: emotion BORED, from tick 30 (15 s) on",
            "Leguin: emotion HAPPY, from tick 0 (0 s) on",
        ]
    );
    assert_eq!(of_class(&document, "behavior").len(), 2);
    let first = parts(of_class(&document, "emotion")[0], "band e0")[0];
    assert!(is_at(&document, number(first, "x"), 10));
    let width = number(first, "width");
    assert!(is_at(&document, number(first, "x") + width, 15));
    assert_eq!(tick(of_class(&document, "emotion")[0]), 10);
}

#[test]
fn partitions_are_shaded_between_the_lanes_that_they_separate() {
    let both = |tick, event: fn(&str, &str) -> Event| {
        [
            (tick, event("Butler", "Leguin")),
            (tick, event("Leguin", "Butler")),
        ]
    };
    let mut events = vec![(5, joined("Vonda", Some(1)))];
    events.extend(both(10, cut));
    events.extend(both(20, healed));
    events.push((30, cut("Butler", "Vonda")));
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let areas = of_class(&document, "partition");
    let ticks: Vec<Tick> = areas.iter().map(|area| tick(*area)).collect();
    assert_eq!(ticks, [10, 30, 30], "the second one crosses two spaces");
    let shade = parts(areas[0], "cut")[0];
    let left = number(shade, "x");
    assert!(is_at(&document, left, 10) && is_at(&document, left + number(shade, "width"), 20));
    assert!(title(areas[0]).contains("Leguin → Butler, commands and queries"));
    let texts: Vec<_> = of_class(&document, "reason")
        .into_iter()
        .map(|node| node.text())
        .collect();
    assert!(texts.contains(&Some("Butler → Vonda cut")), "{texts:?}");
}

#[test]
fn a_crash_a_return_and_missed_ticks_are_marked() {
    let missed = || Event::Missed {
        robot: name("Leguin"),
    };
    let lost = Event::Lost {
        robot: name("Leguin"),
    };
    let events = [
        (10, fault("Leguin", FaultKind::Crash, true)),
        (10, lost),
        (10, missed()),
        (11, missed()),
        (12, missed()),
        (13, fault("Leguin", FaultKind::Crash, false)),
        (13, joined("Leguin", Some(2))),
        (20, missed()),
        (25, fault("Butler", FaultKind::Hang, true)),
    ];
    let svg = draw(&events, 0, 40);
    let document = Document::parse(&svg).unwrap();

    let faults = of_class(&document, "fault");
    assert_eq!(faults.len(), 2);
    assert_eq!(parts(faults[0], "crash").len(), 1);
    assert_eq!(parts(faults[1], "hang").len(), 1);
    let ticks: Vec<_> = of_class(&document, "missed")
        .iter()
        .map(|missed| missed.attribute("data-ticks").unwrap())
        .collect();
    assert_eq!(ticks, ["3", "1"]);
    assert_eq!(of_class(&document, "absence").len(), 1);
    assert_eq!(tick(of_class(&document, "joined")[0]), 13);
    let bands: Vec<_> = of_class(&document, "emotion")
        .into_iter()
        .map(title)
        .collect();
    assert!(
        bands.contains(&"Leguin: emotion HAPPY, tick 0 (0 s) to tick 10 (5 s)"),
        "{bands:?}"
    );
    assert!(
        bands.contains(&"Leguin: emotion HAPPY, from tick 13 (6.5 s) on"),
        "{bands:?}"
    );
}

#[test]
fn what_was_over_before_the_window_is_not_in_it() {
    let events = [
        (
            2,
            Event::Missed {
                robot: name("Leguin"),
            },
        ),
        (3, sent(1, "refill")),
        (4, delivered(1)),
        (5, cut("Butler", "Leguin")),
        (6, healed("Butler", "Leguin")),
        (7, fault("Leguin", FaultKind::Slow, true)),
        (8, fault("Leguin", FaultKind::Slow, false)),
    ];
    let svg = draw(&events, 20, 40);
    let document = Document::parse(&svg).unwrap();
    for class in ["missed", "command", "partition", "fault"] {
        assert_eq!(of_class(&document, class).len(), 0, "{class}");
    }
}

#[test]
fn a_tick_that_was_held_up_names_the_robot_and_that_it_is_not_reproducible() {
    let mut diagram = Diagram::new(Timeline::default(), 0.5, 0, DiagramOptions::default());
    diagram.tick(0, &start(), &[]);
    let awaited = Awaited {
        name: name("Leguin"),
        since_s: 1.24,
        because: Reason::Silent,
    };
    diagram.tick(1, &[], &[awaited]);
    let svg = diagram.to_svg().unwrap();
    let document = Document::parse(&svg).unwrap();

    let [held] = of_class(&document, "held-up")[..] else {
        panic!("{svg}");
    };
    assert_eq!(tick(held), 1);
    assert!(
        title(held)
            .contains("held for 1.2 s of wall clock, because Leguin is there but has not reported")
    );
    assert!(title(held).contains("differs from run to run"));
}

#[test]
fn a_change_of_the_scenario_is_a_line_with_what_is_set() {
    let mut events = Vec::new();
    for event in start() {
        events.push((0, event));
    }
    let set = "network.commands.loss=0.5".to_owned();
    events.push((
        7,
        Event::Changed {
            set: set.clone(),
            by_hand: false,
        },
    ));

    let text = draw(&events, 0, 20);
    let document = Document::parse(&text).unwrap();
    let changes = of_class(&document, "change");
    assert_eq!(changes.len(), 1);
    assert_eq!(tick(changes[0]), 7);
    assert!(title(changes[0]).contains(&set), "{}", title(changes[0]));
    assert!(text.contains(&format!(">{set}<")), "{text}");
}

#[test]
fn changes_by_hand_are_named_by_what_they_do() {
    let hang = r#"{ at = "5 s", do = "hang", robot = "Leguin" }"#;
    let over = r#"{ at = "5 s", do = "hang", robot = "Leguin", until = "10 s" }"#;
    let crash = r#"{ at = "10 s", do = "crash", robot = "Butler" }"#;
    let changed = |tick, set: String| (tick, Event::Changed { set, by_hand: true });
    let events = [
        changed(10, format!("fault=[{hang}]")),
        changed(20, format!("fault=[{over}, {crash}]")),
        changed(20, r#"robot.Leguin.on_late="wait""#.to_owned()),
        changed(20, r#"robot.Butler.on_late="wait""#.to_owned()),
    ];

    // What was set before the window is known, too.
    for from in [0, 15] {
        let text = draw(&events, from, 40);
        let document = Document::parse(&text).unwrap();
        let mut labels = Vec::new();
        for label in of_class(&document, "mark") {
            labels.push(label.text().unwrap());
        }
        let last = r#"recover Leguin, crash Butler, +2"#;
        let expected: &[&str] = if from == 0 {
            &["hang Leguin", last]
        } else {
            &[last]
        };
        assert_eq!(labels, expected, "{text}");
    }
}

#[test]
fn heading_and_legend_fit_however_short_the_window_is() {
    let mut events = Vec::new();
    for (seq, event) in [sent(1, "refill"), sent(2, "hurry"), sent(3, "come")]
        .into_iter()
        .enumerate()
    {
        events.push((5, event));
        events.push((5, delayed(seq as u64 + 1, 9)));
    }
    events.push((5, dropped(1, Cause::Loss)));
    events.push((5, doubled(2)));
    events.push((5, cut("Butler", "Leguin")));
    events.push((
        5,
        Event::Missed {
            robot: name("Leguin"),
        },
    ));
    let title = "a title of a run that is not short, seed 17";

    for width in [None, Some((720.0, 150))] {
        let options = DiagramOptions {
            title: title.to_owned(),
            width,
            ..DiagramOptions::default()
        };
        let text = draw_with(&events, 5, 5, options).unwrap();
        let document = Document::parse(&text).unwrap();
        let width = number(document.root_element(), "width");

        let heading = &of_class(&document, "heading")[0];
        let heading_px = width_px(heading.text().unwrap(), 12.0);
        assert!(number(*heading, "x") + heading_px <= width, "{text}");
        let entries = of_class(&document, "legend");
        assert!(entries.len() > 7, "{text}");
        for entry in entries {
            let label = entry.last_element_child().unwrap();
            let right = number(label, "x") + width_px(label.text().unwrap(), 10.5);
            assert!(right <= width, "{right} of {width}: {text}");
        }
    }
}

#[test]
fn lost_queries_are_drawn_on_demand() {
    let lost = |tick| {
        let event = Event::QueryLost {
            from: name("Butler"),
            to: name("Leguin"),
            because: Cause::Loss,
        };
        (tick, event)
    };
    let events = [lost(5), lost(6), lost(9)];
    let with = DiagramOptions {
        queries: true,
        ..DiagramOptions::default()
    };

    let svg = draw_with(&events, 0, 40, with).unwrap();
    let document = Document::parse(&svg).unwrap();
    let ticks: Vec<_> = of_class(&document, "queries")
        .iter()
        .map(|lost| lost.attribute("data-ticks").unwrap())
        .collect();
    assert_eq!(ticks, ["2", "1"]);
    let without = draw(&events, 0, 40);
    let document = Document::parse(&without).unwrap();
    assert_eq!(of_class(&document, "queries").len(), 0);
}

#[test]
fn quiet_time_of_a_wide_window_is_a_gap_unless_the_whole_is_wanted() {
    let events = [
        (10, sent(1, "refill")),
        (11, delivered(1)),
        (400, sent(2, "hurry")),
        (401, delivered(2)),
    ];
    let svg = draw(&events, 0, 420);
    let document = Document::parse(&svg).unwrap();
    let [gap] = of_class(&document, "gap")[..] else {
        panic!("{svg}");
    };
    assert!(title(gap).starts_with("nothing happens for 190.5 s, from tick 15 to tick 396"));
    // Elsewhere the scale is the same.
    let before = x_of(&document, 11) - x_of(&document, 10);
    let after = x_of(&document, 401) - x_of(&document, 400);
    assert!((before - after).abs() < 0.05, "{before} {after}");

    let whole = DiagramOptions {
        is_whole: true,
        ..DiagramOptions::default()
    };
    let svg = draw_with(&events, 0, 420, whole).unwrap();
    let document = Document::parse(&svg).unwrap();
    assert_eq!(of_class(&document, "gap").len(), 0);
}

#[test]
fn the_operator_has_a_lane_if_it_sends_commands() {
    let command = Event::CommandSent {
        from: RobotName::operator(),
        to: name("Leguin"),
        seq: 1,
        performative: Performative::Achieve,
        command: "refill".to_owned(),
        payload: None,
        payload_of: None,
    };
    let lanes = |events: &[(Tick, Event)]| {
        let svg = draw(events, 0, 40);
        let document = Document::parse(&svg).unwrap();
        let lanes = of_class(&document, "lane");
        let names = lanes
            .iter()
            .map(|lane| lane.attribute("data-robot").unwrap().to_owned());
        names.collect::<Vec<_>>()
    };

    assert_eq!(lanes(&[]), ["Butler", "Leguin"]);
    assert_eq!(lanes(&[(5, command)]), ["operator", "Butler", "Leguin"]);
}

#[test]
fn texts_of_robots_cannot_leave_their_place() {
    let hostile = "</text><script>alert(1)</script>\u{0}\u{1b}[2J\u{202e}\u{fffe}&\"'\n]]>";
    let events = [
        (10, sent(1, hostile)),
        (11, delivered(1)),
        (12, emotion("Butler", hostile)),
        (13, behavior("Butler", hostile)),
        (14, sent(2, &"<".repeat(100_000))),
    ];
    let options = DiagramOptions {
        title: hostile.to_owned(),
        ..DiagramOptions::default()
    };
    let svg = draw_with(&events, 0, 300, options).unwrap();

    let document = Document::parse(&svg).unwrap();
    let is_script = |node: Node<'_, '_>| node.has_tag_name("script");
    assert!(!document.descendants().any(is_script));
    assert!(svg.contains("&lt;script&gt;"), "the text is shown");
    let is_steering = |c: char| c.is_control() && c != '\n';
    assert!(!svg.contains(is_steering) && !svg.contains('\u{202e}'));
    assert!(svg.len() < 100_000, "{} bytes", svg.len());
}

/// Events of so many ticks: a command in each tick that arrives in the next one, and a new emotion in every third.
fn eventful(ticks: Tick) -> Vec<(Tick, Event)> {
    let mut events = Vec::new();
    for tick in 1..ticks {
        events.push((tick, sent(tick, &format!("command number {tick}"))));
        if tick > 1 {
            let fate = match tick % 5 {
                0 => dropped(tick - 1, Cause::Loss),
                _ => delivered(tick - 1),
            };
            events.push((tick, fate));
        }
        if tick % 3 == 0 {
            events.push((
                tick,
                emotion("Leguin", ["HAPPY", "CONCERNED"][tick as usize % 2]),
            ));
        }
    }
    events
}

#[test]
fn ten_thousand_events_are_a_picture_of_a_few_megabytes_without_labels_over_labels() {
    let events = eventful(4300);
    assert!(events.len() >= 10_000);
    let svg = draw(&events, 0, 4300);
    assert!(svg.len() < 4 << 20, "{} bytes", svg.len());
    assert_eq!(
        svg,
        draw(&events, 0, 4300),
        "the same events give the same bytes"
    );

    let document = Document::parse(&svg).unwrap();
    let root = document.root_element();
    assert!(number(root, "width") <= 4800.0);
    let lost = events
        .iter()
        .filter(|(_, event)| matches!(event, Event::CommandDropped { .. }));
    assert_eq!(of_class(&document, "break").len(), lost.count());

    let labels = of_class(&document, "label");
    assert!(labels.len() > 50, "{} labels", labels.len());
    let mut places = Vec::new();
    for label in labels {
        let text: String = label.descendants().filter_map(|node| node.text()).collect();
        // Narrower than any font is.
        let width = text.chars().count() as f64 * 3.0;
        let x = number(label, "x");
        let left = if label.attribute("text-anchor") == Some("end") {
            x - width
        } else {
            x
        };
        places.push((left, left + width, number(label, "y")));
    }
    for (index, one) in places.iter().enumerate() {
        for other in &places[index + 1..] {
            let is_apart = one.1 <= other.0 || other.1 <= one.0 || (one.2 - other.2).abs() >= 12.9;
            assert!(is_apart, "{one:?} {other:?}");
        }
    }
}

#[test]
fn a_window_with_too_much_is_refused() {
    let events = eventful(12_000);
    let drawn = draw_with(&events, 0, 12_000, DiagramOptions::default());
    let refused = drawn.err().unwrap();
    // A band for every third tick, a command for each, the last bands, and the begin of a run.
    assert_eq!(refused.items, 11_999 + 3_999 + 4);
    assert!(refused.items > MAX_ITEMS);
    assert!(
        refused.to_string().ends_with("a diagram has at most 12000"),
        "{refused}"
    );
}

#[test]
fn a_picture_has_its_style_or_leaves_it_to_the_page() {
    let with = draw(&[], 0, 10);
    assert!(with.contains("prefers-color-scheme:dark") && with.contains("@media screen"));
    let options = DiagramOptions {
        has_style: false,
        ..DiagramOptions::default()
    };
    let without = draw_with(&[], 0, 10, options).unwrap();
    assert!(!without.contains("<style") && !without.contains("style="));
    assert!(with.contains(&style()));
}

#[test]
fn acts_on_sites_are_marked_and_named() {
    let changed = |key: &str, to: f64| Event::SiteChanged {
        robot: name("Leguin"),
        site: "T1".to_owned(),
        key: key.to_owned(),
        from: 0.0.into(),
        to: to.into(),
    };
    let refused = Event::SiteRefused {
        robot: name("Butler"),
        site: "U".to_owned(),
        because: SiteRefusal::Bound,
    };
    let events = [
        (4, changed("stock", 5.0)),
        (4, refused),
        (4, changed("done", 1.0)),
        (30, changed("stock", 4.0)),
    ];
    let svg = draw(&events, 0, 60);
    let document = Document::parse(&svg).unwrap();
    let marks = of_class(&document, "site");
    let titles: Vec<&str> = marks.iter().map(|mark| title(*mark)).collect();
    assert_eq!(
        titles,
        [
            "Leguin in tick 4 (2 s): T1 stock 5; T1 done 1",
            "Butler in tick 4 (2 s): U refused: bound",
            "Leguin in tick 30 (15 s): T1 stock 4",
        ]
    );
    assert_eq!(of_class(&document, "refused").len(), 1);
    for label in ["T1 stock 5, +1", "U refused: bound", "T1 stock 4"] {
        assert!(svg.contains(&format!(">{label}</text>")), "{label}: {svg}");
    }

    // Robots that act in every tick do not make the run too much for a diagram.
    let many: Vec<(Tick, Event)> = (1..=2100)
        .map(|tick| (tick, changed("stock", 1.0)))
        .collect();
    let svg = draw(&many, 0, 2100);
    assert!(svg.contains(", 100 more acts on sites"), "{}", &svg[..300]);
}

/// An answer of `cars why`: the outcome was decided in tick 60.
fn decision() -> RunDecision {
    let outcomes = |value: f64| ForkOutcomes {
        n: 200,
        value: Some(value),
        low: Some(value - 0.05),
        high: Some(value + 0.05),
        failed: 0,
    };
    let curve = [(0, 0.1), (59, 0.1), (60, 0.9), (100, 0.9)];
    RunDecision {
        digest: String::new(),
        question: DecisionQuestion {
            kind: "condition".to_owned(),
            name: "<it> holds".to_owned(),
        },
        is_share: true,
        tick_s: 0.5,
        last: 100,
        sentence: "It was decided at 30 s.".to_owned(),
        curve: curve
            .map(|(tick, value)| DecisionPoint {
                tick,
                outcome: outcomes(value),
            })
            .to_vec(),
        jumps: vec![DecisionJump {
            tick: 60,
            before: outcomes(0.1),
            after: outcomes(0.9),
            events: Vec::new(),
            cause: None,
        }],
    }
}

#[test]
fn what_decided_the_run_is_a_curve_on_the_axis_of_time() {
    let events = [(20, behavior("Leguin", "SERVE"))];
    let options = DiagramOptions {
        decisions: vec![decision()],
        ..DiagramOptions::default()
    };
    for (from, to, jumps) in [(0, 100, 1), (50, 80, 1), (70, 100, 0)] {
        let without = draw(&events, from, to);
        let svg = draw_with(&events, from, to, options.clone()).unwrap();
        let document = Document::parse(&svg).unwrap();
        let sheet = |svg: &str| {
            svg.split("</style>")
                .next()
                .unwrap()
                .split_once("<style>")
                .unwrap()
                .1
                .to_owned()
        };
        assert_eq!(
            sheet(&svg),
            sheet(&without),
            "pictures without an answer have the same sheet"
        );

        let row = of_class(&document, "decision");
        assert_eq!(row.len(), 1);
        assert_eq!(row[0].attribute("data-question"), Some("<it> holds"));
        let line = points(parts(row[0], "line")[0]);
        let scale_begin = x_of(&document, from);
        assert!((line[0].0 - scale_begin).abs() < 0.2, "{line:?}");
        let found = of_class(&document, "jump");
        assert_eq!(found.len(), jumps, "ticks {from} to {to}");
        for jump in found {
            assert_eq!(tick(jump), 60);
            assert_eq!(title(jump), "30 s, tick 60: 10 % → 90 %");
            assert!(is_at(&document, points(parts(jump, "break")[0])[0].0, 60));
        }
    }
}

/// A broadcast is a command to each of the others, and its text and the reasons of its losses are there once, also if it is repeated soon.
#[test]
fn a_broadcast_has_one_label() {
    let mut events = Vec::new();
    let others = ["Leguin", "Vonda", "Zed", "Yan"];
    for (seq, to) in (1..).zip([others, others].concat()) {
        let tick = if seq <= 4 { 10 } else { 12 };
        events.push((
            tick,
            Event::CommandSent {
                from: name("Butler"),
                to: name(to),
                seq,
                performative: Performative::Tell,
                command: "table".to_owned(),
                payload: None,
                payload_of: (seq > 1).then_some(1),
            },
        ));
        events.push((
            tick + 1,
            Event::CommandDropped {
                from: name("Butler"),
                to: name(to),
                seq,
                because: Cause::Loss,
            },
        ));
    }
    let svg = draw(&events, 0, 60);
    let document = Document::parse(&svg).unwrap();
    assert_eq!(of_class(&document, "break").len(), 2 * others.len());
    let texts = |class: &str| of_class(&document, class).len();
    assert_eq!((texts("text"), texts("reason")), (1, 1), "{svg}");
}
