//! What emotions do to the team, over many seeds: every behavior that an emotion begins ends, robots notice what stops
//! them, and the paper's transitions occur. What emotions are worth is an experiment, not a test: `docs/experiments.md`.

use std::collections::{BTreeMap, BTreeSet};

use experiments::{Arm, Experiment};
use protocol::Event;
use serde_json::Value;
use system_tests::hall::scenario;

use crate::paper::{Change, FT_M, HALL, SEEDS, mean, walled_in, watch};

const WITHOUT_EMOTIONS: [&str; 2] = [
    "robot.Butler.params.affect=off",
    "robot.Leguin.params.affect=off",
];

/// Numbers of treats that were served, one for each seed.
fn served(set: &[&str]) -> Vec<f64> {
    watch(HALL, set, |served: &mut f64, change| {
        *served = change.hall.number("Butler", "served");
    })
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn behind_a_wall_no_team_serves_less_with_emotions_than_without() {
    let wall = walled_in();
    let hall = [wall.as_str(), "guests.count=0"];

    let with = served(&hall);
    let without = served(&[&hall[..], &WITHOUT_EMOTIONS].concat());

    println!(
        "behind a wall: {:.1} served with emotions, {:.1} without",
        mean(&with),
        mean(&without)
    );
    for (seed, (with, without)) in with.iter().zip(&without).enumerate() {
        assert!(with >= without, "seed {}: {with} < {without}", seed + 1);
        assert_eq!(*without, 30.0, "a tray is all there is");
    }
}

/// A note on the INTERCEPT that is under way.
#[derive(Default)]
struct Chase {
    /// How long it has lasted, seconds.
    lasting_s: f64,
    longest_s: f64,
    begun: u32,
    /// How many ticks of it Butler was not FRUSTRATED.
    calm_ticks: u32,
}

fn follow_chase(chase: &mut Chase, change: &Change<'_>) {
    if change.butler.1 != "INTERCEPT" {
        chase.lasting_s = 0.0;
        return;
    }

    if change.butler.0 != "INTERCEPT" {
        chase.begun += 1;
        assert!(
            !matches!(change.leguin.0, "AWAIT_GO_HOME" | "GO_HOME"),
            "seed {}: Leguin goes home and cannot exchange",
            change.seed
        );
    }
    chase.lasting_s += change.hall.simulation.scenario().tick_s;
    chase.longest_s = chase.longest_s.max(chase.lasting_s);
    chase.calm_ticks += u32::from(change.hall.emotion("Butler") != "FRUSTRATED");
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn an_intercept_begins_only_toward_a_refiller_who_can_exchange_and_ends_with_the_emotion() {
    let wall = walled_in();

    for set in [
        vec![],
        vec![wall.as_str(), "guests.count=0"],
        vec!["guests.count=200"],
    ] {
        let chases = watch(HALL, &set, follow_chase);
        let begun: u32 = chases.iter().map(|chase| chase.begun).sum();
        let calm_ticks: u32 = chases.iter().map(|chase| chase.calm_ticks).sum();
        let longest_s = chases.iter().map(|chase| chase.longest_s);
        let longest_s = longest_s.fold(0.0, f64::max);

        println!("{set:?}: {begun} intercepts, the longest {longest_s} s, {calm_ticks} ticks calm");
        assert!(begun > 0);
        assert_eq!(
            calm_ticks, 0,
            "it ends in the tick in which FRUSTRATED does"
        );
        // The longest way across the field at his speed, and his patience where he comes no nearer.
        assert!(longest_s < 90.0, "{longest_s} s");
    }
}

/// Time until Leguin goes home FRUSTRATED, behind a wall, seconds, for each seed.
fn patience_s(caution: &str) -> Vec<f64> {
    let wall = walled_in();
    let caution = format!("robot.Leguin.params.caution={caution}");
    let set = [wall.as_str(), "guests.count=0", caution.as_str()];

    let gave_up = watch(HALL, &set, |(begun_s, took_s): &mut (f64, f64), change| {
        let now_s = change.hall.time_s();
        if change.leguin == ("WAIT", "REFILL") {
            *begun_s = now_s;
        }
        if change.leguin == ("REFILL", "GO_HOME") && *took_s == 0.0 {
            assert_eq!(change.hall.emotion("Leguin"), "FRUSTRATED");
            *took_s = now_s - *begun_s;
        }
    });
    gave_up.into_iter().map(|(_, took_s)| took_s).collect()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn leguin_notices_that_she_is_walled_in_and_the_sooner_the_more_cautious_she_is() {
    let [careless, normal, cautious] = ["0.0", "0.5", "1.0"].map(patience_s);
    println!(
        "walled in, she goes home after {:.1}, {:.1}, {:.1} s with caution 0, 0.5, 1",
        mean(&careless),
        mean(&normal),
        mean(&cautious)
    );

    // A more cautious one is faster, too, and so may find the way along the wall that ends her patience later: in few seeds.
    let seeds = careless.len();
    let mut in_order = 0;
    for seed in 0..seeds {
        assert!(cautious[seed] > 0.0, "seed {}: never", seed + 1);
        in_order += usize::from(cautious[seed] < normal[seed] && normal[seed] < careless[seed]);
    }
    println!("in this order in {in_order} of {seeds} seeds");
    assert!(mean(&cautious) < mean(&normal) && mean(&normal) < mean(&careless));
    assert!(10 * in_order >= 9 * seeds);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_more_cautious_leguin_hurries_more() {
    let speeds_mps = ["0.0", "0.5", "1.0"].map(|caution| {
        let caution = format!("robot.Leguin.params.caution={caution}");
        let set = ["guests.count=0", caution.as_str()];
        let sums = watch(HALL, &set, |(sum_mps, ticks): &mut (f64, u32), change| {
            let hall = change.hall;
            let speed_mps = hall.speed_mps("Leguin");
            let hurries = hall.flag("Leguin", "hurried") && change.leguin == ("REFILL", "REFILL");
            if hurries && speed_mps > 0.0 {
                *sum_mps += speed_mps;
                *ticks += 1;
            }
        });
        let sum_mps: f64 = sums.iter().map(|(sum_mps, _)| sum_mps).sum();
        let ticks: u32 = sums.iter().map(|(_, ticks)| ticks).sum();
        sum_mps / f64::from(ticks)
    });
    println!("asked to hurry, she drives at {speeds_mps:.3?} m/s with caution 0, 0.5, 1");

    let [careless, normal, cautious] = speeds_mps;
    assert!(careless < 0.9 * normal);
    assert!(normal <= cautious && cautious <= 4.5 * FT_M);
}

#[test]
fn the_transitions_of_the_paper_occur() {
    type Counts = BTreeMap<(String, String), u32>;
    let notes = watch(
        HALL,
        &[],
        |counts: &mut BTreeMap<String, Counts>, change| {
            for event in change.events {
                if let Event::Emotion {
                    robot,
                    from: Some(from),
                    to,
                } = event
                {
                    let counts = counts.entry(robot.to_string()).or_default();
                    *counts.entry((from.clone(), to.clone())).or_default() += 1;
                }
            }
        },
    );
    let mut totals: BTreeMap<String, Counts> = BTreeMap::new();
    for (robot, counts) in notes.into_iter().flatten() {
        for (change, count) in counts {
            *totals
                .entry(robot.clone())
                .or_default()
                .entry(change)
                .or_default() += count;
        }
    }

    for (robot, counts) in &totals {
        for ((from, to), count) in counts {
            let per_run = f64::from(*count) / SEEDS as f64;
            println!("{robot}: {from} to {to} {per_run:.2} times a run");
        }
    }
    for (robot, from, to) in [
        ("Butler", "HAPPY", "CONFIDENT"),
        ("Butler", "CONFIDENT", "CONCERNED"),
        ("Butler", "CONCERNED", "FRUSTRATED"),
        ("Butler", "FRUSTRATED", "CONCERNED"),
        ("Butler", "FRUSTRATED", "HAPPY"),
        ("Butler", "CONCERNED", "HAPPY"),
        ("Leguin", "CONFIDENT", "CONCERNED"),
        ("Leguin", "CONCERNED", "FRUSTRATED"),
    ] {
        let change = (from.to_owned(), to.to_owned());
        let count = totals[robot].get(&change).copied().unwrap_or(0);
        assert!(count > 0, "{robot}: {from} to {to} never occurs");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_timer_repeats_nothing_when_nothing_is_lost() {
    let messages = |resend: &str| {
        let set = [&WITHOUT_EMOTIONS[..], &[resend]].concat();
        watch(HALL, &set, |messages: &mut f64, change| {
            *messages = change.hall.number("Butler", "messages");
        })
    };

    assert_eq!(
        messages("robot.Butler.params.resend=on"),
        messages("robot.Butler.params.resend=off")
    );
}

/// The teams that differ in nothing but what decides about their actions.
const COMPARED: [&str; 4] = ["emotions", "rules", "timer", "yoked"];

/// The changes that the arm of a shipped experiment makes.
fn changes_of(arm: &Arm) -> Vec<String> {
    let changes = arm.set.iter().map(|setting| setting.change.to_string());
    changes.collect()
}

/// Constants of what decides, which are tuned for each team (docs/experiments.md, "Constants").
const TUNED: [&str; 4] = [
    "/dynamics/th_concerned",
    "/dynamics/th_frustrated",
    "/hurry_after_s",
    "/intercept_after_s",
];

/// The parameters of all robots of a team, but for the one that names what decides, and its constants.
fn abilities(arm: &Arm) -> Vec<Value> {
    let changes = changes_of(arm);
    let changes: Vec<&str> = changes.iter().map(String::as_str).collect();
    let scenario = scenario(HALL, 1, &changes);

    let mut abilities = Vec::new();
    for spec in scenario.robots.values() {
        let mut parameters = spec.parameters.clone();
        assert!(
            parameters.remove("policy").is_some(),
            "an arm names the policy"
        );
        let mut parameters = serde_json::to_value(&parameters).unwrap();
        for path in TUNED {
            let (parent, name) = path.rsplit_once('/').unwrap();
            if let Some(parent) = parameters
                .pointer_mut(parent)
                .and_then(Value::as_object_mut)
            {
                parent.remove(name);
            }
        }
        abilities.push(parameters);
    }
    abilities
}

#[test]
fn the_compared_teams_have_the_same_abilities_in_every_shipped_experiment() {
    for name in ["affect", "deadlock", "partition"] {
        let experiment = Experiment::find(name.as_ref()).expect("a good file");
        let arms = experiment.arms.iter();
        let compared: Vec<&Arm> = arms
            .filter(|arm| COMPARED.contains(&arm.name.as_str()))
            .collect();
        assert_eq!(compared.len(), COMPARED.len(), "{name}");

        let baseline = abilities(compared[0]);
        for arm in &compared[1..] {
            assert_eq!(abilities(arm), baseline, "{name}: {}", arm.name);
        }
    }
}

/// Actions that help against a failure, and how often each message was sent since the last exchange.
#[derive(Default)]
struct Actions {
    seen: BTreeSet<&'static str>,
    sent: BTreeMap<String, u32>,
}

fn note_actions(actions: &mut Actions, change: &Change<'_>) {
    for event in change.events {
        if let Event::CommandSent { command, .. } = event {
            *actions.sent.entry(command.clone()).or_default() += 1;
        }
    }
    if change.butler.1 == "EXCHANGE" {
        actions.sent.clear();
    }

    if actions.sent.contains_key("hurry") {
        actions.seen.insert("asks to hurry");
    }
    if actions.sent.values().any(|count| *count > 1) {
        actions.seen.insert("repeats a message");
    }
    if change.butler.1 == "INTERCEPT" {
        actions.seen.insert("intercepts");
    }
    if change.leguin == ("REFILL", "GO_HOME") {
        actions.seen.insert("gives up");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_compared_team_uses_all_of_its_abilities_and_the_team_with_neither_none() {
    let experiment = Experiment::find("affect".as_ref()).expect("a good file");
    let all = BTreeSet::from([
        "asks to hurry",
        "gives up",
        "intercepts",
        "repeats a message",
    ]);
    let wall = walled_in();

    for arm in &experiment.arms {
        let expected = match arm.name.as_str() {
            "emotions" | "rules" | "timer" => all.clone(),
            "neither" => BTreeSet::new(),
            _ => continue,
        };
        let changes = changes_of(arm);
        let mut actions = BTreeSet::new();
        for failure in [
            vec!["network.commands={ loss = 0.5 }"],
            vec![wall.as_str(), "guests.count=0"],
        ] {
            let changes = changes.iter().map(String::as_str);
            let set: Vec<&str> = changes.chain(failure).collect();
            for team in watch(HALL, &set, note_actions) {
                actions.extend(team.seen);
            }
        }

        assert_eq!(actions, expected, "{}", arm.name);
    }
}
