//! One tick: the order of things, what robots are told, what is recorded. With robots made of closures.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use environment::{Event, Simulation, TickRecord};
use lockstep::{Bulletin, Exchange, IncarnationNotice, Sent, TickOutcome};
use protocol::event::{Blocker, Cause, log_line};
use protocol::messages::{
    CommandText, Delivery, End, Performative, Point, Report, SensedKind, TickUpdate,
};
use protocol::{RobotName, RunName, Tick};

use crate::common::{name, report, scenario};

/// News of a tick, by robot.
type AllNews = BTreeMap<RobotName, TickUpdate>;
type Commands = Vec<Sent<CommandText>>;

/// Robots that do as a closure says, and the news they got.
struct Puppets<F> {
    act: F,
    proposals: BTreeMap<RobotName, Point>,
    /// Robots that do not report.
    deaf: Vec<RobotName>,
    news: Vec<AllNews>,
}

impl<F: FnMut(&RobotName, &mut Report, &mut Commands)> Puppets<F> {
    /// The robots of a simulation before tick 0.
    fn new(simulation: &Simulation, act: F) -> Self {
        let mut proposals = BTreeMap::new();
        for name in simulation.names() {
            proposals.insert(name.clone(), simulation.location(name).unwrap());
        }

        Self {
            act,
            proposals,
            deaf: vec![],
            news: vec![],
        }
    }

    /// What a robot does unless the closure changes it: it stays where it stands.
    fn stay(&self, name: &RobotName, tick: Tick, news: &AllNews) -> Report {
        let corrected = news.get(name).and_then(|news| news.correction);

        let proposal = corrected.map_or(self.proposals[name], |correction| correction.location);
        report(tick, proposal)
    }
}

impl<F> Exchange<TickUpdate, Arc<Report>, CommandText> for Puppets<F>
where
    F: FnMut(&RobotName, &mut Report, &mut Commands),
{
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: Tick,
        bulletin: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        let mut news = AllNews::new();
        for name in bulletin.robots() {
            let of_robot = bulletin.compose(&name, IncarnationNotice::default());
            news.insert(name, of_robot);
        }
        let mut outcome = TickOutcome::default();
        let names: Vec<RobotName> = self.proposals.keys().cloned().collect();
        for name in names {
            let mut report = self.stay(&name, tick, &news);
            let mut commands = vec![];
            (self.act)(&name, &mut report, &mut commands);
            report.commands = commands.len() as u32;
            self.proposals.insert(name.clone(), report.proposal);
            if !self.deaf.contains(&name) {
                outcome.reports.insert(name, (Arc::new(report), commands));
            }
        }

        self.news.push(news);
        Ok(outcome)
    }
}

const TWO: &str = "duration = \"10 s\"\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n\
                   [[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n";

fn simulation(text: &str) -> Simulation {
    Simulation::new(scenario(text), 1).unwrap()
}

fn play(
    text: &str,
    ticks: usize,
    act: impl FnMut(&RobotName, &mut Report, &mut Commands),
) -> (Simulation, Vec<AllNews>, Vec<TickRecord>) {
    let mut simulation = simulation(text);
    let mut puppets = Puppets::new(&simulation, act);
    let mut records = vec![simulation.init(&mut puppets).unwrap()];
    for _ in 0..ticks {
        records.push(simulation.step(&mut puppets).unwrap());
    }

    (simulation, puppets.news, records)
}

fn command(to: &str, text: &str) -> Sent<CommandText> {
    Sent {
        to: name(to).into(),
        command: CommandText::named(text),
    }
}

fn delivery(from: &str, text: &str) -> Delivery {
    Delivery {
        from: name(from),
        performative: Performative::Achieve,
        command: text.into(),
        payload: None,
    }
}

/// What refused moves in a tick, in the order of robots.
fn blockers(record: &TickRecord) -> Vec<Blocker> {
    let mut blockers = vec![];
    for event in record.events.iter() {
        if let Event::Blocked { by, .. } = event {
            blockers.push(by.clone());
        }
    }

    blockers
}

/// Commands that were dropped in a tick: sender, target, number, cause.
fn dropped(record: &TickRecord) -> Vec<(String, String, u64, Cause)> {
    let mut dropped = vec![];
    for event in record.events.iter() {
        if let Event::CommandDropped {
            from,
            to,
            seq,
            because,
        } = event
        {
            dropped.push((from.to_string(), to.to_string(), *seq, *because));
        }
    }

    dropped
}

#[test]
fn an_accepted_proposal_is_where_the_robot_is_and_is_not_told() {
    let (simulation, news, _) = play(TWO, 1, |name, report, _| {
        if name.as_str() == "A" {
            report.proposal = Point::new(2.5, 2.25);
        }
    });

    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.5, 2.25)));
    assert!(
        news[1]
            .get(&name("A"))
            .is_none_or(|news| news.correction.is_none())
    );
}

#[test]
fn who_collides_is_not_advanced_and_is_told_where_it_stands() {
    let (simulation, news, records) = play(TWO, 2, |name, report, _| {
        if name.as_str() == "A" {
            report.proposal.x += 1.45; // Overlaps B, 2 m away, with bodies of 0.61 m.
        }
    });

    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.0, 2.0)));

    let correction = news[1][&name("A")].correction.unwrap();
    assert_eq!(
        (correction.location, correction.blocked),
        (Point::new(2.0, 2.0), true)
    );

    let blocked = Event::Blocked {
        robot: name("A"),
        by: Blocker::Robot(name("B")),
        at: Point::new(2.0, 2.0),
    };

    assert!(
        records[1].events.contains(&blocked),
        "{:?}",
        records[1].events
    );
}

#[test]
fn no_robot_leaves_the_field_or_jumps() {
    let near_the_edge = TWO.replacen("[\"2 m\", \"2 m\"]", "[\"1.5 m\", \"2 m\"]", 1);
    let (simulation, _, records) = play(&near_the_edge, 1, |name, report, _| {
        report.proposal.x += if name.as_str() == "A" { -1.3 } else { 9.0 };
        report.proposal.y += if name.as_str() == "A" { 0.0 } else { 9.0 };
    });
    assert_eq!(simulation.location(&name("A")), Some(Point::new(1.5, 2.0)));
    assert_eq!(simulation.location(&name("B")), Some(Point::new(4.0, 2.0)));
    assert_eq!(blockers(&records[1]), [Blocker::Edge, Blocker::TooFast]);
}

#[test]
fn moves_that_are_too_fast_are_told_once_with_the_limit_and_counted_at_the_end() {
    let (mut simulation, _, mut records) = play(TWO, 4, |name, report, _| {
        report.proposal.x += if name.as_str() == "B" { 5.0 } else { 0.0 };
    });
    records.push(simulation.end(End::Finished));

    let mut warnings = vec![];
    for record in &records {
        for event in record.events.iter() {
            if let Event::Warned { robot, text } = event {
                warnings.push(format!("{} {robot} {text}", record.tick));
            }
        }
    }
    assert_eq!(
        warnings,
        [
            "1 B it proposed to move 5.000 m in a tick and stays: at most 3.048 m/s, 1.524 m in 0.5 s, is allowed (max_speed of \
             the scenario)",
            "4 B 4 of its moves were refused because they were too fast",
        ]
    );
    let line = records[1].events.iter().find_map(|event| {
        let record = event.log_record(1, 1, 0.5)?;
        record
            .text
            .starts_with("warning: ")
            .then(|| log_line(&record))
    });
    assert!(
        line.unwrap()
            .starts_with("      0.5 s  B            warning: it proposed")
    );
}

#[test]
fn a_robot_called_guest_that_blocks_is_told_apart_from_a_guest() {
    for robot in ["guest", "obstacle", "edge", "too_fast"] {
        let text = TWO.replace("name = \"B\"", &format!("name = \"{robot}\""));
        let (_, _, records) = play(&text, 1, |name, report, _| {
            if name.as_str() == "A" {
                report.proposal.x += 1.45;
            }
        });
        let by = blockers(&records[1]);
        assert_eq!(by, [Blocker::Robot(name(robot))]);
        let text = serde_json::to_value(&by).unwrap();
        assert_eq!(text, serde_json::json!([{ "robot": robot }]));
    }

    let crowd = "duration = \"30 s\"\n[field]\nsize = [\"4 m\", \"4 m\"]\n[guests]\ncount = 12\n\
                 [[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n";
    let by_guests = blocked_by_walking_around(crowd);
    assert!(by_guests.contains(&Blocker::Guest), "{by_guests:?}");
    let text = serde_json::to_value(&by_guests).unwrap();
    assert!(text.as_array().unwrap().contains(&"guest".into()), "{text}");
}

/// What refuses the moves of a robot that keeps walking in a crowd.
fn blocked_by_walking_around(text: &str) -> Vec<Blocker> {
    let mut step = 0;
    let (_, _, records) = play(text, 40, |_, report, _| {
        step += 1;
        let direction = f64::from(step % 4) - 1.5;
        report.proposal.x += 0.3 * direction;
        report.proposal.y += 0.3 * (f64::from(step % 3) - 1.0);
    });

    records.iter().flat_map(blockers).collect()
}

#[test]
fn a_command_sent_in_a_tick_is_named_by_the_next_clock_in_the_order_of_senders() {
    let (_, news, records) = play(TWO, 3, |_, report, commands| {
        if report.tick == 1 {
            *commands = vec![command("A", "c1"), command("B", "c2"), command("A", "c3")];
        }
    });

    assert_eq!(
        news[2][&name("A")].commands,
        [("A", "c1"), ("A", "c3"), ("B", "c1"), ("B", "c3")]
            .map(|(from, text)| delivery(from, text))
    );
    assert_eq!(
        news[2][&name("B")].commands,
        [("A", "c2"), ("B", "c2")].map(|(from, text)| delivery(from, text))
    );
    assert!(news[1].is_empty() && news[3].is_empty());

    let mut delivered = vec![];
    for event in records[2].events.iter() {
        if let Event::CommandDelivered { from, to, seq } = event {
            delivered.push((from.as_str(), to.as_str(), *seq));
        }
    }

    assert_eq!(
        delivered,
        [
            ("A", "A", 1),
            ("A", "A", 3),
            ("B", "A", 1),
            ("B", "A", 3),
            ("A", "B", 2),
            ("B", "B", 2)
        ]
    );
}

#[test]
fn a_command_from_outside_is_delivered_at_the_next_tick_and_recorded() {
    let (mut simulation, ..) = play(TWO, 1, |_, _, _| {});
    simulation.command(command("B", "refill"));
    let mut puppets = Puppets::new(&simulation, |_, _, _| {});
    let record = simulation.step(&mut puppets).unwrap();

    assert_eq!(
        puppets.news[0][&name("B")].commands,
        [delivery("operator", "refill")]
    );
    assert!(matches!(&record.events[0],
        Event::CommandSent { command, from, seq: 1, .. } if command == "refill" && from.is_operator()));
}

#[test]
fn a_command_to_a_robot_outside_the_roster_is_dropped_and_recorded() {
    let (_, news, records) = play(TWO, 2, |name, report, commands| {
        if report.tick == 1 && name.as_str() == "A" {
            *commands = vec![command("Z", "come"), command("B", "go")];
        }
    });
    let is_sent =
        |event: &Event| matches!(event, Event::CommandSent { to, .. } if to.as_str() == "Z");

    assert!(records[1].events.iter().any(is_sent));
    assert_eq!(
        dropped(&records[2]),
        [("A".to_owned(), "Z".to_owned(), 1, Cause::Unknown)]
    );
    assert_eq!(news[2][&name("B")].commands, [delivery("A", "go")]);
}

#[test]
fn a_command_to_a_robot_that_misses_the_tick_is_dropped_and_recorded() {
    let mut simulation = simulation(TWO);
    let mut puppets = Puppets::new(&simulation, |name, report, commands: &mut Commands| {
        if report.tick == 0 && name.as_str() == "A" {
            *commands = vec![command("B", "late"), command("A", "here")];
        }
    });
    simulation.init(&mut puppets).unwrap();
    puppets.deaf = vec![name("B")];
    let record = simulation.step(&mut puppets).unwrap();
    assert_eq!(
        dropped(&record),
        [("A".to_owned(), "B".to_owned(), 1, Cause::Missed)]
    );
    let delivered = Event::CommandDelivered {
        from: name("A"),
        to: name("A"),
        seq: 2,
    };
    assert!(record.events.contains(&delivered), "{:?}", record.events);
    assert!(record.events.contains(&Event::Missed { robot: name("B") }));

    // It is not delivered later.
    puppets.deaf.clear();
    let record = simulation.step(&mut puppets).unwrap();
    assert_eq!(dropped(&record), []);
    assert!(puppets.news[2][&name("B")].commands.is_empty());
}

#[test]
fn more_commands_than_news_hold_are_dropped_from_the_last_and_the_run_goes_on() {
    let long = "c".repeat(4096);
    let (simulation, news, records) = play(TWO, 3, |_, report, commands| {
        if report.tick == 1 {
            *commands = (0..100).map(|_| command("A", &long)).collect();
            commands.push(command("B", "short"));
        }
    });
    let arrived = &news[2][&name("A")];
    let bytes = protocol::encode(arrived).len();
    assert!(bytes <= 512 * 1024 + 1024, "{bytes} bytes of news");

    let dropped = dropped(&records[2]);
    let causes: Vec<Cause> = dropped.iter().map(|(.., because)| *because).collect();
    assert!(!dropped.is_empty());
    assert_eq!(causes, vec![Cause::Overflow; dropped.len()]);
    assert_eq!(arrived.commands.len() + dropped.len(), 200);

    // Hardly one more would have fitted, and what is dropped is what counts last.
    assert!(bytes + 2 * 4096 > 512 * 1024, "{bytes} bytes of news");

    let from_b =
        |(from, to, seq, _): &(String, String, u64, Cause)| (from == "B" && to == "A", *seq);
    let numbers: Vec<(bool, u64)> = dropped.iter().map(from_b).collect();
    let kept = 200 - dropped.len() as u64;
    let expected: Vec<(bool, u64)> = (kept - 100 + 1..=100).map(|seq| (true, seq)).collect();
    assert_eq!(numbers, expected);

    // Nothing else suffers from it.
    assert_eq!(news[2][&name("B")].commands.len(), 2);
    assert_eq!(simulation.tick(), 3);
    assert!(news[3].is_empty());
}

#[test]
fn robots_within_range_are_sensed_with_where_they_are() {
    let near = TWO.replace("4 m", "3 m");
    let (_, news, _) = play(&near, 1, |_, _, _| {});
    let sensed = &news[1][&name("A")].sensed;
    assert_eq!(
        (sensed[0].name.as_str(), sensed[0].location),
        ("B", Point::new(3.0, 2.0))
    );
    let (_, news, _) = play(TWO, 1, |_, _, _| {});
    assert!(news[1].is_empty(), "2 m is beyond 6 ft");
}

#[test]
fn bodies_are_listed_as_of_the_tick_under_way_for_robots_that_ask_for_them() {
    let near = TWO.replace("4 m", "3 m") + "[[obstacle]]\nat = [\"2 m\", \"3 m\"]\n";
    let mut simulation = simulation(&near);
    let mut puppets = Puppets::new(&simulation, |name, report, _: &mut Commands| {
        if name.as_str() == "B" && report.tick == 0 {
            report.proposal.x = 3.25;
        }
    });
    simulation.list_bodies(&name("A"), true);
    simulation.init(&mut puppets).unwrap();
    simulation.step(&mut puppets).unwrap();
    simulation.list_bodies(&name("A"), false);
    simulation.step(&mut puppets).unwrap();

    for (tick, b_at) in [(0, Point::new(3.0, 2.0)), (1, Point::new(3.25, 2.0))] {
        let news = &puppets.news[tick][&name("A")];
        let bodies: Vec<(SensedKind, Point)> = news
            .bodies
            .iter()
            .map(|body| (body.kind, body.location))
            .collect();
        assert_eq!(news.tick, tick as Tick);
        assert_eq!(
            bodies,
            [
                (SensedKind::Obstacle, Point::new(2.0, 3.0)),
                (SensedKind::Robot, b_at)
            ]
        );
        assert!(puppets.news[tick][&name("B")].bodies.is_empty());
    }
    assert!(puppets.news[2][&name("A")].bodies.is_empty());
}

#[test]
fn who_does_not_report_stays_and_is_out_of_reach_at_the_next_tick() {
    let mut simulation = simulation(TWO);
    let mut puppets = Puppets::new(&simulation, |_, _, _| {});
    puppets.deaf = vec![name("B")];
    let record = simulation.init(&mut puppets).unwrap();
    assert!(record.events.contains(&Event::Missed { robot: name("B") }));
    puppets.deaf.clear();
    simulation.step(&mut puppets).unwrap();
    assert_eq!(puppets.news[1][&name("A")].unreachable, [name("B")]);
    assert!(!puppets.news[1][&name("B")].correction.unwrap().blocked);
}

fn has_done_late(record: &TickRecord) -> bool {
    let mut events = record.events.iter();
    events.any(|event| event.kind() == "done_late")
}

#[test]
fn what_a_robot_did_too_late_is_recorded_when_it_takes_part_again() {
    let mut simulation = simulation(TWO);
    let mut puppets = Puppets::new(&simulation, |_, _, _| {});
    simulation.init(&mut puppets).unwrap();
    puppets.deaf = vec![name("B")];
    for _ in 1..=3 {
        let record = simulation.step(&mut puppets).unwrap();
        assert!(!has_done_late(&record));
    }

    // An answer that counted comes again, and one is of a tick that has not begun.
    for tick in [0, 3, 1, 3, 9] {
        simulation.done_late(&name("B"), tick);
    }
    puppets.deaf.clear();
    let record = simulation.step(&mut puppets).unwrap();
    let done_late = Event::DoneLate {
        robot: name("B"),
        ticks: vec![1, 3],
    };
    assert!(record.events.contains(&done_late), "{:?}", record.events);

    let record = simulation.step(&mut puppets).unwrap();
    assert!(!has_done_late(&record));
}

#[test]
fn each_successor_in_one_tick_draws_from_a_stream_of_its_own() {
    let mut simulation = simulation(TWO);
    let mut reported = vec![];
    let mut puppets = Puppets::new(&simulation, |_, report, _| reported.push(report.clone()));
    simulation.init(&mut puppets).unwrap();
    let stream = |generation, open: Option<&Report>| {
        let run = RunName::new("test").unwrap();
        let welcome = simulation.welcome(&run, &name("A"), generation, open);
        welcome.unwrap().stream
    };

    let mut open = reported[0].clone();
    open.tick = 1;
    assert_eq!(stream(1, None), "robot/A");
    assert_eq!(stream(2, None), "robot/A#2");
    assert_eq!(stream(2, Some(&open)), "robot/A#2");
    // The second incarnation took part from the open tick on, and has reported for it.
    open.generation = 2;
    assert_eq!(stream(2, Some(&open)), "robot/A#2");
    assert_eq!(stream(3, Some(&open)), "robot/A#3");
}

#[test]
fn every_value_that_a_robot_reports_is_in_the_digest() {
    let digest = |change: fn(&mut Report, &mut Commands)| {
        let (simulation, ..) = play(TWO, 3, |name, report, commands| {
            if name.as_str() == "B" && report.tick == 2 {
                change(report, commands);
            }
        });
        simulation.digest()
    };
    let same = digest(|_, _| {});
    assert_eq!(same, digest(|_, _| {}));

    let changes: [fn(&mut Report, &mut Commands); 11] = [
        |report, _| report.proposal.x += 1e-12,
        |report, _| report.speed_mps = 1e-300,
        |report, _| report.direction_rad = 1e-6,
        |report, _| report.emotion_state = "CALN".into(),
        |report, _| report.behavior_state = "IDLF".into(),
        |report, _| drop(report.state_variables.insert("x", 1.0.into())),
        |_, commands| *commands = vec![command("operator", "x")],
        |_, commands| *commands = vec![command("operator", "y")],
        |_, commands| *commands = vec![command("A", "x")],
        |_, commands| *commands = vec![command("operator", "x"), command("operator", "x")],
        |report, _| report.log = vec!["x".into()],
    ];
    let mut seen = vec![same];
    for change in changes {
        let other = digest(change);
        assert!(!seen.contains(&other), "a change is not in the digest");
        seen.push(other);
    }

    assert_eq!(
        digest(|report, _| report.speed_mps = -0.0),
        seen[0],
        "minus zero is zero"
    );
}

#[test]
fn another_seed_is_another_run() {
    let hall = |seed: u64| {
        format!(
            "seed = {seed}\n{}",
            TWO.replacen("[[robot]]", "[guests]\ncount = 20\n[[robot]]", 1)
        )
    };
    let digest = |seed| play(&hall(seed), 5, |_, _, _| {}).0.digest();
    assert_eq!(digest(1), digest(1));
    assert_ne!(digest(1), digest(2));
}
