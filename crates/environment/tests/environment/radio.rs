//! The radios of the simulated network: their models over commands and queries, and why messages are lost.

use std::collections::BTreeMap;

use environment::medium::{ForcedVerdict, Medium, NetworkDecisions, NetworkVerdict, SentCommand};
use protocol::event::Cause;
use protocol::messages::{CommandText, Payload, Point};
use protocol::{Event, RobotName};
use radio::outage;
use world::Crossed;

use crate::common::{command, medium_of, name};

/// Quantile of the normal distribution for bounds of 99 %.
const Z_99: f64 = 2.576;
const DRAWS: u64 = 100_000;
/// 30 dB are left at 1 m, so the power is enough up to 10 m.
const TEN_METERS: &str = "path_loss = { exponent = 3.0, loss_db = 40.0 }, sensitivity_dbm = -70.0";

fn medium(radio: &str) -> Medium {
    medium_with("", radio)
}

fn medium_with(rules: &str, radio: &str) -> Medium {
    let mut text = format!("seed = 5\ntick = \"0.5 s\"\n[network]\n{rules}\n");
    if !radio.is_empty() {
        text += &format!("radio = {{ {radio} }}\n");
    }
    for (index, name) in ["A", "B", "C"].iter().enumerate() {
        text += &format!(
            "[[robot]]\nname = \"{name}\"\nat = [\"{} m\", \"2 m\"]\n",
            2 + 2 * index
        );
    }
    medium_of(&text)
}

/// A and B apart from each other, and C beside B.
fn apart(distance_m: f64) -> Vec<Point> {
    [0.0, distance_m, distance_m + 0.1]
        .map(|x| Point { x, y: 0.0 })
        .to_vec()
}

/// The causes of lost commands, by their numbers.
fn lost(decision: &NetworkDecisions) -> Vec<(u64, Cause)> {
    let mut lost = Vec::new();
    for event in &decision.events {
        if let Event::CommandDropped { seq, because, .. } = event {
            lost.push((*seq, *because));
        }
    }
    lost
}

/// Why a command from A to B is lost at a distance behind walls and bodies; `None` if it arrives.
fn fate(medium: &mut Medium, distance_m: f64, walls: u32, bodies: u32) -> Option<Cause> {
    medium.accept(command("A", "B", 1));
    let decision = medium.decide_among(2, apart(distance_m), &|_, _| Crossed { walls, bodies });
    lost(&decision).first().map(|(_, because)| *because)
}

#[track_caller]
fn check_share(what: &str, hits: u64, draws: u64, probability: f64) {
    let share = hits as f64 / draws as f64;
    let room = Z_99 * (probability * (1.0 - probability) / draws as f64).sqrt();
    assert!(
        (share - probability).abs() <= room,
        "{what}: {share} is not {probability} within {room}"
    );
}

#[test]
fn commands_arrive_as_far_as_their_power_is_enough() {
    let mut radio = medium(&format!("{TEN_METERS}, walls_db = 6.0, bodies_db = 4.0"));
    assert_eq!(fate(&mut radio, 9.99, 0, 0), None);
    assert_eq!(fate(&mut radio, 10.01, 0, 0), Some(Cause::Distance));
    assert_eq!(fate(&mut radio, 5.0, 1, 0), None, "9 dB are left");
    assert_eq!(fate(&mut radio, 5.0, 2, 0), Some(Cause::Wall));
    assert_eq!(fate(&mut radio, 5.0, 1, 1), Some(Cause::Body));
    assert_eq!(fate(&mut radio, 12.0, 9, 9), Some(Cause::Distance));
}

#[test]
fn a_range_and_rules_hold_beside_the_power() {
    let mut radio = medium(&format!("range = \"4 m\", {TEN_METERS}"));
    assert_eq!(fate(&mut radio, 3.9, 0, 0), None);
    assert_eq!(fate(&mut radio, 4.1, 0, 0), Some(Cause::OutOfRange));

    let mut rules = medium_with("commands.loss = 1.0", TEN_METERS);
    assert_eq!(fate(&mut rules, 1.0, 0, 0), Some(Cause::Loss));
}

#[test]
fn queries_need_power_both_ways() {
    let mut radio = medium(&format!("{TEN_METERS}, walls_db = 60.0"));
    let reached = |decision: &NetworkDecisions| {
        let mut words = String::new();
        for (asker, targets) in decision.in_range.as_ref().unwrap() {
            let targets: String = targets.iter().map(RobotName::as_str).collect();
            words += &format!("{asker}:{targets} ");
        }
        words
    };
    let near = radio.decide(2, apart(5.0));
    assert_eq!(reached(&near), "A:BC B:AC C:AB ");
    let far = radio.decide(3, apart(12.0));
    assert_eq!(reached(&far), "A: B:C C:B ");
    let behind = radio.decide_among(4, apart(5.0), &|one, other| Crossed {
        walls: u32::from((one, other) == (0, 1)),
        bodies: 0,
    });
    assert_eq!(reached(&behind), "A:C B:C C:AB ");
    for decision in [near, far, behind] {
        assert!(decision.unreachable.is_empty() && decision.events.is_empty());
    }
}

#[test]
fn rayleigh_fading_loses_commands_and_queries_as_its_closed_form_says() {
    let mut radio = medium(&format!("{TEN_METERS}, fading = \"rayleigh\""));
    for distance_m in [5.0, 9.9] {
        let (mut commands, mut queries) = (0, 0);
        for tick in 2..DRAWS + 2 {
            radio.accept(command("A", "B", tick));
            let decision = radio.decide(tick, apart(distance_m));
            for event in &decision.events {
                match event {
                    Event::CommandDropped { because, .. } => {
                        assert_eq!(*because, Cause::Fading);
                        commands += 1;
                    }
                    Event::QueryLost { from, to, because } => {
                        assert_eq!(*because, Cause::Fading);
                        queries += u64::from((from.as_str(), to.as_str()) == ("A", "B"));
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
        // The mean power is above the sensitivity by the third power of 10 m over the distance.
        let share = (distance_m / 10.0) * (distance_m / 10.0) * (distance_m / 10.0);
        let expected = outage::rayleigh(share);
        check_share(
            &format!("commands at {distance_m} m"),
            commands,
            DRAWS,
            expected,
        );
        check_share(
            &format!("queries at {distance_m} m"),
            queries,
            DRAWS,
            expected,
        );
    }
}

#[test]
fn nakagami_fading_loses_commands_as_its_closed_form_says() {
    let fading = "fading = { nakagami = 1.5, beyond = [{ distance = \"8 m\", nakagami = 0.75 }] }";
    let mut radio = medium(&format!("{TEN_METERS}, {fading}"));
    for (distance_m, m) in [(6.0, 1.5), (9.0, 0.75)] {
        let mut commands = 0;
        for tick in 2..DRAWS + 2 {
            radio.accept(command("A", "B", tick));
            commands += lost(&radio.decide(tick, apart(distance_m))).len() as u64;
        }
        let share = (distance_m / 10.0) * (distance_m / 10.0) * (distance_m / 10.0);
        let expected = outage::nakagami(m, share);
        check_share(&format!("{distance_m} m"), commands, DRAWS, expected);
    }
}

#[test]
fn shadowing_belongs_to_the_places_and_has_its_closed_form() {
    let shadowing = "shadowing = { sigma_db = 6.0, distance = \"2 m\" }";
    let mut radio = medium(&format!("{TEN_METERS}, {shadowing}"));
    let mut dropped = 0;
    for draw in 0..DRAWS {
        // Places that are farther apart than the correlation reaches, with the same distance between A and B.
        let aside_m = draw as f64 * 4.0 + 0.7;
        let places = [0.0, 8.0, 9.0].map(|x| Point { x, y: aside_m });
        radio.accept(command("A", "B", draw));
        radio.accept(command("B", "A", draw));
        let causes = lost(&radio.decide(draw + 2, places.to_vec()));
        assert!([0, 2].contains(&causes.len()), "both directions or none");
        assert!(
            causes
                .iter()
                .all(|(_, because)| *because == Cause::Shadowing)
        );
        dropped += causes.len() as u64 / 2;
    }
    let margin_db = 30.0 * libm::log10(10.0 / 8.0);
    check_share(
        "shadowing",
        dropped,
        DRAWS,
        outage::log_normal(margin_db, 6.0),
    );

    // A robot that stands still keeps its value, also when chance is drawn anew.
    for aside_m in [3.0, 50.0, 120.0, 333.0, 1001.0] {
        let places = [0.0, 9.9, 20.0].map(|x| Point { x, y: aside_m }).to_vec();
        let mut fates = Vec::new();
        for tick in 2..40 {
            if tick == 20 {
                radio.reseed([77, 78]);
            }
            radio.accept(command("A", "B", tick));
            fates.push(lost(&radio.decide(tick, places.clone())).len());
        }
        assert!(fates.iter().all(|fate| *fate == fates[0]), "{fates:?}");
    }
}

#[test]
fn no_other_message_and_no_rule_changes_the_fate_of_one() {
    let radio = format!(
        "{TEN_METERS}, fading = \"rayleigh\", shadowing = {{ sigma_db = 4.0 }}, bit_rate = \"1 Mbit/s\""
    );
    let play = |rules: &str, is_busy: bool| {
        let mut radio = medium_with(rules, &radio);
        let mut fates = BTreeMap::new();
        let mut last_of_a = 0;
        for tick in 2..600 {
            // Numbered as in a run: through the epoch, to whichever robot.
            let mut next = || {
                last_of_a += 1;
                last_of_a
            };
            if is_busy {
                radio.accept(command("A", "C", next()));
            }
            let seq_to_b = next();
            radio.accept(command("A", "B", seq_to_b));
            if is_busy {
                radio.accept(command("A", "C", next()));
                radio.accept(command("B", "A", tick));
                radio.accept(command("C", "B", tick));
            }
            let distance_m = 4.0 + 0.01 * tick as f64;
            for event in radio.decide(tick, apart(distance_m)).events {
                if let Event::CommandDropped {
                    from, seq, because, ..
                } = event
                    && (from.as_str(), seq) == ("A", seq_to_b)
                {
                    fates.insert(tick, because);
                }
            }
        }
        fates
    };
    let alone = play("", false);
    assert!(alone.len() > 50 && alone.len() < 500, "{}", alone.len());
    assert_eq!(alone, play("", true));

    let mut both = play("commands.loss = 0.3", false);
    let by_chance = both.values().filter(|because| **because == Cause::Loss);
    assert!((120..240).contains(&by_chance.count()));
    both.retain(|_, because| *because != Cause::Loss);
    let mut expected = alone;
    expected.retain(|tick, _| both.contains_key(tick));
    assert_eq!(
        both, expected,
        "a message passes both tests or neither changes"
    );
}

/// Texts of commands of so many bytes.
fn long(from: &str, to: &str, seq: u64, bytes: usize) -> SentCommand {
    SentCommand {
        text: CommandText::named("x".repeat(bytes)),
        ..command(from, to, seq)
    }
}

/// When commands arrive at B and C, or why they do not.
fn arrivals(medium: &mut Medium, ticks: std::ops::Range<u64>) -> Vec<(u64, String, u64)> {
    let mut arrived = Vec::new();
    for tick in ticks {
        for (to, commands) in medium.decide(tick, Vec::new()).delivered {
            for arrival in commands {
                arrived.push((tick, format!("{}{to}", arrival.delivery.from), arrival.seq));
            }
        }
    }
    arrived
}

#[test]
fn commands_wait_until_their_sender_has_sent_those_before() {
    // A tick of 0.5 s has room for 100 bytes, 20 of which are overhead.
    let rate = "bit_rate = \"1.6 kbit/s\", overhead_bytes = 20";
    let mut radio = medium(rate);
    for seq in 1..=3 {
        radio.accept(long("A", "B", seq, 80));
    }
    radio.accept(long("C", "B", 1, 80));
    let decision = radio.decide(2, Vec::new());
    let delayed: Vec<(u64, u64, Option<Cause>)> = decision
        .events
        .iter()
        .filter_map(|event| match event {
            Event::CommandDelayed {
                seq,
                until,
                because,
                ..
            } => Some((*seq, *until, *because)),
            _ => None,
        })
        .collect();
    assert_eq!(
        delayed,
        [(2, 3, Some(Cause::Queue)), (3, 4, Some(Cause::Queue))]
    );
    let seqs: Vec<u64> = decision.delivered[&name("B")]
        .iter()
        .map(|arrival| arrival.seq)
        .collect();
    assert_eq!(seqs, [1, 1], "the first one of A, and that of C");

    // The next one waits for those before, and takes two ticks by itself.
    radio.accept(long("A", "B", 4, 180));
    let expected = [(3, 2), (4, 3), (6, 4)].map(|(tick, seq)| (tick, "AB".to_owned(), seq));
    assert_eq!(arrivals(&mut radio, 3..10), expected);

    // It is idle again.
    radio.accept(long("A", "B", 5, 80));
    assert_eq!(arrivals(&mut radio, 30..32), [(30, "AB".to_owned(), 5)]);
}

#[test]
fn a_broadcast_is_sent_once_and_a_payload_takes_time() {
    let rate = "bit_rate = \"1.6 kbit/s\", overhead_bytes = 20";
    let mut radio = medium(rate);
    radio.accept(long("A", "B", 1, 80));
    radio.accept(long("A", "C", 2, 80));
    let both = [(2, "AB".to_owned(), 1), (2, "AC".to_owned(), 2)];
    assert_eq!(arrivals(&mut radio, 2..6), both);

    // Twice the same to one robot is sent twice, and so is what differs.
    radio.accept(long("A", "B", 3, 80));
    radio.accept(long("A", "B", 4, 80));
    radio.accept(long("A", "C", 5, 79));
    let times: Vec<u64> = arrivals(&mut radio, 10..16)
        .iter()
        .map(|(tick, ..)| *tick)
        .collect();
    assert_eq!(times, [10, 11, 12]);

    let mut with_payload = long("A", "B", 6, 10);
    with_payload.text.payload = Payload::of(&"0123456789").unwrap();
    radio.accept(long("A", "B", 7, 58));
    radio.accept(with_payload);
    // 20 + 58 and 20 + 10 + 12 bytes.
    let times: Vec<(u64, u64)> = arrivals(&mut radio, 20..26)
        .iter()
        .map(|(tick, _, seq)| (*tick, *seq))
        .collect();
    assert_eq!(times, [(20, 7), (21, 6)]);
}

#[test]
fn a_full_queue_drops_what_has_no_room() {
    let mut radio = medium("bit_rate = \"1.6 kbit/s\", overhead_bytes = 20, queue_bytes = 250");
    for seq in 1..=4 {
        radio.accept(long("A", "B", seq, 80));
    }
    radio.accept(long("A", "B", 5, 20));
    radio.accept(long("B", "A", 1, 80));
    let decision = radio.decide(2, Vec::new());
    assert_eq!(lost(&decision), [(3, Cause::Queue), (4, Cause::Queue)]);
    let rest: Vec<(u64, u64)> = arrivals(&mut radio, 3..6)
        .iter()
        .map(|(tick, _, seq)| (*tick, *seq))
        .collect();
    assert_eq!(rest, [(3, 2), (4, 5)], "a shorter one has room");
}

#[test]
fn what_waits_is_judged_when_it_is_sent() {
    let radio = format!("{TEN_METERS}, bit_rate = \"1.6 kbit/s\", overhead_bytes = 20");
    let mut radio = medium(&radio);
    radio.accept(long("A", "B", 1, 80));
    radio.accept(long("A", "B", 2, 80));
    assert!(lost(&radio.decide(2, apart(5.0))).is_empty());
    let causes = lost(&radio.decide(3, apart(15.0)));
    assert_eq!(causes, [(2, Cause::Distance)]);
}

#[test]
fn a_forced_verdict_overrules_the_radio() {
    let radio = format!("{TEN_METERS}, bit_rate = \"1.6 kbit/s\", overhead_bytes = 20");
    let force = |medium: &mut Medium, verdict| {
        medium.force(ForcedVerdict {
            from: name("A"),
            to: name("B"),
            verdict,
        });
    };
    let mut radio = medium(&radio);
    radio.accept(long("A", "B", 1, 80));
    radio.accept(long("A", "B", 2, 80));
    force(&mut radio, NetworkVerdict::Arrives(2));
    let decision = radio.decide(2, apart(15.0));
    assert_eq!(lost(&decision), [(1, Cause::Distance)]);
    assert_eq!(decision.delivered[&name("B")].len(), 1, "at once");

    radio.accept(long("A", "B", 3, 180));
    assert!(radio.decide(3, apart(15.0)).delivered.is_empty());
    force(&mut radio, NetworkVerdict::Arrives(3));
    assert!(radio.decide(4, apart(15.0)).delivered.is_empty());
    force(&mut radio, NetworkVerdict::Arrives(3));
    assert_eq!(radio.decide(5, apart(15.0)).delivered.len(), 1);
}
