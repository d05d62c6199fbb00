//! What the fold finds in events.

use protocol::event::{Blocker, Cause};
use protocol::messages::{End, FaultKind, Performative, Verdict};
use protocol::{Event, RobotName, Seq, Tick};

use super::*;

fn name(robot: &str) -> RobotName {
    RobotName::new(robot).unwrap()
}

fn a() -> RobotName {
    name("A")
}

fn joined(generation: Option<u32>) -> Event {
    Event::Joined {
        robot: a(),
        generation,
        at: Default::default(),
    }
}

fn feels(to: &str) -> Event {
    Event::Emotion {
        robot: a(),
        from: None,
        to: to.to_owned(),
    }
}

fn does(from: Option<&str>, to: &str) -> Event {
    Event::Behavior {
        robot: a(),
        from: from.map(str::to_owned),
        to: to.to_owned(),
    }
}

fn lost() -> Event {
    Event::Lost { robot: a() }
}

fn missed() -> Event {
    Event::Missed { robot: a() }
}

fn fault(kind: FaultKind, begins: bool) -> Event {
    Event::Fault {
        robot: a(),
        kind,
        begins,
    }
}

fn sent(seq: Seq, text: &str) -> Event {
    Event::CommandSent {
        from: a(),
        to: name("B"),
        seq,
        performative: Performative::Achieve,
        command: text.to_owned(),
        payload: None,
        payload_of: None,
    }
}

fn delivered(seq: Seq) -> Event {
    Event::CommandDelivered {
        from: a(),
        to: name("B"),
        seq,
    }
}

fn dropped(seq: Seq, because: Cause) -> Event {
    Event::CommandDropped {
        from: a(),
        to: name("B"),
        seq,
        because,
    }
}

fn cut(commands: bool, queries: bool) -> Event {
    Event::LinkCut {
        from: a(),
        to: name("B"),
        commands,
        queries,
    }
}

fn query_lost(because: Cause) -> Event {
    Event::QueryLost {
        from: a(),
        to: name("B"),
        because,
    }
}

fn changed(set: &str) -> Event {
    Event::Changed {
        set: set.to_owned(),
        by_hand: false,
    }
}

/// The timeline after some events, and what was over by then.
fn folded(events: &[(Tick, Event)]) -> (Timeline, Vec<Span>) {
    let mut timeline = Timeline::default();
    let mut over = Vec::new();
    for (tick, event) in events {
        over.extend(timeline.apply(*tick, event));
    }
    (timeline, over)
}

/// All spans, one a line.
fn spans(events: &[(Tick, Event)]) -> Vec<String> {
    let (timeline, mut spans) = folded(events);
    spans.extend(timeline.in_progress());
    spans.iter().map(in_words).collect()
}

fn in_words(span: &Span) -> String {
    match span {
        Span::Stay(stay) => format!("{:?} {} {}", stay.kind, stay.name, when(stay.period)),
        Span::Absence(absence) => format!("absent {}", when(absence.period)),
        Span::Missed(missed) => format!("missed {}", when(missed.period)),
        Span::Fault(fault) => format!("{:?} {}", fault.kind, when(fault.period)),
        Span::Cut(cut) => format!("cut {} {} {}", cut.commands, cut.queries, when(cut.period)),
        Span::QueriesLost(lost) => format!("query {:?} {}", lost.because, when(lost.period)),
        Span::Command(command) => {
            let mut text = format!("{} of {}", command.text, command.sent);
            if let Some(until) = command.until {
                text += &format!(", until {until}");
            }
            for end in &command.ends {
                match end.lost {
                    None => text += &format!(", arrives in {}", end.tick),
                    Some(because) => text += &format!(", {because:?} in {}", end.tick),
                }
            }
            text
        }
        Span::Guest(visit) => format!("guest {} {}", visit.guest, when(visit.period)),
        Span::Joined(joined) => format!("joined {:?} in {}", joined.generation, joined.tick),
        Span::Change(change) => format!("{} after {:?}", change.set, change.before),
        Span::Judged(judged) => format!(
            "{} {} in {}",
            judged.expectation, judged.verdict, judged.tick
        ),
    }
}

fn when(period: Period) -> String {
    match period.end {
        Some(end) => format!("{}..{end}", period.begin),
        None => format!("{}..", period.begin),
    }
}

#[test]
fn a_state_lasts_until_another_one_and_until_the_robot_is_lost() {
    let found = spans(&[
        (0, joined(None)),
        (0, feels("X")),
        (0, does(None, "SERVE")),
        (4, missed()),
        (5, feels("Y")),
        (5, feels("Z")), // It was in Y for no tick.
        (8, lost()),
        (8, missed()),
        (9, missed()),
        (9, lost()),
        (12, joined(Some(2))),
        (12, feels("X")),
    ]);
    assert_eq!(
        found,
        [
            "Emotion X 0..5",
            "Emotion Z 5..8",
            "Behavior SERVE 0..8",
            "missed 4..5",
            "absent 8..12",
            "joined Some(2) in 12",
            "Emotion X 12..",
            "Behavior SERVE 12..",
            "missed 8..10",
        ]
    );
}

#[test]
fn a_robot_that_is_lost_at_the_end_is_in_no_state() {
    let mut events = vec![
        (0, joined(None)),
        (2, feels("X")),
        (7, lost()),
        (7, missed()),
    ];
    assert_eq!(
        spans(&events),
        ["Emotion X 2..7", "absent 7..", "missed 7..8"]
    );

    let (timeline, _) = folded(&events);
    assert_eq!(timeline.lost_since(&a()), Some(7));
    assert_eq!(timeline.state(&a(), StateKind::Emotion), Some("X"));
    assert!(timeline.has_missed(&a(), 7) && !timeline.has_missed(&a(), 8));
    assert_eq!(timeline.robots().collect::<Vec<_>>(), [&a()]);

    // An incarnation that is back before its predecessor was missed goes on.
    events.truncate(2);
    events.push((7, joined(Some(2))));
    assert_eq!(spans(&events), ["joined Some(2) in 7", "Emotion X 2.."]);
}

#[test]
fn each_copy_of_a_command_has_its_fate() {
    let delayed = Event::CommandDelayed {
        from: a(),
        to: name("B"),
        seq: 3,
        until: 9,
        because: None,
    };
    let doubled = |seq| Event::CommandDuplicated {
        from: a(),
        to: name("B"),
        seq,
        because: None,
    };
    let (timeline, over) = folded(&[
        (0, sent(1, "one")),
        (0, sent(2, "two")),
        (0, sent(3, "three")),
        (0, sent(4, "four")),
        (1, delivered(1)),
        (1, doubled(2)),
        (1, delivered(2)),
        (1, delayed),
        (1, doubled(4)),
        (1, dropped(2, Cause::Overflow)),
        // A cut loses both copies with one event.
        (2, dropped(4, Cause::Partition)),
        (3, delivered(7)), // It was never sent.
    ]);
    assert_eq!(
        over.iter().map(in_words).collect::<Vec<_>>(),
        [
            "one of 0, arrives in 1",
            "two of 0, arrives in 1, Overflow in 1",
            "four of 0, Partition in 2",
        ]
    );
    assert_eq!(
        timeline
            .in_progress()
            .iter()
            .map(in_words)
            .collect::<Vec<_>>(),
        ["three of 0, until 9"]
    );
    assert_eq!(timeline.command(&a(), 3).unwrap().text, "three");
    assert_eq!(timeline.command(&a(), 1), None);
}

#[test]
fn faults_cuts_and_lost_queries_have_periods() {
    let found = spans(&[
        (2, fault(FaultKind::Crash, true)),
        (3, fault(FaultKind::Hang, true)),
        (4, cut(true, false)),
        (5, query_lost(Cause::Loss)),
        (6, query_lost(Cause::Loss)),
        (7, query_lost(Cause::Burst)),
        (8, cut(true, true)),
        (9, fault(FaultKind::Crash, false)),
        (
            9,
            Event::LinkHealed {
                from: a(),
                to: name("B"),
            },
        ),
        (9, changed("network.loss=0.1")),
        (9, changed("network.loss=0.2")),
    ]);
    assert_eq!(
        found,
        [
            "query Loss 5..7",
            "cut true false 4..8",
            "Crash 2..9",
            "cut true true 8..9",
            "network.loss=0.1 after None",
            "network.loss=0.2 after Some(\"network.loss=0.1\")",
            "Hang 3..",
            "query Burst 7..8",
        ]
    );
}

#[test]
fn counts_are_by_robot_and_by_link() {
    let mut counts = Counts::default();
    for event in [
        joined(None),
        joined(Some(2)),
        does(None, "SERVE"),
        does(Some("SERVE"), "WAIT"),
        missed(),
        Event::Blocked {
            robot: a(),
            by: Blocker::Edge,
            at: Default::default(),
        },
        sent(1, "go"),
        sent(2, "go"),
        delivered(1),
        dropped(2, Cause::Loss),
        Event::GuestEntered {
            guest: 0,
            at: Default::default(),
        },
        // What is of no robot, no link and no guest.
        judged(),
        Event::End {
            reason: End::Finished,
            because: None,
            waited_for: Vec::new(),
            digest: String::new(),
            seal: None,
        },
    ] {
        counts.add(&event);
    }

    let one = &counts.robots[&a()];
    assert_eq!((one.returns, one.missed, one.blocked), (1, 1, 1));
    assert_eq!(one.sent["go"], 2);
    assert_eq!(one.states(StateKind::Behavior).entered.len(), 2);
    let transition = ("SERVE".to_owned(), "WAIT".to_owned());
    assert_eq!(one.states(StateKind::Behavior).transitions[&transition], 1);
    assert_eq!(counts.robots.len(), 2);
    let other = &counts.robots[&name("B")];
    assert_eq!((other.received, other.dropped), (1, 1));
    let link = &counts.links[&(a(), name("B"))];
    assert_eq!((link.sent, link.delivered, link.lost()), (2, 1, 1));
    assert_eq!((counts.guests_entered, counts.guests_left), (1, 0));
}

fn judged() -> Event {
    Event::Judged {
        expectation: "x".to_owned(),
        verdict: Verdict::Pass,
        because: String::new(),
    }
}

#[test]
fn a_verdict_is_a_moment() {
    assert_eq!(spans(&[(3, judged())]), ["x pass in 3"]);
}

/// A robot without emotions reports an empty one.
#[test]
fn an_empty_state_is_none() {
    let events = [
        (0, feels("")),
        (0, does(None, "WALK")),
        (4, feels("HAPPY")),
        (6, feels("")),
    ];
    let (timeline, over) = folded(&events);
    assert_eq!(timeline.names().of(StateKind::Emotion), ["HAPPY"]);
    assert_eq!(timeline.state(&a(), StateKind::Emotion), None);
    let [Span::Stay(stay)] = &over[..] else {
        panic!("{over:?}");
    };
    assert_eq!((stay.name.as_str(), stay.period.end), ("HAPPY", Some(6)));
    assert_eq!(timeline.in_progress().len(), 1, "the behavior");

    let mut counts = Counts::default();
    for (from, to) in [(None, ""), (Some(""), "HAPPY"), (Some("HAPPY"), "")] {
        counts.add(&Event::Emotion {
            robot: a(),
            from: from.map(str::to_owned),
            to: to.to_owned(),
        });
    }
    let emotions = &counts.robots[&a()].emotions;
    assert_eq!(emotions.entered, [("HAPPY".to_owned(), 1)].into());
    assert!(emotions.transitions.is_empty());
}
