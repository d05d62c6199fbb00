//! Payloads and broadcasts: what becomes of them, and what the record has of them.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use environment::{Event, Simulation, TickRecord};
use lockstep::{Bulletin, Exchange, IncarnationNotice, Sent, TickOutcome};
use protocol::event::Cause;
use protocol::messages::{CommandText, MAX_PAYLOAD_BYTES, Payload, Report, Target, TickUpdate};
use protocol::{RobotName, Tick, encode};
use record::Entry;
use serde_json::{Value, json};

use crate::common::{report, scenario};

type Commands = Vec<Sent<CommandText>>;

/// Robots that stand still and send what a function says.
struct Senders<F> {
    names: Vec<RobotName>,
    send: F,
    /// Bytes of the largest news, and the payloads that have arrived, by robot.
    largest_news: usize,
    payloads: BTreeMap<RobotName, Vec<Payload>>,
}

impl<F: Fn(&str, Tick) -> Commands> Exchange<TickUpdate, Arc<Report>, CommandText> for Senders<F> {
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: Tick,
        bulletin: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        for name in bulletin.robots() {
            let news = bulletin.compose(&name, IncarnationNotice::default());
            self.largest_news = self.largest_news.max(encode(&news).len());
            let arrived = self.payloads.entry(name).or_default();
            arrived.extend(news.commands.into_iter().filter_map(|one| one.payload));
        }

        let mut outcome = TickOutcome::default();
        for name in &self.names {
            let commands = (self.send)(name.as_str(), tick);
            let report = Report {
                commands: commands.len() as u32,
                ..report(tick, protocol::messages::Point::default())
            };
            outcome
                .reports
                .insert(name.clone(), (Arc::new(report), commands));
        }
        Ok(outcome)
    }
}

/// A network in which much happens.
const HOSTILE: &str = r#"
[network.commands]
loss = 0.1
duplication = 0.1
delay = "1.5 s"
burst = { enter = 0.1, leave = 0.3, loss = 0.9 }
[[network.lose]]
from = "A"
to = "C"
number = 3
[[network.partition]]
from = "3 s"
until = "6 s"
groups = [["A", "B"], ["C", "D"]]
"#;

fn simulation(robots: &[&str], network: &str) -> Simulation {
    let mut text = format!("seed = 5\nduration = \"30 s\"\n{network}\n");
    for (index, name) in robots.iter().enumerate() {
        text += &format!(
            "[[robot]]\nname = \"{name}\"\nat = [\"{} m\", \"2 m\"]\n",
            1 + index
        );
    }
    Simulation::new(scenario(&text), 1).unwrap()
}

fn play<F: Fn(&str, Tick) -> Commands>(
    mut simulation: Simulation,
    ticks: usize,
    send: F,
) -> (Vec<TickRecord>, Senders<F>) {
    let mut senders = Senders {
        names: simulation.names().to_vec(),
        send,
        largest_news: 0,
        payloads: BTreeMap::new(),
    };
    let mut records = vec![simulation.init(&mut senders).unwrap()];
    for _ in 0..ticks {
        records.push(simulation.step(&mut senders).unwrap());
    }
    (records, senders)
}

fn payload(value: Value) -> Option<Payload> {
    Payload::new(value)
}

/// A text of so many bytes of JSON.
fn text(bytes: usize) -> Option<Payload> {
    payload(Value::String("x".repeat(bytes - 2)))
}

fn to(target: &str, name: &str, payload: Option<Payload>) -> Sent<CommandText> {
    Sent {
        to: Target::parse(target).unwrap(),
        command: CommandText {
            payload,
            ..CommandText::named(name)
        },
    }
}

fn events(records: &[TickRecord]) -> Vec<&Event> {
    records
        .iter()
        .flat_map(|record| record.events.iter())
        .collect()
}

/// What became of commands to a robot: tick, sender, number, and how it was lost, if it was.
fn fates(records: &[TickRecord], of: (&str, &str)) -> Vec<(Tick, u64, Option<Cause>)> {
    let mut fates = Vec::new();
    for record in records {
        for event in record.events.iter() {
            let (from, to, seq, lost) = match event {
                Event::CommandDelivered { from, to, seq } => (from, to, seq, None),
                Event::CommandDropped {
                    from,
                    to,
                    seq,
                    because,
                } => (from, to, seq, Some(*because)),
                _ => continue,
            };
            if (from.as_str(), to.as_str()) == of {
                fates.push((record.tick, *seq, lost));
            }
        }
    }
    fates
}

#[test]
fn a_broadcast_is_to_the_byte_one_command_to_each_in_the_order_of_the_roster() {
    let robots = ["A", "B", "C", "D"];
    let cast = |name: &str, tick: Tick| match name {
        "A" | "D" => vec![to("*", "bid", payload(json!({ "tick": tick, "by": name })))],
        _ => Vec::new(),
    };
    let each = |name: &str, tick: Tick| {
        let mut commands = Vec::new();
        for broadcast in cast(name, tick) {
            for other in robots.iter().filter(|other| **other != name) {
                let payload = broadcast.command.payload.clone();
                commands.push(to(other, "bid", payload));
            }
        }
        commands
    };

    let (broadcast, _) = play(simulation(&robots, HOSTILE), 60, cast);
    let (one_by_one, _) = play(simulation(&robots, HOSTILE), 60, each);

    // The reports differ in their number of commands, which no event and no digest has.
    assert_eq!(events(&broadcast), events(&one_by_one));
    let causes: Vec<Cause> = fates(&broadcast, ("A", "C"))
        .into_iter()
        .filter_map(|(_, _, lost)| lost)
        .collect();
    for cause in [Cause::Loss, Cause::Burst, Cause::Partition, Cause::Scripted] {
        assert!(causes.contains(&cause), "no {cause:?} among {causes:?}");
    }
    assert_ne!(fates(&broadcast, ("A", "B")), fates(&broadcast, ("A", "C")));
}

#[test]
fn what_one_robot_broadcasts_changes_nothing_for_another_one() {
    let cast = |robots: [&'static str; 2]| {
        move |name: &str, _: Tick| match robots.contains(&name) {
            true => vec![to("*", "here", None)],
            false => Vec::new(),
        }
    };
    let (alone, _) = play(
        simulation(&["A", "B", "C"], HOSTILE_LINKS),
        60,
        cast(["A", "-"]),
    );
    let (beside, _) = play(
        simulation(&["A", "B", "C", "Z"], HOSTILE_LINKS),
        60,
        cast(["B", "Z"]),
    );
    let (both, _) = play(
        simulation(&["A", "B", "C"], HOSTILE_LINKS),
        60,
        cast(["A", "B"]),
    );

    assert_eq!(fates(&both, ("A", "C")), fates(&alone, ("A", "C")));
    assert!(
        fates(&beside, ("B", "Z"))
            .iter()
            .any(|(_, _, lost)| lost.is_some())
    );
}

/// The same without what names single robots.
const HOSTILE_LINKS: &str = r#"
[network.commands]
loss = 0.1
delay = "1.5 s"
burst = { enter = 0.1, leave = 0.3, loss = 0.9 }
"#;

#[test]
fn a_payload_is_recorded_once_and_read_for_each_target() {
    let robots = ["A", "B", "C", "D"];
    let shared = text(MAX_PAYLOAD_BYTES);
    let (records, senders) = play(simulation(&robots, ""), 2, |name, tick| {
        if name != "A" || tick != 1 {
            return Vec::new();
        }
        vec![
            to("*", "map", shared.clone()),
            to("B", "plain", None),
            to("C", "other", payload(json!(0.1))),
        ]
    });

    let recorded: usize = records[1].lines().map(|line| line.to_json().len()).sum();
    assert!(recorded < MAX_PAYLOAD_BYTES + 4096, "{recorded} bytes");
    assert_eq!(
        senders.payloads[&RobotName::new("D").unwrap()],
        [shared.clone().unwrap()]
    );

    // As the record is read.
    let events = records[1].lines().map(|line| {
        let line = protocol::Line::from_json(line.to_json().as_bytes()).unwrap();
        line.event
    });
    let entry = Entry {
        tick: 1,
        events: events.collect(),
        ..Entry::default()
    };
    let read = entry.commands_of(&RobotName::new("A").unwrap());
    let expected = [
        to("B", "map", shared.clone()),
        to("C", "map", shared.clone()),
        to("D", "map", shared.clone()),
        to("B", "plain", None),
        to("C", "other", payload(json!(0.1))),
    ];
    assert_eq!(read, expected);
}

#[test]
fn payloads_beyond_what_news_hold_are_dropped_and_recorded() {
    // News hold 512 KiB: seven of the largest payloads, each with its name and sender.
    let robots = ["A", "B", "C", "D", "E", "F", "G", "H", "I", "J"];
    let (records, senders) = play(simulation(&robots, ""), 2, |name, tick| {
        if tick != 1 || name == "J" {
            return Vec::new();
        }
        vec![to("J", "map", text(MAX_PAYLOAD_BYTES))]
    });

    let overflow = records[2].events.iter().filter(|event| {
        matches!(
            event,
            Event::CommandDropped {
                because: Cause::Overflow,
                ..
            }
        )
    });
    let dropped: Vec<&Event> = overflow.collect();
    assert_eq!(dropped.len(), 2, "{dropped:?}");
    assert_eq!(senders.payloads[&RobotName::new("J").unwrap()].len(), 7);
    assert!(
        senders.largest_news <= 512 * 1024 + 1024,
        "{}",
        senders.largest_news
    );
}

#[test]
fn a_payload_is_part_of_what_a_run_is_compared_by() {
    let digest = |payload: Option<Payload>| {
        let (records, _) = play(simulation(&["A", "B"], ""), 2, |name, _| match name {
            "A" => vec![to("B", "bid", payload.clone())],
            _ => Vec::new(),
        });
        match records.last().unwrap().events.last() {
            Some(Event::Tick { digest, .. }) => digest.clone(),
            other => panic!("{other:?}"),
        }
    };

    let sums = [0.3, 0.1 + 0.2].map(|sum| digest(payload(json!({ "bid": sum, "task": 1 }))));
    assert_ne!(sums[0], sums[1], "one bit");
    assert_ne!(sums[0], digest(None));
    let parsed = serde_json::from_str("{ \"task\": 1,  \"bid\": 3.0e-1 }").unwrap();
    assert_eq!(sums[0], digest(payload(parsed)));
}
