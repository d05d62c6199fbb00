//! The simulated network: what it loses is drawn from the seed, message by message.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use protocol::RobotName;
use simulator::Scenario;
use simulator::diagnostic::{FileError, Source};
use simulator::medium::{Medium, Underway};

const ROBOTS: &str =
    "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n";

fn parse(network: &str) -> Result<Scenario, FileError> {
    let text = format!("seed = 5\n{network}\n{ROBOTS}");
    Scenario::parse(&Source { name: "test".into(), text }, Path::new("."))
}

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// Of `count` commands from A to B, one a tick, the numbers of those that are lost.
fn lost(network: &str, count: u64, also: impl Fn(u64, &mut Medium)) -> Vec<u64> {
    let scenario = parse(network).unwrap();
    let mut medium = Medium::new(scenario.seed, scenario.network);
    let mut lost = Vec::new();
    for tick in 1..=count {
        medium.accept(tick, Underway { to: name("B"), from: name("A"), seq: tick });
        also(tick, &mut medium);
        let decision = medium.decide(tick + 1);
        lost.extend(decision.dropped.iter().filter(|command| command.from == name("A")).map(|c| c.seq));
        let arrived = decision.delivered.get(&name("B")).into_iter().flatten();
        let arrived = arrived.filter(|id| id.from == name("A")).count();
        assert_eq!(arrived, usize::from(lost.last() != Some(&tick)), "it arrives once or it is lost");
    }
    lost
}

#[test]
fn a_perfect_network_loses_nothing_and_a_dead_one_everything() {
    assert!(lost("", 100, |_, _| ()).is_empty());
    assert!(lost("network.commands.loss = 0.0", 100, |_, _| ()).is_empty());
    assert_eq!(lost("network.commands.loss = 1.0", 100, |_, _| ()).len(), 100);
}

#[test]
fn as_much_is_lost_as_the_scenario_says() {
    for loss in [0.1, 0.25, 0.5, 0.9] {
        let n = 20_000;
        let share = lost(&format!("network.commands.loss = {loss}"), n, |_, _| ()).len() as f64 / n as f64;
        // Five standard deviations of a binomial share.
        let room = 5.0 * (loss * (1.0 - loss) / n as f64).sqrt();
        assert!((share - loss).abs() < room, "{loss}: {share}");
    }
}

#[test]
fn other_messages_change_nothing_of_the_fate_of_one() {
    let alone = lost("network.commands.loss = 0.5", 500, |_, _| ());
    let in_company = lost("network.commands.loss = 0.5", 500, |tick, medium| {
        medium.accept(tick, Underway { to: name("A"), from: name("B"), seq: tick });
        medium.accept(tick, Underway { to: name("B"), from: name("C"), seq: tick });
    });
    assert_eq!(alone, in_company);
}

#[test]
fn a_link_can_be_worse_than_the_rest() {
    let network = "network.commands.loss = 0.0\n[[network.link]]\nfrom = \"A\"\nto = \"B\"\ncommands = { loss = 1.0 }\n";
    assert_eq!(lost(network, 50, |_, _| ()).len(), 50);
    let back = "[[network.link]]\nfrom = \"B\"\nto = \"A\"\ncommands = { loss = 1.0 }\n";
    assert!(lost(back, 50, |_, _| ()).is_empty());
}

#[test]
fn a_person_at_the_console_is_not_on_the_robots_network() {
    let scenario = parse("network.commands.loss = 1.0").unwrap();
    let mut medium = Medium::new(scenario.seed, scenario.network);
    medium.accept(1, Underway { to: name("A"), from: RobotName::operator(), seq: 1 });
    assert!(medium.decide(2).dropped.is_empty());
}

#[test]
fn impossible_networks_are_refused_where_they_stand() {
    for (network, reason) in [
        ("network.commands.loss = 1.5", "from 0 to 1"),
        ("network.commands.loss = -0.1", "from 0 to 1"),
        ("network.commands.loss = nan", "from 0 to 1"),
        ("[network]\ncommands = { los = 0.1 }", "los"),
        ("[[network.link]]\nfrom = \"A\"\nto = \"C\"\ncommands = { loss = 1.0 }", "called C"),
    ] {
        let error = parse(network).unwrap_err().in_words();
        assert!(error.starts_with("line ") && error.contains(reason), "{network}: {error}");
    }
}

#[test]
fn the_resolved_file_has_the_same_network() {
    let network = "network.commands.loss = 0.25\n[[network.link]]\nfrom = \"A\"\nto = \"B\"\ncommands = { loss = 1.0 }\n";
    let scenario = parse(network).unwrap();
    let text = scenario.to_toml().unwrap();
    let again = Scenario::parse(&Source { name: "again".into(), text }, Path::new(".")).unwrap();
    assert_eq!(again.network, scenario.network);
}
