//! The checker explores [`Barrier`](crate::Barrier) and [`Participant`](crate::Participant) themselves: two robots in a
//! simulated star, a few ticks, and everything that may go wrong within a [`star::Budget`], in every order.
//!
//! | Part | Stands for |
//! | --- | --- |
//! | `star` | the network, the timers, and the loop of the simulator's server |
//! | `process` | a robot's process: its host and its link |
//! | `simulation` | what decides who has news, and knows what each robot must report |
//!
//! Robot A sends one command in tick 0, two in tick 1, none in tick 2, and so on; B gets them as news in the tick after. A
//! link is first in, first out in both directions. Tokens of one name are one to the simulator. When a link is cut, all that
//! is on it is lost; when it is back, the token is declared again. Losses of single messages and duplicates are more than
//! TCP ever does. Timers that repeat something fire when nothing is under way, or early within the budget.
//!
//! [`star::SAFE`] is checked by stateright: no [`simulation::Violation`] is reachable. That the end, and an end with all
//! robots and without replaced processes, stays within reach by steps that happen when nothing goes wrong any more is checked
//! by a search backwards ([`liveness`]). That the checker sees anything at all is shown by breaking each rule of the code.
//!
//! Left out: queries between robots (a robot that waits for an answer is a robot that is slow), announcements to people, and
//! the timeouts of a robot with a simulator that is gone.

mod liveness;
mod process;
mod simulation;
mod star;

use std::time::Instant;

use protocol::RobotName;
use protocol::messages::{FaultKind, OnLate};
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
    strays: 0,
};

/// What goes wrong together; all of it at once would be too much to explore.
#[derive(Debug, Clone, Copy)]
enum World {
    Calm,
    Losses,
    Echoes,
    Crash,
    Cuts,
    Successor,
    Rival,
    Stray,
    Init,
    InitTwice,
    InitWhileCut,
    InitWithSuccessor,
    GoesOn,
    GoesOnSlowly,
    GoesOnWithoutB,
    GoesOnWhileCut,
    GoesOnAfterInit,
    Hang,
    ShortHang,
    HangOfSuccessor,
    HangWhileLinkDies,
    ScenarioCrash,
    Aborts,
}

const WORLDS: [World; 23] = [
    World::Calm,
    World::Losses,
    World::Echoes,
    World::Crash,
    World::Cuts,
    World::Successor,
    World::Rival,
    World::Stray,
    World::Init,
    World::InitTwice,
    World::InitWhileCut,
    World::InitWithSuccessor,
    World::GoesOn,
    World::GoesOnSlowly,
    World::GoesOnWithoutB,
    World::GoesOnWhileCut,
    World::GoesOnAfterInit,
    World::Hang,
    World::ShortHang,
    World::HangOfSuccessor,
    World::HangWhileLinkDies,
    World::ScenarioCrash,
    World::Aborts,
];

impl World {
    /// The bounds: the last tick, and how often what may happen.
    fn star(self, broken: Option<Rule>) -> Star {
        let waits = Star {
            last_tick: 2,
            on_late: OnLate::Wait,
            lose_after: 2,
            is_slow: false,
            scenario: None,
            victim: None,
            waits_for: None,
            is_gathered: false,
            budget: NOTHING,
            rules: star::without(broken),
        };
        let goes_on = Star {
            last_tick: 3,
            on_late: OnLate::Continue,
            ..waits.clone()
        };
        let hang = Ordered {
            kind: FaultKind::Hang,
            from: 1,
            until: 3,
        };

        match self {
            Self::Calm => Star {
                is_slow: true,
                last_tick: 3,
                ..waits
            },
            Self::Losses => waits.with(Budget {
                losses: 2,
                ..NOTHING
            }),
            Self::Echoes => waits.with(Budget {
                losses: 1,
                duplicates: 1,
                early: 1,
                ..NOTHING
            }),
            Self::Crash => waits.with(Budget {
                crashes: 1,
                losses: 1,
                ..NOTHING
            }),
            Self::Cuts => waits.with(Budget {
                cuts: 1,
                blips: 1,
                ..NOTHING
            }),
            Self::Successor => waits.with(Budget {
                cuts: 1,
                successors: 1,
                ..NOTHING
            }),
            Self::Rival => Star {
                last_tick: 1,
                ..waits.with(Budget {
                    rivals: 1,
                    ..NOTHING
                })
            },
            Self::Stray => Star {
                is_slow: true,
                last_tick: 1,
                ..waits.with(Budget {
                    strays: 2,
                    inits: 1,
                    ..NOTHING
                })
            },
            Self::Init => Star {
                is_slow: true,
                last_tick: 1,
                ..waits.with(Budget {
                    inits: 1,
                    duplicates: 1,
                    ..NOTHING
                })
            },
            Self::InitTwice => Star {
                last_tick: 0,
                victim: Some("B"),
                is_gathered: true,
                ..waits.with(Budget {
                    inits: 2,
                    cuts: 1,
                    duplicates: 2,
                    ..NOTHING
                })
            },
            Self::InitWhileCut => Star {
                last_tick: 1,
                ..waits.with(Budget {
                    inits: 2,
                    cuts: 1,
                    ..NOTHING
                })
            },
            Self::InitWithSuccessor => Star {
                last_tick: 1,
                victim: Some("A"),
                is_gathered: true,
                ..waits.with(Budget {
                    inits: 1,
                    cuts: 1,
                    successors: 1,
                    ..NOTHING
                })
            },
            Self::GoesOn => goes_on.with(Budget {
                early: 1,
                losses: 1,
                ..NOTHING
            }),
            Self::GoesOnSlowly => Star {
                is_slow: true,
                lose_after: 3,
                ..goes_on.with(Budget {
                    early: 2,
                    duplicates: 1,
                    ..NOTHING
                })
            },
            Self::GoesOnWithoutB => Star {
                waits_for: Some("A"),
                ..goes_on.with(Budget {
                    early: 1,
                    ..NOTHING
                })
            },
            Self::GoesOnWhileCut => goes_on.with(Budget { cuts: 2, ..NOTHING }),
            Self::GoesOnAfterInit => Star {
                last_tick: 2,
                ..goes_on.with(Budget {
                    inits: 1,
                    cuts: 1,
                    ..NOTHING
                })
            },
            Self::Hang => Star {
                last_tick: 4,
                scenario: Some(hang),
                ..goes_on.with(Budget { cuts: 1, ..NOTHING })
            },
            Self::ShortHang => Star {
                is_slow: true,
                last_tick: 3,
                lose_after: 3,
                scenario: Some(Ordered { until: 2, ..hang }),
                ..goes_on
            },
            Self::HangOfSuccessor => Star {
                last_tick: 3,
                victim: Some("B"),
                is_gathered: true,
                scenario: Some(Ordered { until: 2, ..hang }),
                ..goes_on.with(Budget {
                    cuts: 1,
                    successors: 1,
                    ..NOTHING
                })
            },
            Self::HangWhileLinkDies => Star {
                last_tick: 4,
                lose_after: 3,
                scenario: Some(hang),
                ..goes_on.with(Budget {
                    lapses: 1,
                    ..NOTHING
                })
            },
            Self::ScenarioCrash => Star {
                last_tick: 4,
                scenario: Some(Ordered {
                    kind: FaultKind::Crash,
                    ..hang
                }),
                ..goes_on.with(Budget {
                    early: 1,
                    ..NOTHING
                })
            },
            Self::Aborts => Star {
                on_late: OnLate::Abort,
                ..waits.with(Budget {
                    early: 1,
                    losses: 1,
                    ..NOTHING
                })
            },
        }
    }
}

/// What goes wrong, and the steps that lead there.
struct Counterexample {
    what: String,
    steps: Vec<String>,
}

/// The shortest way to something that must never happen, and how many states were seen.
fn violation(star: &Star) -> (Option<Counterexample>, usize) {
    let checker = star
        .clone()
        .checker()
        .finish_when(HasDiscoveries::AnyFailures)
        .spawn_bfs()
        .join();
    let found = checker.discovery(star::SAFE).map(|path| {
        let violation = path.last_state().violation;
        let steps = path.into_actions();
        Counterexample {
            what: violation.map_or_else(String::new, |violation| format!("{violation:?}")),
            steps: steps.iter().map(|step| format!("{step:?}")).collect(),
        }
    });
    let ends = checker.discovery(star::ENDS).is_some();
    let is_broken = star.rules.broken.is_some();
    assert!(ends || is_broken || found.is_some(), "the run never ends");

    (found, checker.unique_state_count())
}

/// The shortest way to a state from which something that must come is out of reach.
fn stuck(star: &Star) -> Option<Counterexample> {
    liveness::stuck(star).map(|stuck| Counterexample {
        what: stuck.what.to_owned(),
        steps: stuck.steps.iter().map(|step| format!("{step:?}")).collect(),
    })
}

#[test]
fn every_rule_holds_in_every_world_whose_clock_waits() {
    every_rule_holds_where(|on_late| on_late == OnLate::Wait);
}

#[test]
fn every_rule_holds_in_every_world_whose_clock_does_not_wait() {
    every_rule_holds_where(|on_late| on_late != OnLate::Wait);
}

/// Explores all worlds with a policy about late robots.
fn every_rule_holds_where(is_meant: fn(OnLate) -> bool) {
    for world in WORLDS {
        let star = world.star(None);
        if !is_meant(star.on_late) {
            continue;
        }

        let begun = Instant::now();
        let (violation, states) = violation(&star);
        let found = violation.or_else(|| stuck(&star));

        println!(
            "{world:?}: {states} states, {:.1} s; last tick {}, {:?}, {:?}",
            begun.elapsed().as_secs_f64(),
            star.last_tick,
            star.on_late,
            star.budget,
        );
        if let Some(found) = found {
            panic!("{world:?}: {}:\n{}", found.what, found.steps.join("\n"));
        }
    }
}

/// Each rule, a world in which breaking it shows, and what goes wrong there.
const SHOWN: [(Rule, World, &str); 38] = [
    (Rule::WaitsForAll, World::Calm, "NoVerdict"),
    (Rule::ChecksEpoch, World::Init, "WrongReport"),
    (Rule::ChecksTick, World::Echoes, "WrongReport"),
    (Rule::ChecksGeneration, World::Successor, "WrongReport"),
    (Rule::CountsCommands, World::Losses, "WrongCommands"),
    (Rule::DropsPredecessor, World::Crash, "Wrong"),
    (Rule::RepeatsClock, World::Losses, END),
    (Rule::RepeatsNews, World::Losses, END),
    (Rule::FlagsNews, World::Losses, "WrongNews"),
    (Rule::TakesInWhileOpen, World::Crash, END),
    (Rule::NamesUntilReported, World::GoesOn, END),
    (Rule::NamesReplacement, World::Successor, END),
    (Rule::CountsGenerations, World::Successor, "SameIncarnation"),
    (Rule::RefusesTakenName, World::Rival, "ReplacedConnected"),
    (Rule::ReservesPlace, World::Rival, "ReplacedConnected"),
    (Rule::GoesOnWithoutAbsent, World::ScenarioCrash, END),
    (
        Rule::HangDecides,
        World::HangWhileLinkDies,
        "LostByAccident",
    ),
    (Rule::RejoinsAfterHang, World::ShortHang, "OldState"),
    (Rule::AwaitsRejoining, World::ShortHang, "NoVerdict"),
    (Rule::AsksToRejoin, World::GoesOnWhileCut, FULL_END),
    (
        Rule::CountsRejoining,
        World::GoesOnWhileCut,
        "WrongMembership",
    ),
    (Rule::JoinsWhenAsked, World::GoesOnWhileCut, FULL_END),
    (Rule::AwaitsWelcome, World::ShortHang, "ReplacedConnected"),
    (Rule::StartsOver, World::GoesOnWhileCut, "BeganEarly"),
    (Rule::GoesOnInOwnEpoch, World::Stray, "RanBackwards"),
    (
        Rule::GivesUpForGood,
        World::GoesOnWithoutB,
        "VerdictChanged",
    ),
    (Rule::WaitsForNews, World::Losses, "WrongNews"),
    (Rule::MatchesNews, World::GoesOn, "WrongNews"),
    (Rule::AnswersOnce, World::Echoes, "RanBackwards"),
    (Rule::RepeatsReport, World::Losses, END),
    (Rule::RepeatsCommands, World::Losses, END),
    (Rule::IgnoresLate, World::InitTwice, ""),
    (Rule::JoinsNewEpoch, World::Init, END),
    (Rule::WaitsToBeNamed, World::Crash, "BeganEarly"),
    (Rule::EndsWhenReplaced, World::Successor, FULL_END),
    (Rule::EndsWhenTaken, World::InitWithSuccessor, FULL_END),
    (Rule::TokenAfterWelcome, World::Crash, END),
    (Rule::RunsNewest, World::GoesOnSlowly, "RanBackwards"),
];

const END: &str = "the end is out of reach";
const FULL_END: &str = "an end with all robots is out of reach";

#[test]
fn every_rule_is_needed() {
    let mut missing = Vec::new();
    for (rule, world, shows) in SHOWN {
        let star = world.star(Some(rule));
        let (violation, _) = violation(&star);
        let found = violation.or_else(|| stuck(&star));

        match found {
            Some(found) => {
                println!(
                    "| {rule:?} | {world:?} | {} | {} |",
                    found.what,
                    found.steps.len()
                );
                if !found.what.contains(shows) {
                    missing.push(format!("{rule:?}: {} instead of {shows}", found.what));
                }
            }
            None => {
                println!("| {rule:?} | {world:?} | nothing | |");
                missing.push(format!("{rule:?}: nothing"));
            }
        }
    }

    assert!(missing.is_empty(), "{}", missing.join("\n"));
}
