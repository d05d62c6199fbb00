//! One tick: the order of things, what robots are told, what is recorded. With robots made of closures.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::path::Path;

use protocol::RobotName;
use protocol::messages::{Clock, CommandId, Performative, Point, Report, SentCommand};
use simulator::diagnostic::Source;
use simulator::{Barrier, Event, Exchange, Scenario, Simulation, TickRecord};

/// Robots that do as a closure says, and the clocks they got.
struct Puppets<F> {
    act: F,
    clocks: Vec<Clock>,
}

impl<F: FnMut(&RobotName, &Clock, &mut Report)> Barrier for Puppets<F> {
    type Interrupt = Infallible;

    fn exchange(&mut self, clock: Clock, simulation: &Simulation) -> Result<Exchange, Infallible> {
        let mut reports = BTreeMap::new();
        for name in simulation.names() {
            let mut report = Report {
                epoch: clock.epoch,
                tick: clock.tick,
                generation: 1,
                proposal: simulation.location(name).unwrap(),
                speed_mps: 0.0,
                direction_rad: 0.0,
                emotion_state: "CALM".into(),
                behavior_state: "IDLE".into(),
                state_variables: BTreeMap::new(),
                sent: vec![],
                missing: vec![],
                log: vec![],
            };
            (self.act)(name, &clock, &mut report);
            reports.insert(name.clone(), report);
        }
        self.clocks.push(clock);
        Ok(Exchange {
            reports,
            membership: vec![],
        })
    }
}

const TWO: &str = "duration = \"10 s\"\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n\
                   [[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n";

fn play(
    text: &str,
    ticks: usize,
    act: impl FnMut(&RobotName, &Clock, &mut Report),
) -> (Simulation, Vec<Clock>, Vec<TickRecord>) {
    let source = Source {
        name: "test".into(),
        text: text.into(),
    };
    let scenario = Scenario::parse(&source, Path::new(".")).unwrap();
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut puppets = Puppets {
        act,
        clocks: vec![],
    };
    let mut records = vec![simulation.init(&mut puppets).unwrap()];
    for _ in 0..ticks {
        records.push(simulation.step(&mut puppets).unwrap());
    }
    (simulation, puppets.clocks, records)
}

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

#[test]
fn an_accepted_proposal_is_where_the_robot_is_and_is_not_told() {
    let (simulation, clocks, _) = play(TWO, 1, |name, _, report| {
        if name.as_str() == "A" {
            report.proposal = Point::new(2.5, 2.25);
        }
    });
    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.5, 2.25)));
    assert!(
        clocks[1]
            .news
            .get(&name("A"))
            .is_none_or(|news| news.correction.is_none())
    );
}

#[test]
fn who_collides_is_not_advanced_and_is_told_where_it_stands() {
    let (simulation, clocks, records) = play(TWO, 2, |name, _, report| {
        if name.as_str() == "A" {
            report.proposal.x += 1.45; // Overlaps B, 2 m away, with bodies of 0.61 m.
        }
    });
    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.0, 2.0)));
    let correction = clocks[1].news[&name("A")].correction.unwrap();
    assert_eq!(
        (correction.location, correction.blocked),
        (Point::new(2.0, 2.0), true)
    );
    let blocked = Event::Blocked {
        robot: name("A"),
        by: "B".into(),
        at: Point::new(2.0, 2.0),
    };
    assert!(
        records[1].events.contains(&blocked),
        "{:?}",
        records[1].events
    );
}

#[test]
fn nobody_leaves_the_field_or_jumps() {
    let (simulation, _, records) = play(TWO, 1, |name, _, report| {
        report.proposal.x += if name.as_str() == "A" { -1.9 } else { 9.0 };
        report.proposal.y += if name.as_str() == "A" { 0.0 } else { 9.0 };
    });
    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.0, 2.0)));
    assert_eq!(simulation.location(&name("B")), Some(Point::new(4.0, 2.0)));
    let by: Vec<String> = records[1]
        .events
        .iter()
        .filter_map(|event| {
            if let Event::Blocked { by, .. } = event {
                Some(by.clone())
            } else {
                None
            }
        })
        .collect();
    assert_eq!(by.len(), 2);
    assert_eq!(by[1], "too_fast");
}

#[test]
fn a_command_sent_in_a_tick_is_named_by_the_next_clock_in_the_order_of_senders() {
    let sends = |to: &str, seq| SentCommand {
        to: RobotName::new(to).unwrap(),
        seq,
        performative: Performative::Achieve,
        command: format!("c{seq}"),
    };
    let (_, clocks, records) = play(TWO, 3, |_, clock, report| {
        if clock.tick == 1 {
            report.sent = vec![sends("A", 1), sends("B", 2), sends("A", 3)];
        }
    });
    let ids = |list: &[(&str, u64)]| -> Vec<CommandId> {
        list.iter()
            .map(|(from, seq)| CommandId {
                from: name(from),
                seq: *seq,
            })
            .collect()
    };
    assert_eq!(
        clocks[2].news[&name("A")].commands,
        ids(&[("A", 1), ("A", 3), ("B", 1), ("B", 3)])
    );
    assert_eq!(
        clocks[2].news[&name("B")].commands,
        ids(&[("A", 2), ("B", 2)])
    );
    assert!(clocks[1].news.is_empty() && clocks[3].news.is_empty());
    let delivered = records[2]
        .events
        .iter()
        .filter(|event| matches!(event, Event::CommandDelivered { .. }))
        .count();
    assert_eq!(delivered, 6);
}

#[test]
fn a_command_from_outside_is_delivered_at_the_next_tick_and_recorded() {
    let (mut simulation, ..) = play(TWO, 1, |_, _, _| {});
    assert_eq!(simulation.command(&name("B"), "refill"), 1);
    let mut puppets = Puppets {
        act: |_: &RobotName, _: &Clock, _: &mut Report| {},
        clocks: vec![],
    };
    let record = simulation.step(&mut puppets).unwrap();
    let id = CommandId {
        from: RobotName::operator(),
        seq: 1,
    };
    assert_eq!(puppets.clocks[0].news[&name("B")].commands, [id]);
    assert!(matches!(&record.events[0], Event::CommandSent { command, .. } if command == "refill"));
}

#[test]
fn robots_within_range_are_sensed_with_where_they_are() {
    let near = TWO.replace("4 m", "3 m");
    let (_, clocks, _) = play(&near, 1, |_, _, _| {});
    let sensed = &clocks[1].news[&name("A")].sensed;
    assert_eq!(
        (sensed[0].name.as_str(), sensed[0].location),
        ("B", Point::new(3.0, 2.0))
    );
    let (_, clocks, _) = play(TWO, 1, |_, _, _| {});
    assert!(clocks[1].news.is_empty(), "2 m is beyond 6 ft");
}

#[test]
fn a_percept_is_as_of_the_tick_under_way() {
    struct Asker(Option<protocol::messages::Percept>);
    impl Barrier for Asker {
        type Interrupt = Infallible;
        fn exchange(
            &mut self,
            clock: Clock,
            simulation: &Simulation,
        ) -> Result<Exchange, Infallible> {
            self.0 = Some(simulation.percept(&simulation.names()[0]));
            assert_eq!(self.0.as_ref().unwrap().tick, clock.tick);
            Ok(Exchange::default())
        }
    }
    let near = TWO.replace("4 m", "3 m") + "[[obstacle]]\nat = [\"2 m\", \"3 m\"]\n";
    let source = Source {
        name: "test".into(),
        text: near,
    };
    let mut simulation =
        Simulation::new(Scenario::parse(&source, Path::new(".")).unwrap(), 1).unwrap();
    let mut asker = Asker(None);
    simulation.init(&mut asker).unwrap();
    simulation.step(&mut asker).unwrap();
    let kinds: Vec<_> = asker
        .0
        .unwrap()
        .bodies
        .iter()
        .map(|body| body.kind)
        .collect();
    assert_eq!(
        kinds,
        [
            protocol::messages::SensedKind::Obstacle,
            protocol::messages::SensedKind::Robot
        ]
    );
}

#[test]
fn who_does_not_report_stays_and_is_out_of_reach_at_the_next_tick() {
    struct Deaf;
    impl Barrier for Deaf {
        type Interrupt = Infallible;
        fn exchange(
            &mut self,
            clock: Clock,
            simulation: &Simulation,
        ) -> Result<Exchange, Infallible> {
            let mut puppets = Puppets {
                act: |_: &RobotName, _: &Clock, _: &mut Report| {},
                clocks: vec![],
            };
            let mut exchange = puppets.exchange(clock, simulation)?;
            exchange.reports.remove("B");
            Ok(exchange)
        }
    }
    let source = Source {
        name: "test".into(),
        text: TWO.into(),
    };
    let mut simulation =
        Simulation::new(Scenario::parse(&source, Path::new(".")).unwrap(), 1).unwrap();
    let record = simulation.init(&mut Deaf).unwrap();
    assert!(record.events.contains(&Event::Missed { robot: name("B") }));
    let mut puppets = Puppets {
        act: |_: &RobotName, _: &Clock, _: &mut Report| {},
        clocks: vec![],
    };
    simulation.step(&mut puppets).unwrap();
    assert_eq!(puppets.clocks[0].news[&name("A")].unreachable, [name("B")]);
    assert!(
        !puppets.clocks[0].news[&name("B")]
            .correction
            .unwrap()
            .blocked
    );
}

#[test]
fn every_value_that_a_robot_reports_is_in_the_digest() {
    let digest = |change: fn(&mut Report)| {
        let (simulation, ..) = play(TWO, 3, |name, clock, report| {
            if name.as_str() == "B" && clock.tick == 2 {
                change(report);
            }
        });
        simulation.digest()
    };
    let same = digest(|_| {});
    assert_eq!(same, digest(|_| {}));
    let changes: [fn(&mut Report); 8] = [
        |report| report.proposal.x += 1e-12,
        |report| report.speed_mps = 1e-300,
        |report| report.direction_rad = 1e-6,
        |report| report.emotion_state = "CALN".into(),
        |report| report.behavior_state = "IDLF".into(),
        |report| drop(report.state_variables.insert("x".into(), 1.0.into())),
        |report| {
            let (to, performative) = (RobotName::operator(), Performative::Achieve);
            report.sent = vec![SentCommand {
                to,
                seq: 1,
                performative,
                command: "x".into(),
            }];
        },
        |report| report.log = vec!["x".into()],
    ];
    let mut seen = vec![same];
    for change in changes {
        let other = digest(change);
        assert!(!seen.contains(&other), "a change is not in the digest");
        seen.push(other);
    }
    assert_eq!(
        digest(|report| report.speed_mps = -0.0),
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
