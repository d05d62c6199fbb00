//! What a person does to a run in progress: it is said in the words of the scenario, and a record of it gives the same run again.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use environment::{Event, Simulation, TickRecord};
use lockstep::{Bulletin, Exchange, Sent, TickOutcome};
use protocol::event::Cause;
use protocol::messages::{
    CommandText, Cut, FaultKind, Intervention, OnLate, Point, Report, TickUpdate,
};
use protocol::{RobotName, Tick};
use scenario::Scenario;

use crate::common::{self, name, report};

const ROBOTS: &str = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"4 m\", \"2 m\"]\n\
                      [[robot]]\nname = \"C\"\nat = [\"6 m\", \"2 m\"]\n";
const TICKS: Tick = 12;

fn names(all: &[&str]) -> Vec<RobotName> {
    all.iter().copied().map(name).collect()
}

fn scenario(more: &str) -> Scenario {
    common::scenario(&format!("duration = \"6 s\"\n{more}\n{ROBOTS}"))
}

/// Robots that stay; A sends B a command in every tick.
struct Robots(Vec<(RobotName, Point)>);

impl Robots {
    fn of(simulation: &Simulation) -> Self {
        let mut places = Vec::new();
        for name in simulation.names() {
            places.push((name.clone(), simulation.location(name).unwrap()));
        }
        Self(places)
    }
}

impl Exchange<TickUpdate, Arc<Report>, CommandText> for Robots {
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: Tick,
        _news: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        let mut outcome = TickOutcome::default();
        for (robot, at) in &self.0 {
            let mut commands = Vec::new();
            if robot.as_str() == "A" {
                commands.push(Sent {
                    to: name("B").into(),
                    command: CommandText::named("refill"),
                });
            }
            let report = Report {
                commands: commands.len() as u32,
                ..report(tick, *at)
            };
            outcome
                .reports
                .insert(robot.clone(), (Arc::new(report), commands));
        }
        Ok(outcome)
    }
}

/// Plays a scenario; `before` is called before every tick from 1 on.
fn play(
    scenario: Scenario,
    mut before: impl FnMut(Tick, &mut Simulation),
) -> (Simulation, Vec<TickRecord>) {
    let mut simulation = Simulation::new(scenario, 1).unwrap();
    let mut robots = Robots::of(&simulation);
    let mut records = vec![simulation.init(&mut robots).unwrap()];
    for tick in 1..=TICKS {
        before(tick, &mut simulation);
        records.push(simulation.step(&mut robots).unwrap());
    }
    (simulation, records)
}

/// Plays with interventions before these ticks.
fn play_by_hand(
    scenario: Scenario,
    done: &[(Tick, Intervention)],
) -> (Simulation, Vec<TickRecord>) {
    play(scenario, |tick, simulation| {
        for (_, what) in done.iter().filter(|(at, _)| *at == tick) {
            simulation.intervene(what).unwrap();
        }
    })
}

fn cut(from: &[&str], to: &[&str], one_way: bool) -> Intervention {
    Intervention::Cut {
        from: names(from),
        to: names(to),
        one_way,
    }
}

fn heal(from: &[&str], to: &[&str], one_way: bool) -> Intervention {
    Intervention::Heal {
        from: names(from),
        to: names(to),
        one_way,
    }
}

fn lose() -> Intervention {
    Intervention::Lose {
        from: name("A"),
        to: name("B"),
    }
}

fn delay(by_s: f64) -> Intervention {
    Intervention::Delay {
        from: name("A"),
        to: name("B"),
        by_s,
    }
}

fn duplicate() -> Intervention {
    Intervention::Duplicate {
        from: name("A"),
        to: name("B"),
    }
}

fn set(one: &str) -> Intervention {
    Intervention::Set {
        set: vec![one.to_owned()],
    }
}

fn links(simulation: &Simulation) -> Vec<String> {
    let link = |Cut { from, to, .. }: Cut| format!("{from}{to}");
    simulation.cuts().into_iter().map(link).collect()
}

/// Ticks in which a command of A was lost, and why.
fn lost(records: &[TickRecord]) -> Vec<(Tick, Cause)> {
    let mut lost = Vec::new();
    for record in records {
        for event in record.events.iter() {
            if let Event::CommandDropped { because, .. } = event {
                lost.push((record.tick, *because));
            }
        }
    }
    lost
}

/// The record as if a scenario had said everything.
fn as_scripted(records: &[TickRecord]) -> Vec<String> {
    let lines = records.iter().flat_map(TickRecord::lines);
    let text = |line: protocol::Line| line.to_json().replace(",\"by_hand\":true", "");
    lines.map(text).collect()
}

/// Everything that can be said without processes, one after the other.
fn everything() -> Vec<(Tick, Intervention)> {
    vec![
        (2, cut(&["A"], &["B", "C"], false)),
        (3, heal(&["A"], &["B"], true)),
        (5, lose()),
        (5, lose()),
        (7, heal(&[], &[], false)),
        (8, set("network.commands.loss=1.0")),
        (9, cut(&["C"], &["B"], true)),
        (10, set("network.commands.loss=0.0")),
        (10, delay(0.5)),
        (10, duplicate()),
    ]
}

/// The next command is late or doubled, the one after it if that is so already; a command that is lost is passed over.
#[test]
fn the_next_command_is_delayed_or_doubled() {
    let by_hand = [
        (5, lose()),
        (5, delay(1.0)),
        (5, delay(1.0)),
        (5, duplicate()),
    ];
    let (_, records) = play_by_hand(scenario(""), &by_hand);
    let mut fates = Vec::new();
    for record in &records {
        for event in record.events.iter() {
            match event {
                Event::CommandDelayed { seq, until, .. } => {
                    fates.push((record.tick, "late", *seq, *until));
                }
                Event::CommandDuplicated { seq, .. } => {
                    fates.push((record.tick, "twice", *seq, record.tick));
                }
                Event::CommandDropped { seq, .. } => {
                    fates.push((record.tick, "lost", *seq, record.tick));
                }
                _ => {}
            }
        }
    }
    let seq = fates[0].2;
    assert_eq!(
        fates,
        [
            (5, "lost", seq, 5),
            (6, "late", seq + 1, 8),
            (6, "twice", seq + 1, 6),
            (7, "late", seq + 2, 9),
        ]
    );
}

#[test]
fn links_are_cut_and_healed_one_by_one() {
    let mut seen = BTreeMap::new();
    let (_, records) = play(scenario(""), |tick, simulation| {
        seen.insert(tick - 1, links(simulation));
        for (_, what) in everything().iter().filter(|(at, _)| *at == tick) {
            simulation.intervene(what).unwrap();
        }
    });
    assert!(seen[&1].is_empty());
    assert_eq!(seen[&2], ["AB", "AC", "BA", "CA"]);
    assert_eq!(seen[&3], ["AC", "BA", "CA"]);
    assert_eq!(seen[&6], ["AC", "BA", "CA"]);
    assert!(seen[&7].is_empty());
    assert_eq!(seen[&9], ["CB"]);
    let lost = lost(&records);
    let (partition, scripted, loss) = (Cause::Partition, Cause::Scripted, Cause::Loss);
    assert_eq!(
        lost,
        [
            (2, partition),
            (5, scripted),
            (6, scripted),
            (8, loss),
            (9, loss)
        ]
    );
}

#[test]
fn a_run_by_hand_can_be_told_as_a_scenario() {
    let (by_hand, records) = play_by_hand(scenario(""), &everything());
    let told = by_hand.scenario().to_toml().unwrap();
    let (_, again) = play(common::scenario(&told), |_, _| ());
    assert_eq!(as_scripted(&records), as_scripted(&again), "{told}");
    assert!(told.contains("[[change]]"), "{told}");

    // The next run begins as this one did.
    assert_eq!(
        by_hand.planned().to_toml().unwrap(),
        scenario("").to_toml().unwrap()
    );
}

#[test]
fn what_the_record_says_was_done_gives_the_same_record() {
    let (_, records) = play_by_hand(scenario(""), &everything());
    let (_, again) = play(scenario(""), |tick, simulation| {
        let mut changes = Vec::new();
        for event in records[tick as usize].events.iter() {
            if let Event::Changed { set, by_hand: true } = event {
                changes.push(set.clone());
            }
        }
        simulation.repeat_changes(&changes).unwrap();
    });
    let lines = |records: &[TickRecord]| -> Vec<String> {
        let lines = records.iter().flat_map(TickRecord::lines);
        lines.map(|line| line.to_json()).collect()
    };
    assert_eq!(lines(&records), lines(&again));
    assert!(lines(&records).iter().any(|line| line.contains("by_hand")));
}

#[test]
fn what_the_scenario_changes_later_leaves_cut_what_was_cut_by_hand() {
    let change = "[[change]]\nat = \"3 s\"\nset = [\"network.commands.loss=0.5\"]\n";
    let (simulation, _) = play_by_hand(scenario(change), &[(2, cut(&["A"], &["B"], false))]);
    assert_eq!(links(&simulation), ["AB", "BA"]);
    let network = simulation.scenario().network_at(TICKS);
    assert!((network.commands.loss - 0.5).abs() < f64::EPSILON);
}

#[test]
fn a_scripted_partition_is_healed_by_hand_and_another_one_still_comes() {
    let network = "[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"1 s\"\nuntil = \"3 s\"\n\
                   [[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"5 s\"\n";
    let mut seen = BTreeMap::new();
    play(scenario(network), |tick, simulation| {
        seen.insert(tick - 1, links(simulation).len());
        if tick == 4 {
            simulation.intervene(&heal(&["A"], &["B"], false)).unwrap();
        }
    });
    assert_eq!((seen[&3], seen[&4], seen[&9], seen[&10]), (2, 0, 0, 2));
}

#[test]
fn what_is_undone_before_its_tick_has_no_effect() {
    let (_, records) = play_by_hand(
        scenario("on_late = \"continue\"\n"),
        &[
            (2, cut(&["A"], &["B"], false)),
            (2, heal(&["A"], &["B"], false)),
            (3, fault(FaultKind::Hang, None)),
            (3, Intervention::Recover { robot: name("B") }),
        ],
    );
    let happened = records.iter().flat_map(|record| record.events.iter());
    assert!(
        !happened
            .clone()
            .any(|event| matches!(event, Event::LinkCut { .. } | Event::Fault { .. }))
    );
    assert!(lost(&records).is_empty());
}

fn fault(kind: FaultKind, for_s: Option<f64>) -> Intervention {
    Intervention::Fault {
        robot: name("B"),
        kind,
        for_s,
    }
}

#[test]
fn faults_are_ordered_for_the_next_tick_and_end_when_a_person_says_so() {
    let mut simulation = Simulation::new(scenario("on_late = \"continue\"\n"), 1).unwrap();
    let mut robots = Robots::of(&simulation);
    simulation.init(&mut robots).unwrap();
    simulation.intervene(&fault(FaultKind::Hang, None)).unwrap();
    let due = simulation.faults_due();
    assert_eq!(due.len(), 1);
    assert!(due[0].begins && due[0].for_s.is_none());
    simulation.step(&mut robots).unwrap();
    assert_eq!(simulation.held_processes(&[]).len(), 1);
    let again = simulation.intervene(&fault(FaultKind::Crash, None));
    assert!(again.unwrap_err().contains("B is stopped already"));

    // A rule that holds from now on changes nothing about a fault before.
    simulation
        .change_by_hand(&[Scenario::words_of_lateness(None, OnLate::Wait).unwrap()])
        .unwrap();
    simulation
        .intervene(&Intervention::Recover { robot: name("B") })
        .unwrap();
    let due = simulation.faults_due();
    assert_eq!(due.len(), 1);
    assert!(!due[0].begins);
    simulation.step(&mut robots).unwrap();
    assert!(simulation.held_processes(&[]).is_empty());
    let again = simulation.intervene(&Intervention::Recover { robot: name("B") });
    assert_eq!(again.unwrap_err(), "no fault holds B");

    // Where the clock waits for the robot, only the wall clock can end its fault.
    assert_eq!(simulation.held_by_wall_clock(&name("B")), None);
    simulation
        .intervene(&fault(FaultKind::Crash, None))
        .unwrap();
    assert_eq!(simulation.faults_due()[0].for_s, Some(3600.0));

    // It may report once more before it is killed: it is held in whatever tick waits for it.
    simulation.step(&mut robots).unwrap();
    simulation.step(&mut robots).unwrap();
    assert!(simulation.held_processes(&[]).is_empty());
    let held = simulation.held_processes(&[name("B"), name("C")]);
    assert_eq!(held.len(), 1);
    assert_eq!(held[0].kind, FaultKind::Crash);
}

/// The process of a robot may be held longer than the scenario says: the clock has gone on without it.
#[test]
fn a_fault_for_a_time_is_ended_before_its_time() {
    let mut simulation = Simulation::new(scenario(""), 1).unwrap();
    let mut robots = Robots::of(&simulation);
    simulation.init(&mut robots).unwrap();
    let robot = name("B");
    let none = simulation.end_fault_for_a_time(&robot);
    assert_eq!(none.unwrap_err(), "no fault holds B");
    simulation
        .intervene(&fault(FaultKind::Crash, None))
        .unwrap();
    simulation.step(&mut robots).unwrap();
    simulation.step(&mut robots).unwrap();

    simulation.end_fault_for_a_time(&robot).unwrap();
    let due = simulation.faults_due();
    assert!(due.len() == 1 && !due[0].begins && due[0].robot == robot);
    let twice = simulation.end_fault_for_a_time(&robot);
    assert_eq!(twice.unwrap_err(), "no fault holds B");
    simulation.step(&mut robots).unwrap();
    assert!(simulation.faults_due().is_empty());
}

#[test]
fn a_restart_is_over_at_once() {
    let mut simulation = Simulation::new(scenario(""), 1).unwrap();
    let mut robots = Robots::of(&simulation);
    simulation.init(&mut robots).unwrap();
    simulation
        .intervene(&fault(FaultKind::Restart, None))
        .unwrap();
    assert!(simulation.faults_due().is_empty());
    assert_eq!(
        simulation.restarts_due().into_iter().collect::<Vec<_>>(),
        [name("B")]
    );
    simulation.step(&mut robots).unwrap();
    assert!(simulation.restarts_due().is_empty());
    assert!(simulation.held_processes(&[]).is_empty());
    let with_end = simulation.intervene(&fault(FaultKind::Restart, Some(1.0)));
    assert!(with_end.unwrap_err().contains("a restart is over at once"));
}

#[test]
fn what_cannot_be_done_changes_nothing_and_says_why() {
    let mut simulation = Simulation::new(scenario(""), 1).unwrap();
    let before = simulation.scenario().to_toml().unwrap();
    for (what, why) in [
        (cut(&["A"], &["Zoe"], false), "called Zoe"),
        (cut(&["A"], &["A"], false), "cut already"),
        (cut(&["A", "B"], &["B"], false), "B is in two groups"),
        (
            heal(&["A"], &["B"], false),
            "no link between these robots is cut",
        ),
        (heal(&["Zoe"], &[], false), "called Zoe"),
        (
            fault(FaultKind::Hang, Some(-1.0)),
            "`for` is more than zero",
        ),
        (fault(FaultKind::Hang, Some(1e9)), "at most an hour"),
        (
            Intervention::Recover { robot: name("A") },
            "no fault holds A",
        ),
        (set("guests.count=5"), "can change while a run goes on"),
        (set("seed=5"), "can change while a run goes on"),
        (set("change=[]"), "a change of a change"),
        (set("network.commands.loss=2"), "loss is a probability"),
        (set("network"), "is not of the form path=value"),
        (Intervention::Set { set: vec![] }, "nothing is to be set"),
        (
            set("network.lose=[{from=\"A\",to=\"B\",number=1,text=\"x\"}]"),
            "leave `text` out",
        ),
        (delay(0.0), "by 1 to 1000 ticks"),
        (delay(-1.0), "by 1 to 1000 ticks"),
        (delay(501.0), "by 1 to 1000 ticks"),
        (
            Intervention::Lose {
                from: name("A"),
                to: name("Zoe"),
            },
            "called Zoe",
        ),
    ] {
        let reason = simulation.intervene(&what).unwrap_err();
        assert!(reason.contains(why), "{what:?}: {reason}");
        assert_eq!(simulation.scenario().to_toml().unwrap(), before);
    }
}

#[test]
fn there_is_a_bound_on_what_is_done() {
    let scenario = scenario("");
    let mut changed = scenario;
    let one = |tick: Tick| format!("network.commands.loss={}", (tick % 10) as f64 / 10.0);
    for tick in 1..=1000 {
        let set = [one(tick).parse().unwrap()];
        changed = changed.with_change_by_hand(tick, &set).unwrap();
    }
    let set = [one(1).parse().unwrap()];
    let refused = changed.with_change_by_hand(1001, &set).unwrap_err();
    assert!(
        refused.reason().contains("more than 1000 changes"),
        "{refused}"
    );
}
