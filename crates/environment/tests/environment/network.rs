//! The simulated network: what it does is drawn from the seed, message by message, and told.

use std::collections::BTreeMap;
use std::iter::zip;

use environment::medium::{Medium, NetworkDecisions};
use protocol::event::Cause;
use protocol::messages::Point;
use protocol::random::{stream, unit};
use protocol::{Event, RobotName};
use scenario::Scenario;
use scenario::diagnostic::FileError;

use crate::common::{self, command, medium_of, name};

const ROBOTS: &str = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n\
                      [[robot]]\nname = \"C\"\nat = [\"6 m\", \"2 m\"]\n";

fn parse(network: &str) -> Result<Scenario, FileError> {
    common::parse(&text(network))
}

fn text(network: &str) -> String {
    format!("seed = 5\n{network}\n{ROBOTS}")
}

fn medium(network: &str) -> Medium {
    medium_of(&text(network))
}

/// One command from A to B a tick, sent in the ticks from 1 on; what the network decides at the ticks from 2 on.
fn play(
    network: &str,
    ticks: u64,
    also: impl Fn(u64, &mut Medium),
) -> BTreeMap<u64, NetworkDecisions> {
    let mut medium = medium(network);
    let one = |tick: u64| {
        medium.accept(command("A", "B", tick));
        also(tick, &mut medium);
        (tick + 1, medium.decide(tick + 1, Vec::new()))
    };
    (1..=ticks).map(one).collect()
}

/// Numbers of the commands from A that were lost, with the cause.
fn lost(decisions: &BTreeMap<u64, NetworkDecisions>) -> Vec<(u64, Cause)> {
    let dropped = |event: &Event| match event {
        Event::CommandDropped {
            from, seq, because, ..
        } if from.as_str() == "A" => Some((*seq, *because)),
        _ => None,
    };

    decisions
        .values()
        .flat_map(|decision| decision.events.iter().filter_map(dropped))
        .collect()
}

/// When the commands from A to B arrived: tick and number.
fn arrived(decisions: &BTreeMap<u64, NetworkDecisions>) -> Vec<(u64, u64)> {
    let at_b = |(tick, decision): (&u64, &NetworkDecisions)| {
        let arrivals = decision
            .delivered
            .get(&name("B"))
            .cloned()
            .unwrap_or_default();
        let tick = *tick;
        arrivals
            .into_iter()
            .filter(|arrival| arrival.delivery.from.as_str() == "A")
            .map(move |arrival| (tick, arrival.seq))
    };

    decisions.iter().flat_map(at_b).collect()
}

#[test]
fn a_perfect_network_loses_nothing_and_a_dead_one_everything() {
    for network in ["", "network.commands.loss = 0.0"] {
        let decisions = play(network, 100, |_, _| ());
        assert_eq!(
            arrived(&decisions),
            (1..=100).map(|seq| (seq + 1, seq)).collect::<Vec<_>>()
        );
        assert!(
            decisions
                .values()
                .all(|decision| decision.events.is_empty() && decision.unreachable.is_empty())
        );
    }

    let decisions = play("network.commands.loss = 1.0", 100, |_, _| ());
    assert_eq!(
        (arrived(&decisions).len(), lost(&decisions).len()),
        (0, 100)
    );
}

#[test]
fn as_much_is_lost_as_the_scenario_says() {
    for loss in [0.1, 0.25, 0.5, 0.9] {
        let n = 20_000;
        let decisions = play(&format!("network.commands.loss = {loss}"), n, |_, _| ());
        let share = lost(&decisions).len() as f64 / n as f64;
        // Five standard deviations of a binomial share.
        let room = 5.0 * (loss * (1.0 - loss) / n as f64).sqrt();
        assert!((share - loss).abs() < room, "{loss}: {share}");
        assert_eq!(
            lost(&decisions).len() + arrived(&decisions).len(),
            n as usize,
            "it arrives or it is lost"
        );
    }
}

#[test]
fn other_messages_and_robots_change_nothing_of_the_fate_of_one() {
    let network = "network.commands = { loss = 0.3, duplication = 0.2, delay = { min = \"0 s\", mode = \"1 s\", max = \"3 s\" } }";
    let alone = play(network, 500, |_, _| ());
    let in_company = play(network, 500, |tick, medium| {
        medium.accept(command("B", "A", tick));
        medium.accept(command("C", "B", tick));
    });

    assert_eq!(
        (lost(&alone), arrived(&alone)),
        (lost(&in_company), arrived(&in_company))
    );
}

#[test]
fn what_is_lost_does_not_depend_on_what_else_the_network_does() {
    let plain = lost(&play("network.commands.loss = 0.3", 500, |_, _| ()));
    let more = "network.commands = { loss = 0.3, duplication = 0.5, delay = \"2 s\" }\nnetwork.queries.loss = 0.5";
    assert_eq!(plain, lost(&play(more, 500, |_, _| ())));
}

#[test]
fn delays_are_those_of_the_scenario_and_are_told() {
    let decisions = play("network.commands.delay = \"1.5 s\"", 50, |_, _| ());
    assert_eq!(
        arrived(&decisions),
        (1..=47).map(|seq| (seq + 4, seq)).collect::<Vec<_>>()
    );
    let told = decisions.values().flat_map(|decision| &decision.events);
    assert!(told.clone().all(
        |event| matches!(event, Event::CommandDelayed { seq, until, .. } if *until == seq + 4)
    ));
    assert_eq!(told.count(), 50);

    let network = "network.commands.delay = { min = \"0 s\", mode = \"0 s\", max = \"5 s\" }";
    let decisions = play(network, 5000, |_, _| ());
    let late: Vec<f64> = arrived(&decisions)
        .iter()
        .map(|(tick, seq)| (tick - seq - 1) as f64 * 0.5)
        .collect();
    let mean = late.iter().sum::<f64>() / late.len() as f64;
    assert!(
        (mean - 5.0 / 3.0).abs() < 0.1,
        "a triangle's mean is the mean of its corners: {mean}"
    );
    assert!(late.contains(&0.0) && late.iter().all(|late| *late <= 5.0));
}

#[test]
fn a_doubled_command_arrives_twice_in_a_row_and_is_told() {
    let decisions = play("network.commands.duplication = 1.0", 10, |_, _| ());
    let twice: Vec<(u64, u64)> = (1..=10).flat_map(|seq| [(seq + 1, seq); 2]).collect();
    assert_eq!(arrived(&decisions), twice);
    assert!(
        decisions
            .values()
            .all(|decision| matches!(&decision.events[..], [Event::CommandDuplicated { .. }]))
    );
}

#[test]
fn bursts_lose_in_runs() {
    // Bad one tick in five on average, for ten ticks at a time.
    let network = "network.commands.burst = { enter = 0.025, leave = 0.1 }";
    let decisions = play(network, 40_000, |_, _| ());
    let lost = lost(&decisions);
    assert!(lost.iter().all(|(_, cause)| *cause == Cause::Burst));

    let share = lost.len() as f64 / 40_000.0;
    assert!((share - 0.2).abs() < 0.03, "{share}");

    let runs = 1 + lost
        .windows(2)
        .filter(|pair| pair[1].0 != pair[0].0 + 1)
        .count();
    let length = lost.len() as f64 / runs as f64;
    assert!(
        (length - 10.0).abs() < 1.5,
        "mean length of a burst: {length}"
    );
}

#[test]
fn a_link_can_be_worse_than_the_rest() {
    let network = "network.commands.loss = 0.0\n[[network.link]]\nfrom = \"A\"\nto = \"B\"\ncommands = { loss = 1.0 }\n";
    assert_eq!(lost(&play(network, 50, |_, _| ())).len(), 50);
    let back = "[[network.link]]\nfrom = \"B\"\nto = \"A\"\ncommands = { loss = 1.0 }\n";
    assert!(lost(&play(back, 50, |_, _| ())).is_empty());
    let only_queries = "network.commands.loss = 1.0\n[[network.link]]\nfrom = \"A\"\nto = \"B\"\nqueries = { loss = 0.0 }\n";
    assert_eq!(lost(&play(only_queries, 50, |_, _| ())).len(), 50);
}

/// Who cannot ask whom at each tick, as one text.
fn cut_off(decision: &NetworkDecisions) -> String {
    let one = |(asker, targets): (&RobotName, &Vec<RobotName>)| {
        format!(
            "{asker}:{}",
            targets.iter().map(RobotName::as_str).collect::<String>()
        )
    };

    decision
        .unreachable
        .iter()
        .map(one)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn a_partition_cuts_commands_and_queries_from_its_first_to_its_last_tick() {
    let network = "[[network.partition]]\ngroups = [[\"A\"], [\"B\", \"C\"]]\nfrom = \"5 s\"\nuntil = \"10 s\"\n";
    let decisions = play(network, 30, |tick, medium| {
        medium.accept(command("B", "C", tick));
    });

    // What is decided at the ticks 10 to 19 was sent one tick earlier.
    assert_eq!(
        lost(&decisions),
        (9..=18)
            .map(|seq| (seq, Cause::Partition))
            .collect::<Vec<_>>()
    );

    for (tick, decision) in &decisions {
        let expected = if (10..20).contains(tick) {
            "A:BC B:A C:A"
        } else {
            ""
        };
        assert_eq!(cut_off(decision), expected, "tick {tick}");
        let told = |cut: bool| {
            let is_told = |event: &&Event| match event {
                Event::LinkCut {
                    commands: true,
                    queries: true,
                    ..
                } => cut,
                Event::LinkHealed { .. } => !cut,
                _ => false,
            };
            decision.events.iter().filter(is_told).count()
        };
        assert_eq!(
            (told(true), told(false)),
            (
                if *tick == 10 { 4 } else { 0 },
                if *tick == 20 { 4 } else { 0 }
            )
        );
    }
}

#[test]
fn a_partition_can_be_one_way_or_of_one_kind_only() {
    let one_way =
        "[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"0 s\"\none_way = true\n";
    let decisions = play(one_way, 20, |tick, medium| {
        medium.accept(command("B", "A", tick));
    });
    assert_eq!(lost(&decisions).len(), 20);
    assert!(
        decisions
            .values()
            .all(|decision| decision.delivered.contains_key(&name("A")))
    );
    // A query needs an answer: neither can ask the other.
    assert!(
        decisions
            .values()
            .all(|decision| cut_off(decision) == "A:B B:A")
    );

    let queries = "[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"0 s\"\ncuts = [\"queries\"]\n";
    let decisions = play(queries, 20, |_, _| ());
    assert!(
        lost(&decisions).is_empty()
            && decisions
                .values()
                .all(|decision| cut_off(decision) == "A:B B:A")
    );
    let commands = "[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"0 s\"\ncuts = [\"commands\"]\n";
    let decisions = play(commands, 20, |_, _| ());
    assert!(
        lost(&decisions).len() == 20
            && decisions
                .values()
                .all(|decision| decision.unreachable.is_empty())
    );
}

#[test]
fn a_cut_loses_what_is_on_its_way() {
    let network = "network.commands.delay = \"3 s\"\n[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"5 s\"\nuntil = \"6 s\"\n";
    let lost = lost(&play(network, 40, |_, _| ()));
    // Two ticks of cut: what is sent then, and what would arrive then.
    assert_eq!(
        lost.iter().map(|(seq, _)| *seq).collect::<Vec<_>>(),
        [9, 3, 10, 4]
    );
}

#[test]
fn lost_queries_are_one_verdict_for_asker_target_and_tick() {
    let decisions = play("network.queries.loss = 0.25", 4000, |_, _| ());
    let count = decisions
        .values()
        .filter(|decision| cut_off(decision).contains("A:B"))
        .count() as f64;
    assert!((count / 4000.0 - 0.25).abs() < 0.05, "{count}");
    assert!(lost(&decisions).is_empty());

    for decision in decisions.values() {
        let told = decision
            .events
            .iter()
            .filter(|event| matches!(event, Event::QueryLost { .. }))
            .count();
        assert_eq!(
            told,
            decision.unreachable.values().map(Vec::len).sum::<usize>()
        );
    }
}

#[test]
fn a_person_at_the_console_is_not_on_the_robots_network() {
    let mut medium = medium("network.commands = { loss = 1.0, delay = \"5 s\" }");
    medium.accept(command("operator", "A", 1));
    let decision = medium.decide(2, Vec::new());
    assert!(decision.events.is_empty() && decision.delivered[&name("A")].len() == 1);
}

const LOSE_2_AND_5: &str =
    "network.lose = [{ from = 'A', to = 'B', number = 2 }, { from = 'A', to = 'B', number = 5 }]";

#[test]
fn exactly_the_named_commands_are_lost() {
    let decisions = play(LOSE_2_AND_5, 20, |tick, medium| {
        medium.accept(command("A", "C", 100 + tick));
        medium.accept(command("B", "A", tick));
    });
    assert_eq!(
        lost(&decisions),
        [(2, Cause::Scripted), (5, Cause::Scripted)]
    );
    assert_eq!(arrived(&decisions).len(), 18);
}

#[test]
fn a_named_command_changes_nothing_of_the_fate_of_others() {
    let chance = "network.commands = { loss = 0.3, duplication = 0.2 }";
    let named = format!("{chance}\n{LOSE_2_AND_5}");
    let mut by_chance = lost(&play(chance, 200, |_, _| ()));
    let mut with_named = lost(&play(&named, 200, |_, _| ()));

    by_chance.retain(|(seq, _)| ![2, 5].contains(seq));
    with_named.retain(|(_, because)| *because != Cause::Scripted);
    assert!(!by_chance.is_empty());
    assert_eq!(with_named, by_chance);
}

/// The decisions of a network in which chance decides, with and without an entry about command 3.
fn with_and_without(entry: &str) -> [BTreeMap<u64, NetworkDecisions>; 2] {
    let chance = "network.commands = { loss = 0.2, duplication = 0.2, delay = { min = \"0 s\", mode = \"1 s\", max = \"3 s\" } }";
    [
        play(&format!("{chance}\n{entry}"), 200, |_, _| ()),
        play(chance, 200, |_, _| ()),
    ]
}

/// What the network has decided about a command of A.
fn events_of(decisions: &BTreeMap<u64, NetworkDecisions>, of: u64) -> Vec<Event> {
    let all = decisions.values().flat_map(|decision| &decision.events);
    let about = all.filter(|event| match event {
        Event::CommandDelayed { seq, .. }
        | Event::CommandDuplicated { seq, .. }
        | Event::CommandDropped { seq, .. } => *seq == of,
        _ => false,
    });
    about.cloned().collect()
}

/// Without chance the named command is late by exactly this, or comes twice; all others have the fate that chance gives them.
#[test]
fn exactly_the_named_command_is_delayed_or_doubled() {
    let late = "network.delay = [{ from = 'A', to = 'B', number = 3, by = '2 s' }]";
    let decisions = play(late, 6, |_, _| ());
    let arrivals = [(2, 1), (3, 2), (5, 4), (6, 5), (7, 6)];
    assert_eq!(arrived(&decisions), arrivals, "3 arrives in tick 8");
    let expected = Event::CommandDelayed {
        from: name("A"),
        to: name("B"),
        seq: 3,
        until: 8,
        because: Some(Cause::Scripted),
    };
    assert_eq!(events_of(&decisions, 3), [expected]);

    let double = "network.duplicate = [{ from = 'A', to = 'B', number = 3 }]";
    let decisions = play(double, 4, |_, _| ());
    assert_eq!(
        arrived(&decisions),
        [(2, 1), (3, 2), (4, 3), (4, 3), (5, 4)]
    );
    let expected = Event::CommandDuplicated {
        from: name("A"),
        to: name("B"),
        seq: 3,
        because: Some(Cause::Scripted),
    };
    assert_eq!(events_of(&decisions, 3), [expected]);

    for entry in [late, double] {
        let [with, without] = with_and_without(entry);
        for seq in (1..=200).filter(|seq| *seq != 3) {
            assert_eq!(events_of(&with, seq), events_of(&without, seq), "{seq}");
        }
    }
}

/// A delay of the scenario adds to the one by chance. Loss by chance stays loss, and a command that is named as lost is lost.
#[test]
fn fates_of_a_named_command_add_up() {
    let by_chance = "network.commands.delay = '1 s'\n";
    let late = "network.delay = [{ from = 'A', to = 'B', number = 3, by = '2 s' }, \
                { from = 'A', to = 'B', number = 3, by = '3 s', text = 'other' }]";
    let until = |network: &str| match &events_of(&play(network, 9, |_, _| ()), 3)[..] {
        [Event::CommandDelayed { until, .. }] => Some(*until),
        _ => None,
    };
    assert_eq!(until(by_chance), Some(6));
    assert_eq!(until(&format!("{by_chance}{late}")), Some(10));
    assert_eq!(until(&format!("network.commands.loss = 1.0\n{late}")), None);

    let lose = "network.lose = [{ from = 'A', to = 'B', number = 3 }]";
    let decisions = play(&format!("{late}\n{lose}"), 9, |_, _| ());
    assert_eq!(lost(&decisions), [(3, Cause::Scripted)]);
    assert_eq!(events_of(&decisions, 3).len(), 1);
}

#[test]
fn commands_of_a_text_are_counted_on_their_own() {
    let network = "[[network.lose]]\nfrom = 'A'\nto = 'B'\nnumber = 2\ntext = 'hurry'";
    let decisions = play(network, 10, |tick, medium| {
        let mut hurry = command("A", "B", 100 + tick);
        hurry.text.command = "hurry".into();
        medium.accept(hurry);
    });
    assert_eq!(lost(&decisions), [(102, Cause::Scripted)]);
}

#[test]
fn a_command_is_counted_from_the_beginning_of_the_run() {
    let mut medium = medium("");
    let later = parse(LOSE_2_AND_5).unwrap().network;
    medium.count_for(&later);

    let mut decisions = BTreeMap::new();
    for tick in 1..=10 {
        if tick == 4 {
            medium.set_network(later.clone());
        }
        medium.accept(command("A", "B", tick));
        decisions.insert(tick + 1, medium.decide(tick + 1, Vec::new()));
    }
    assert_eq!(lost(&decisions), [(5, Cause::Scripted)]);
}

#[test]
fn impossible_networks_are_refused_where_they_stand() {
    let partition = |rest: &str| format!("[[network.partition]]\n{rest}");
    let lose = |rest: &str| format!("[[network.lose]]\n{rest}");
    let late = |by: &str| {
        format!("[[network.delay]]\nfrom = \"A\"\nto = \"B\"\nnumber = 1\nby = \"{by}\"")
    };

    for (network, reason) in [
        ("network.commands.loss = 1.5".to_owned(), "from 0 to 1"),
        ("network.commands.loss = -0.1".to_owned(), "from 0 to 1"),
        ("network.commands.loss = nan".to_owned(), "from 0 to 1"),
        (
            "network.commands.burst = { enter = 2, leave = 0.1 }".to_owned(),
            "burst.enter",
        ),
        ("network.commands.delay = \"1 h\"".to_owned(), "1000 ticks"),
        (
            "network.commands.delay = { min = \"3 s\", mode = \"1 s\", max = \"2 s\" }".to_owned(),
            "delay",
        ),
        (
            "network.queries.delay = \"1 s\"".to_owned(),
            "within their tick",
        ),
        ("[network]\ncommands = { los = 0.1 }".to_owned(), "los"),
        (
            "[[network.link]]\nfrom = \"A\"\nto = \"Z\"\ncommands = { loss = 1.0 }".to_owned(),
            "called Z",
        ),
        (
            partition("groups = [[\"A\"], [\"Z\"]]\nfrom = \"0 s\""),
            "called Z",
        ),
        (
            partition("groups = [[\"A\"]]\nfrom = \"0 s\""),
            "two groups",
        ),
        (
            partition("groups = [[\"A\", \"B\"], [\"B\"]]\nfrom = \"0 s\""),
            "in two groups",
        ),
        (
            partition("groups = [[\"A\"], [\"B\"]]\nfrom = \"5 s\"\nuntil = \"5 s\""),
            "before it begins",
        ),
        (
            partition("groups = [[\"A\"], [\"B\"]]\nfrom = \"-5 s\""),
            "beginning",
        ),
        (
            partition("groups = [[\"A\"], [\"B\"]]\nfrom = \"5 s\"\ncuts = []"),
            "cuts nothing",
        ),
        (lose("from = \"A\"\nto = \"Z\"\nnumber = 1"), "called Z"),
        (
            lose("from = \"operator\"\nto = \"A\"\nnumber = 1"),
            "called operator",
        ),
        (
            lose("from = \"A\"\nto = \"B\"\nnumber = 0"),
            "counted from 1",
        ),
        (late("0 s"), "by 1 to 1000 ticks: 0.5 s to 500 s"),
        (late("0.2 s"), "by 1 to 1000 ticks"),
        (late("-1 s"), "by 1 to 1000 ticks"),
        (late("500.5 s"), "by 1 to 1000 ticks"),
        (
            "[[network.delay]]\nfrom = \"A\"\nto = \"B\"\nnumber = 1".to_owned(),
            "missing field `by`",
        ),
        (
            "[[network.duplicate]]\nfrom = \"A\"\nto = \"B\"\nnumber = 0".to_owned(),
            "counted from 1",
        ),
    ] {
        let error = parse(&network).unwrap_err().in_words();
        assert!(
            error.starts_with("line ") && error.contains(reason),
            "{network}: {error}"
        );
    }
}

#[test]
fn the_resolved_file_has_the_same_network() {
    let network = "[network]\ncommands = { loss = 0.25, duplication = 0.1, delay = \"1 s\", burst = { enter = 0.1, leave = 0.5 } }\n\
                   queries = { loss = 0.1 }\nradio = { range = \"4.5 m\" }\n[[network.link]]\nfrom = \"A\"\nto = \"B\"\ncommands = { loss = 1.0 }\n\
                   [[network.partition]]\ngroups = [[\"A\"], [\"B\", \"C\"]]\nfrom = \"5 s\"\nuntil = \"7 s\"\none_way = true\ncuts = [\"queries\"]\n\
                   [[network.lose]]\nfrom = \"A\"\nto = \"B\"\nnumber = 3\ntext = \"refill\"\n\
                   [[network.lose]]\nfrom = \"B\"\nto = \"A\"\nnumber = 1\n\
                   [[network.delay]]\nfrom = \"A\"\nto = \"B\"\nnumber = 3\nby = \"500 s\"\n\
                   [[network.delay]]\nfrom = \"A\"\nto = \"C\"\nnumber = 1\nby = \"0.5 s\"\ntext = \"refill\"\n\
                   [[network.duplicate]]\nfrom = \"B\"\nto = \"C\"\nnumber = 2\n";
    let scenario = parse(network).unwrap();
    let text = scenario.to_toml().unwrap();
    let again = common::scenario(&text);

    assert_eq!(again.network, scenario.network);
}

#[test]
fn a_message_passes_as_far_as_the_radios_reach_and_no_farther() {
    let mut medium = medium("network.radio = { range = \"5 m\" }");
    let [at_the_limit, beyond] = [3.0, 3.0 + 1e-9].map(|x| [Point::default(), Point::new(x, 4.0)]);

    medium.accept(command("A", "B", 1));
    let decision = medium.decide(2, at_the_limit.to_vec());
    assert_eq!(decision.delivered[&name("B")].len(), 1);
    assert!(decision.unreachable.is_empty() && decision.events.is_empty());
    let in_range = decision.in_range.unwrap();
    assert_eq!(in_range[&name("A")], [name("B")]);
    assert_eq!(in_range[&name("B")], [name("A")]);

    medium.accept(command("A", "B", 2));
    medium.accept(command("operator", "B", 1));
    let decisions = BTreeMap::from([(3, medium.decide(3, beyond.to_vec()))]);
    assert_eq!(lost(&decisions), [(2, Cause::OutOfRange)]);
    let decision = &decisions[&3];
    assert_eq!(decision.delivered[&name("B")].len(), 1, "the operator's");
    assert!(decision.unreachable.is_empty());
    let in_range = decision.in_range.as_ref().unwrap();
    assert!(in_range.values().all(Vec::is_empty));
}

#[test]
fn distance_changes_no_chance_of_the_messages_that_are_in_range() {
    let rules = "network.commands = { loss = 0.5 }\nnetwork.queries = { loss = 0.5 }";
    let mut near = medium(rules);
    let mut moving = medium(&format!("{rules}\nnetwork.radio = {{ range = \"5 m\" }}"));
    let places = |x| {
        [(0.0, 0.0), (x, 0.0), (x, 1.0)]
            .map(|(x, y)| Point::new(x, y))
            .to_vec()
    };
    let mut in_range = 0;
    for tick in 1..=200 {
        near.accept(command("A", "B", tick));
        moving.accept(command("A", "B", tick));
        let one = near.decide(tick + 1, places(1.0));
        let other = moving.decide(tick + 1, places(if tick % 2 == 0 { 1.0 } else { 6.0 }));
        if tick % 2 == 0 {
            assert_eq!(one.events, other.events);
            assert_eq!(one.unreachable, other.unreachable);
            in_range += other.delivered.len();
        } else {
            assert!(other.delivered.is_empty());
        }
    }
    assert!((20..80).contains(&in_range), "{in_range} of 100 arrived");
}

#[test]
fn a_radio_that_reaches_nobody_is_refused() {
    for range in ["0 m", "-1 m"] {
        let error = parse(&format!("network.radio = {{ range = \"{range}\" }}")).unwrap_err();
        let words = error.in_words();
        assert!(words.contains("farther than 0 m"), "{words}");
    }
}

#[test]
fn radios_reach_whom_all_pairs_say() {
    let scenario = parse("network.radio = { range = \"5 m\" }").unwrap();
    let roster: Vec<RobotName> = (0..120)
        .map(|number| name(&format!("R{number:03}")))
        .collect();
    let mut medium = Medium::new(
        scenario.seed,
        scenario.tick_s,
        scenario.network,
        roster.clone(),
    );
    let mut chance = stream(7, "places");

    for tick in 1..=20 {
        // In a field of 4 m all are near, in one of 80 m hardly any.
        let side_m = 4.0 * tick as f64;
        let mut place = || Point::new(side_m * unit(&mut chance), side_m * unit(&mut chance));
        let places: Vec<Point> = roster.iter().map(|_| place()).collect();

        let in_range = medium.decide(tick, places.clone()).in_range.unwrap();
        for (one, at) in zip(&roster, &places) {
            let others = zip(&roster, &places).filter(|(other, _)| *other != one);
            let near = others.filter(|(_, other_at)| at.distance_m(**other_at) <= 5.0);
            let near: Vec<RobotName> = near.map(|(other, _)| other.clone()).collect();
            assert_eq!(in_range[one], near, "{one} in a field of {side_m} m");
        }
    }
}
