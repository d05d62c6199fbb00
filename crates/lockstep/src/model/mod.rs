//! The checker explores [`Barrier`](crate::Barrier) and [`Participant`](crate::Participant) themselves: two robots in a
//! simulated star, a few ticks, and everything that may go wrong within a [`star::Budget`], in every order.

mod liveness;
mod process;
mod simulation;
mod star;

use std::time::Instant;

use protocol::messages::{FaultKind, OnLate};
use protocol::RobotName;
use stateright::{Checker, HasDiscoveries, Model};

use crate::rules::Rule;
use simulation::Ordered;
use star::{Budget, Star};

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap_or_else(|error| unreachable!("{error}"))
}

const NOTHING: Budget = Budget {
    losses: 0,
    duplicates: 0,
    cuts: 0,
    blips: 0,
    lapses: 0,
    crashes: 0,
    successors: 0,
    rivals: 0,
    early: 0,
    inits: 0,
};

/// What goes wrong together; all of it at once would be too much to explore.
fn worlds() -> Vec<Star> {
    let calm = Star {
        title: "nothing goes wrong",
        last_tick: 3,
        on_late: OnLate::Wait,
        lose_after: 2,
        is_slow: true,
        scenario: None,
        budget: NOTHING,
        rules: star::without(None),
    };
    let hang = Ordered {
        kind: FaultKind::Hang,
        from: 1,
        until: 2,
    };
    let crash = Ordered {
        kind: FaultKind::Crash,
        ..hang
    };
    let long = Ordered { until: 3, ..hang };

    vec![
        calm.clone(),
        Star {
            title: "losses",
            last_tick: 2,
            is_slow: false,
            budget: Budget { losses: 2, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "duplicates and early timers",
            last_tick: 2,
            is_slow: false,
            budget: Budget { losses: 1, duplicates: 1, early: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "a process dies and another one comes",
            last_tick: 2,
            is_slow: false,
            budget: Budget { crashes: 1, losses: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "a link is cut",
            last_tick: 2,
            is_slow: false,
            budget: Budget { cuts: 1, blips: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "another process while the first one is cut off",
            last_tick: 2,
            is_slow: false,
            budget: Budget { cuts: 1, successors: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "another process while the first one is connected",
            last_tick: 1,
            is_slow: false,
            budget: Budget { rivals: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "a new epoch",
            last_tick: 1,
            is_slow: true,
            budget: Budget { inits: 1, duplicates: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "a new epoch while a link is cut",
            last_tick: 1,
            is_slow: false,
            budget: Budget { inits: 1, cuts: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on",
            last_tick: 3,
            is_slow: true,
            on_late: OnLate::Continue,
            budget: Budget { early: 1, duplicates: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on, losses",
            last_tick: 3,
            is_slow: false,
            on_late: OnLate::Continue,
            budget: Budget { early: 1, losses: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on without a robot that is cut off",
            last_tick: 3,
            is_slow: false,
            on_late: OnLate::Continue,
            budget: Budget { cuts: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on, a hang",
            last_tick: 3,
            is_slow: false,
            on_late: OnLate::Continue,
            scenario: Some(hang),
            budget: Budget { cuts: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on, a long hang",
            last_tick: 4,
            is_slow: false,
            on_late: OnLate::Continue,
            scenario: Some(long),
            budget: Budget { cuts: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the clock goes on, a crash",
            last_tick: 3,
            is_slow: false,
            on_late: OnLate::Continue,
            scenario: Some(crash),
            budget: NOTHING,
            ..calm.clone()
        },
        Star {
            title: "the clock goes on, a hang during which the link dies",
            last_tick: 4,
            is_slow: false,
            on_late: OnLate::Continue,
            scenario: Some(long),
            budget: Budget { lapses: 1, early: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "a new epoch while another process takes the place",
            last_tick: 1,
            is_slow: false,
            budget: Budget { inits: 1, cuts: 1, successors: 1, ..NOTHING },
            ..calm.clone()
        },
        Star {
            title: "the run is aborted",
            last_tick: 2,
            is_slow: false,
            on_late: OnLate::Abort,
            budget: Budget { early: 1, losses: 1, ..NOTHING },
            ..calm
        },
    ]
}

/// What goes wrong, in words, and the steps that lead there; `None` if nothing does.
struct Counterexample {
    what: String,
    steps: Vec<String>,
}

fn unsafe_steps(star: &Star) -> (Option<Counterexample>, usize) {
    let checker = star
        .clone()
        .checker()
        .threads(2)
        .finish_when(HasDiscoveries::AnyFailures)
        .spawn_bfs()
        .join();
    let states = checker.unique_state_count();
    let found = checker.discovery(star::SAFE).map(|path| Counterexample {
        what: format!("{:?}", path.last_state().violation),
        steps: path
            .into_actions()
            .iter()
            .map(|step| format!("{step:?}"))
            .collect(),
    });
    (found, states)
}

fn stuck_steps(star: &Star) -> (Option<Counterexample>, usize) {
    let (stuck, states) = liveness::stuck(star);
    let found = stuck.map(|stuck| Counterexample {
        what: stuck.what.to_owned(),
        steps: stuck
            .steps
            .iter()
            .map(|step| format!("{step:?}"))
            .collect(),
    });
    (found, states)
}

#[test]
fn survey() {
    let only = std::env::var("WORLD").ok();
    for (number, star) in worlds().into_iter().enumerate() {
        if only.as_ref().is_some_and(|only| *only != number.to_string()) {
            continue;
        }
        let begun = Instant::now();
        let (bad, states) = unsafe_steps(&star);
        println!("{number} {}: {states} states, {:.1} s", star.title, begun.elapsed().as_secs_f64());
        if let Some(bad) = bad {
            println!("  {}\n    {}", bad.what, bad.steps.join("\n    "));
            continue;
        }
        let (bad, states) = stuck_steps(&star);
        println!("    {states} states, {:.1} s", begun.elapsed().as_secs_f64());
        if let Some(bad) = bad {
            println!("  {}\n    {}", bad.what, bad.steps.join("\n    "));
        }
    }
}

#[test]
fn survey_of_rules() {
    let only = std::env::var("RULE").ok();
    for rule in RULES {
        if only.as_ref().is_some_and(|only| *only != format!("{rule:?}")) {
            continue;
        }
        let mut found = Vec::new();
        for (number, mut star) in worlds().into_iter().enumerate() {
            if star.budget.inits > 0 && star.budget.successors > 0 && rule != Rule::EndsWhenTaken {
                continue;
            }
            star.rules = star::without(Some(rule));
            let bad = unsafe_steps(&star).0.or_else(|| stuck_steps(&star).0);
            if let Some(bad) = bad {
                found.push(format!("{number}: {} ({})", bad.what, bad.steps.len()));
                if only.is_some() {
                    println!("{}", bad.steps.join("\n"));
                } else if found.len() == 2 {
                    break;
                }
            }
        }
        println!("{rule:?}: {found:?}");
    }
}

const RULES: [Rule; 28] = [
    Rule::WaitsForAll,
    Rule::ChecksEpoch,
    Rule::ChecksTick,
    Rule::ChecksGeneration,
    Rule::CountsCommands,
    Rule::DropsPredecessor,
    Rule::RepeatsClock,
    Rule::RepeatsNews,
    Rule::FlagsNews,
    Rule::TakesInWhileOpen,
    Rule::NamesUntilReported,
    Rule::NamesReplacement,
    Rule::CountsGenerations,
    Rule::RefusesTakenName,
    Rule::TakesBack,
    Rule::GivesUpForGood,
    Rule::WaitsForNews,
    Rule::MatchesNews,
    Rule::AnswersOnce,
    Rule::RepeatsReport,
    Rule::RepeatsCommands,
    Rule::IgnoresLate,
    Rule::JoinsNewEpoch,
    Rule::WaitsToBeNamed,
    Rule::EndsWhenReplaced,
    Rule::EndsWhenTaken,
    Rule::TokenAfterWelcome,
    Rule::RunsNewest,
];
