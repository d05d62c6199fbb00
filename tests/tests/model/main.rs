//! The protocol between simulator and robots, small enough that a model checker sees all of it.
//!
//! Robots A and B, ticks 0 to 2, one command from A to B in each tick. What may go wrong is bounded by a
//! [`machine::Budget`]; within it the checker tries every order. Each action is something that the code does:
//!
//! | Action | Code |
//! | --- | --- |
//! | `Start` | `robot::Host::join_over`, `Server::on_join`: a query that is repeated until it is answered is one step |
//! | `Deliver(_, Up)` | `Server::on_report`, `Server::on_token`, then the loop of `Server::exchange` |
//! | `Deliver(_, Down)` | `Link::file_clock`, `Host::on_clock`, `Seat::tick`; a tick whose command is not here yet waits |
//! | `Deliver(_, Out)` | `Link::file_command` |
//! | `Lose`, `Duplicate` | a message that was put is lost, or comes again after all others on its link |
//! | `Repeat` | `Server::repeat_clock`: at any time while the budget lasts, and always where nothing moves any more |
//! | `GoOnWithoutLate` | `on_late = "continue"`: `Server::go_on_without_late`, a robot is lost after two ticks |
//! | `GiveUpWaiting` | `COMMAND_PATIENCE`: only where nobody who has the command can be asked again |
//! | `Crash` | a process dies; what it has sent arrives, then its token goes |
//! | `Cut`, `Heal` | a link breaks and everything on it is lost; its process lives, and its token comes back |
//! | `Init` | a new epoch: `Server::epoch`, `Server::gather` |
//!
//! Left out: queries and percepts (a robot that waits for an answer is a robot that is slow), the medium's own losses,
//! commands of the operator. A link to the simulator and one to B are two, which is less order than the star gives.
//!
//! That nothing bad is reachable is checked by stateright; that the end stays reachable from every state, whatever has
//! happened, by a search backwards from the ends ([`ends::unending`]): with fair delivery a run then ends. That the
//! checker sees anything at all is shown by models in which one rule is broken: each must give a counterexample.

mod ends;
mod machine;
mod protocol;
mod robot;
mod simulator;

use std::time::Instant;

use machine::{Budget, Rule};
use protocol::Protocol;
use stateright::{Checker, HasDiscoveries, Model};

/// What goes wrong together; all of it at once would be too much to see.
const WORLDS: [(&str, Budget); 7] = [
    (
        "losses and echoes",
        Budget {
            losses: 2,
            duplicates: 1,
            repeats: 1,
            ..NOTHING
        },
    ),
    (
        "a process dies and another comes",
        Budget {
            crashes: 1,
            starts: 1,
            losses: 1,
            duplicates: 1,
            ..NOTHING
        },
    ),
    (
        "a link breaks and heals",
        Budget {
            cuts: 2,
            losses: 1,
            ..NOTHING
        },
    ),
    (
        "a link breaks and another process takes the place",
        Budget {
            cuts: 1,
            starts: 1,
            losses: 1,
            ..NOTHING
        },
    ),
    (
        "the clock goes on without the late",
        Budget {
            lates: 2,
            losses: 1,
            duplicates: 1,
            ..NOTHING
        },
    ),
    (
        "and without the lost, who return",
        Budget {
            lates: 2,
            crashes: 1,
            starts: 1,
            ..NOTHING
        },
    ),
    (
        "a new epoch",
        Budget {
            inits: 1,
            losses: 1,
            duplicates: 1,
            ..NOTHING
        },
    ),
];

const NOTHING: Budget = Budget {
    losses: 0,
    duplicates: 0,
    repeats: 0,
    crashes: 0,
    cuts: 0,
    starts: 0,
    lates: 0,
    inits: 0,
};

/// What goes wrong within these bounds, in words and as the actions that lead there; `None` if nothing does.
fn counterexample(
    world: &str,
    budget: Budget,
    broken: Option<Rule>,
    enough: HasDiscoveries,
) -> Option<String> {
    let model = Protocol {
        last_tick: 2,
        budget,
        broken,
    };
    let begun = Instant::now();
    let checker = model
        .checker()
        .threads(4)
        .finish_when(enough)
        .spawn_bfs()
        .join();
    let safe_s = begun.elapsed().as_secs_f64();
    let states = checker.unique_state_count();
    let mut found = Vec::new();
    for property in model.properties() {
        let is_bad = property.expectation.discovery_is_failure();
        match checker.discovery(property.name) {
            Some(path) if is_bad => {
                found.push(format!(
                    "{world}: not so: {}\n{:?}",
                    property.name,
                    path.into_actions()
                ));
            }
            None if !is_bad && found.is_empty() => {
                found.push(format!("{world}: never: {}", property.name))
            }
            _ => {}
        }
    }
    if !found.is_empty() {
        return Some(found.join("\n"));
    }
    let unending = ends::unending(&model);
    println!(
        "{world}: {states} states, depth {}, safe after {safe_s:.1} s, ends after {:.1} s",
        checker.max_depth(),
        begun.elapsed().as_secs_f64()
    );
    unending.map(|actions| format!("{world}: the end is out of reach after\n{actions:?}"))
}

#[test]
fn the_protocol_holds() {
    let mut found = Vec::new();
    for (world, budget) in WORLDS {
        found.extend(counterexample(world, budget, None, HasDiscoveries::All));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_rule_is_needed() {
    // Each broken rule, a world in which that shows, and how.
    for (rule, world, shows) in [
        (Rule::WaitsForAll, 0, "a tick has a verdict on every robot"),
        (Rule::DoesTicksOnce, 0, "no command is delivered twice"),
        (Rule::ChecksTick, 0, "nothing stale is counted"),
        (Rule::RepeatsClock, 0, "the end is out of reach"),
        (Rule::RepeatsReport, 0, "the end is out of reach"),
        (Rule::RepeatsCommands, 0, "the end is out of reach"),
        (
            Rule::NumbersAnew,
            1,
            "what is delivered is what was recorded",
        ),
        (Rule::NamesInOpenClock, 1, "the end is out of reach"),
        (Rule::ChecksGeneration, 3, "nothing stale is counted"),
        (Rule::LooksAfterAll, 4, "the clock never waits for nobody"),
        (Rule::ChecksEpoch, 6, "nothing stale is counted"),
    ] {
        let (world, budget) = WORLDS[world];
        let enough = HasDiscoveries::AnyOf([shows].into());
        let found = counterexample(world, budget, Some(rule), enough);
        let found = found.unwrap_or_else(|| panic!("nothing goes wrong without {rule:?}"));
        assert!(found.contains(shows), "without {rule:?}: {found}");
        println!(
            "without {rule:?}: {}",
            found.lines().next().unwrap_or_default()
        );
    }
}
