//! The checker explores [`Barrier`](crate::Barrier) and [`Participant`](crate::Participant) themselves: two robots in a
//! simulated star, a few ticks, and everything that may go wrong within a [`star::Budget`], in every order.
//!
//! | Part | Stands for |
//! | --- | --- |
//! | `star` | the network, the timers, and the loop of the simulator's server |
//! | `process` | a robot's process: its host and its link |
//! | `mutants` | what is wrong with the simulator or the robots, if anything is |
//! | `simulation` | what decides who has news, and knows what each robot must report |
//!
//! Robot A sends one command in tick 0, two in tick 1, none in tick 2, and so on; B gets them as news in the tick after. A
//! link is first in, first out in both directions. Tokens of one name are one to the simulator. When a link is cut, all that
//! is on it is lost; when it is back, the token is declared again. Losses of single messages and duplicates are more than
//! TCP ever does. Timers that repeat something fire when nothing is under way, or early within the budget.
//!
//! [`star::SAFE`] is checked by stateright: no [`simulation::Violation`] is reachable. That the end, and an end with all
//! robots and without replaced processes, stays within reach by steps that happen when nothing goes wrong any more is checked
//! by a search backwards ([`liveness`]). That the checker sees anything at all is shown by [`mutants`]: wrappers around both types
//! that do one thing wrong, each in a world where it shows.
//!
//! Left out: queries between robots (a robot that waits for an answer is a robot that is slow), announcements to people, and
//! the timeouts of a robot with a simulator that is gone.

mod liveness;
mod mutants;
mod process;
mod simulation;
mod star;

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use protocol::RobotName;
use protocol::messages::{FaultKind, OnLate};
use stateright::{Checker, HasDiscoveries, Model};

use mutants::Mutant;
use simulation::Ordered;
use star::{ModelBudget, Star};

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap_or_else(|error| unreachable!("{error}"))
}

const NOTHING: ModelBudget = ModelBudget {
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
enum ModelFaults {
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

const WORLDS: [ModelFaults; 23] = [
    ModelFaults::Calm,
    ModelFaults::Losses,
    ModelFaults::Echoes,
    ModelFaults::Crash,
    ModelFaults::Cuts,
    ModelFaults::Successor,
    ModelFaults::Rival,
    ModelFaults::Stray,
    ModelFaults::Init,
    ModelFaults::InitTwice,
    ModelFaults::InitWhileCut,
    ModelFaults::InitWithSuccessor,
    ModelFaults::GoesOn,
    ModelFaults::GoesOnSlowly,
    ModelFaults::GoesOnWithoutB,
    ModelFaults::GoesOnWhileCut,
    ModelFaults::GoesOnAfterInit,
    ModelFaults::Hang,
    ModelFaults::ShortHang,
    ModelFaults::HangOfSuccessor,
    ModelFaults::HangWhileLinkDies,
    ModelFaults::ScenarioCrash,
    ModelFaults::Aborts,
];

impl ModelFaults {
    /// Whether it has more than 25,000 states. `.ci/mutants` leaves these out.
    fn is_large(self) -> bool {
        matches!(
            self,
            Self::Echoes
                | Self::Successor
                | Self::Stray
                | Self::InitTwice
                | Self::InitWhileCut
                | Self::InitWithSuccessor
                | Self::GoesOnSlowly
                | Self::GoesOnWhileCut
                | Self::HangOfSuccessor
        )
    }

    fn waits(self) -> bool {
        self.star(None).on_late == OnLate::Wait
    }

    /// The bounds: the last tick, and how often what may happen.
    fn star(self, mutant: Option<Mutant>) -> Star {
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
            mutant,
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
            Self::Losses => waits.with(ModelBudget {
                losses: 2,
                ..NOTHING
            }),
            Self::Echoes => waits.with(ModelBudget {
                losses: 1,
                duplicates: 1,
                early: 1,
                ..NOTHING
            }),
            Self::Crash => waits.with(ModelBudget {
                crashes: 1,
                losses: 1,
                ..NOTHING
            }),
            Self::Cuts => waits.with(ModelBudget {
                cuts: 1,
                blips: 1,
                ..NOTHING
            }),
            Self::Successor => waits.with(ModelBudget {
                cuts: 1,
                successors: 1,
                ..NOTHING
            }),
            Self::Rival => Star {
                last_tick: 1,
                ..waits.with(ModelBudget {
                    rivals: 1,
                    ..NOTHING
                })
            },
            Self::Stray => Star {
                is_slow: true,
                last_tick: 1,
                ..waits.with(ModelBudget {
                    strays: 2,
                    inits: 1,
                    ..NOTHING
                })
            },
            Self::Init => Star {
                is_slow: true,
                last_tick: 1,
                ..waits.with(ModelBudget {
                    inits: 1,
                    duplicates: 1,
                    ..NOTHING
                })
            },
            Self::InitTwice => Star {
                last_tick: 0,
                victim: Some("B"),
                is_gathered: true,
                ..waits.with(ModelBudget {
                    inits: 2,
                    cuts: 1,
                    duplicates: 2,
                    ..NOTHING
                })
            },
            Self::InitWhileCut => Star {
                last_tick: 1,
                ..waits.with(ModelBudget {
                    inits: 2,
                    cuts: 1,
                    ..NOTHING
                })
            },
            Self::InitWithSuccessor => Star {
                last_tick: 1,
                victim: Some("A"),
                is_gathered: true,
                ..waits.with(ModelBudget {
                    inits: 1,
                    cuts: 1,
                    successors: 1,
                    ..NOTHING
                })
            },
            Self::GoesOn => goes_on.with(ModelBudget {
                early: 1,
                losses: 1,
                ..NOTHING
            }),
            Self::GoesOnSlowly => Star {
                is_slow: true,
                lose_after: 3,
                ..goes_on.with(ModelBudget {
                    early: 2,
                    duplicates: 1,
                    ..NOTHING
                })
            },
            Self::GoesOnWithoutB => Star {
                waits_for: Some("A"),
                ..goes_on.with(ModelBudget {
                    early: 1,
                    ..NOTHING
                })
            },
            Self::GoesOnWhileCut => goes_on.with(ModelBudget { cuts: 2, ..NOTHING }),
            Self::GoesOnAfterInit => Star {
                last_tick: 2,
                ..goes_on.with(ModelBudget {
                    inits: 1,
                    cuts: 1,
                    ..NOTHING
                })
            },
            Self::Hang => Star {
                last_tick: 4,
                scenario: Some(hang),
                ..goes_on.with(ModelBudget { cuts: 1, ..NOTHING })
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
                ..goes_on.with(ModelBudget {
                    cuts: 1,
                    successors: 1,
                    ..NOTHING
                })
            },
            Self::HangWhileLinkDies => Star {
                last_tick: 4,
                lose_after: 3,
                scenario: Some(hang),
                ..goes_on.with(ModelBudget {
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
                ..goes_on.with(ModelBudget {
                    early: 1,
                    ..NOTHING
                })
            },
            Self::Aborts => Star {
                on_late: OnLate::Abort,
                ..waits.with(ModelBudget {
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
    let is_wrong = star.mutant.is_some();
    assert!(ends || is_wrong || found.is_some(), "the run never ends");

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
fn every_rule_holds_in_every_small_world() {
    every_rule_holds_where(|world| !world.is_large());
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_rule_holds_in_every_large_world_whose_clock_waits() {
    every_rule_holds_where(|world| world.is_large() && world.waits());
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_rule_holds_in_every_large_world_whose_clock_does_not_wait() {
    every_rule_holds_where(|world| world.is_large() && !world.waits());
}

/// Explores all worlds of a kind.
fn every_rule_holds_where(is_meant: fn(ModelFaults) -> bool) {
    for world in WORLDS {
        if !is_meant(world) {
            continue;
        }
        let star = world.star(None);

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

/// What may be done wrong, a world in which that shows, and what goes wrong there.
const SHOWN: [(Mutant, ModelFaults, &str); 38] = [
    (Mutant::CompletesEarly, ModelFaults::Calm, "WrongReport"),
    (Mutant::CountsOtherEpochs, ModelFaults::Init, "WrongReport"),
    (Mutant::CountsOtherTicks, ModelFaults::Echoes, "WrongReport"),
    (
        Mutant::CountsOtherIncarnations,
        ModelFaults::Successor,
        "WrongReport",
    ),
    (
        Mutant::CountsIncompleteReports,
        ModelFaults::Losses,
        "WrongCommands",
    ),
    (
        Mutant::CountsLateReports,
        ModelFaults::GoesOnWithoutB,
        "VerdictChanged",
    ),
    (Mutant::KeepsPredecessor, ModelFaults::Crash, "Wrong"),
    (Mutant::RepeatsNoClock, ModelFaults::Losses, END),
    (Mutant::RepeatsNoNews, ModelFaults::Losses, END),
    (Mutant::FlagsNoNews, ModelFaults::Losses, "WrongNews"),
    (Mutant::MissesReturn, ModelFaults::Crash, END),
    (Mutant::NamesNoNewcomer, ModelFaults::GoesOn, END),
    (
        Mutant::NamesReplacementOnce,
        ModelFaults::Successor,
        FULL_END,
    ),
    (
        Mutant::CountsNoIncarnations,
        ModelFaults::Successor,
        "SameIncarnation",
    ),
    (
        Mutant::CountsNoIncarnations,
        ModelFaults::GoesOnWhileCut,
        "ReplacedConnected",
    ),
    (
        Mutant::GivesTakenName,
        ModelFaults::Rival,
        "ReplacedConnected",
    ),
    (
        Mutant::ReservesNoPlace,
        ModelFaults::Rival,
        "ReplacedConnected",
    ),
    (Mutant::WaitsForAbsent, ModelFaults::ScenarioCrash, END),
    (
        Mutant::LosesHung,
        ModelFaults::HangWhileLinkDies,
        "LostByAccident",
    ),
    (
        Mutant::TakesHangForCrash,
        ModelFaults::ShortHang,
        "OldState",
    ),
    (
        Mutant::AwaitsNoRejoining,
        ModelFaults::ShortHang,
        "NoVerdict",
    ),
    (
        Mutant::AsksNoneToRejoin,
        ModelFaults::GoesOnWhileCut,
        FULL_END,
    ),
    (Mutant::IgnoresFlags, ModelFaults::Losses, "WrongNews"),
    (Mutant::MixesNewsUp, ModelFaults::GoesOn, "WrongNews"),
    (Mutant::RunsAgain, ModelFaults::Echoes, "RanBackwards"),
    (Mutant::RepeatsNoAnswer, ModelFaults::Losses, END),
    (Mutant::RepeatsNoCommands, ModelFaults::Losses, END),
    (
        Mutant::RunsEarlierClock,
        ModelFaults::InitTwice,
        "RanBackwards",
    ),
    (
        Mutant::RunsEarlierClock,
        ModelFaults::Echoes,
        "RanBackwards",
    ),
    (Mutant::IgnoresNewEpoch, ModelFaults::Init, END),
    (
        Mutant::IgnoresRequest,
        ModelFaults::GoesOnWhileCut,
        FULL_END,
    ),
    (
        Mutant::ExpectsNoWelcome,
        ModelFaults::ShortHang,
        "ReplacedConnected",
    ),
    (
        Mutant::GoesOnAsSuccessor,
        ModelFaults::GoesOnWhileCut,
        "BeganEarly",
    ),
    (
        Mutant::StartsOverInOwnEpoch,
        ModelFaults::Stray,
        "RanBackwards",
    ),
    (Mutant::BeginsUnnamed, ModelFaults::Crash, "BeganEarly"),
    (Mutant::OutlivesSuccessor, ModelFaults::Successor, FULL_END),
    (
        Mutant::InsistsOnName,
        ModelFaults::InitWithSuccessor,
        FULL_END,
    ),
    (Mutant::DeclaresTokenEarly, ModelFaults::Crash, END),
];

const END: &str = "the end is out of reach";
const FULL_END: &str = "an end with all robots is out of reach";

#[test]
fn mutants_are_found() {
    let some: Vec<_> = SHOWN.iter().step_by(4).copied().collect();
    assert_found(&some);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_mutant_is_found() {
    assert_found(&SHOWN);
}

fn assert_found(mutants: &[(Mutant, ModelFaults, &str)]) {
    let next = AtomicUsize::new(0);
    let missing = Mutex::new(Vec::new());
    // The checker explores a world on one thread.
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(shown) = mutants.get(next.fetch_add(1, Ordering::Relaxed)) {
                    missing.lock().unwrap().extend(why_not_found(*shown));
                }
            });
        }
    });

    let missing = missing.into_inner().unwrap();
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

/// What is wrong with what the checker finds of a mutant.
fn why_not_found((mutant, world, shows): (Mutant, ModelFaults, &str)) -> Option<String> {
    let star = world.star(Some(mutant));
    let (violation, _) = violation(&star);
    let Some(found) = violation.or_else(|| stuck(&star)) else {
        return Some(format!("{mutant:?}: nothing"));
    };

    println!(
        "| {mutant:?} | {world:?} | {} | {} |",
        found.what,
        found.steps.len()
    );
    let is_shown = found.what.contains(shows);
    (!is_shown).then(|| format!("{mutant:?}: {} instead of {shows}", found.what))
}
