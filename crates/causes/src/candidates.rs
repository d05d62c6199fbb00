//! What may have caused a jump in a tick, and what the scenario plans.

use lab::branch::Trunk;
use protocol::event::{Blocker, Cause};
use protocol::messages::FaultKind;
use protocol::{Event, RobotName, Seq, Tick};
use scenario::network::Channel;
use scenario::{ChanceKind, Scenario};

use super::plan::Counterfactual;

/// Most causes of a tick that are tried.
const MAX_CANDIDATES: usize = 12;
/// Most events of a tick that the answer names.
const MAX_EVENTS: usize = 20;
/// Most parts of a scenario's plan that are tried.
const MAX_PLANNED: usize = 10;
/// Most robots whose chance is tried by itself; that of more is tried together.
const MAX_ROBOTS: usize = 4;
/// How far back the text of a command is looked for, ticks.
const MAX_UNDER_WAY: Tick = 200;

/// The kinds of chance that a run has.
pub(super) fn kinds(scenario: &Scenario) -> Vec<ChanceKind> {
    let mut kinds = Vec::new();
    if has_chance(scenario) {
        kinds.push(ChanceKind::Network);
    }
    if scenario.guests.count > 0 {
        kinds.push(ChanceKind::Guests);
    }
    if scenario.sensing.misses > 0.0 || scenario.sensing.noise_m > 0.0 {
        kinds.push(ChanceKind::Sensing);
    }

    let names: Vec<&str> = if scenario.robots.len() > MAX_ROBOTS {
        vec!["*"]
    } else {
        scenario.robots.keys().map(RobotName::as_str).collect()
    };
    kinds.extend(
        names
            .iter()
            .filter_map(|name| format!("robot.{name}").parse().ok()),
    );
    kinds
}

/// Whether the network draws anything that matters, at some time.
fn has_chance(scenario: &Scenario) -> bool {
    let later = scenario.changes.iter().map(|change| &change.network);
    let mut networks = later.chain([&scenario.network]);

    networks.any(|network| {
        let mut channels = network.channels();
        channels.any(|channel| *channel != Channel::default())
    })
}

/// The events of a tick in words, those first that say most.
pub(super) fn events(trunk: &Trunk, tick: Tick) -> Vec<String> {
    let mut words = Vec::new();
    for (what, _) in all(trunk, tick) {
        words.push(what);
    }

    let tick_s = trunk.simulation().scenario().tick_s;
    for event in trunk.events(tick) {
        // Those are among the causes, with more words.
        let is_told = matches!(
            event,
            Event::CommandDelivered { .. }
                | Event::CommandDropped { .. }
                | Event::CommandDelayed { .. }
                | Event::CommandDuplicated { .. }
                | Event::QueryLost { .. }
        );
        if let (false, Some(line)) = (is_told, event.log_record(1, tick, tick_s)) {
            words.push(format!("{}: {}", line.source, line.text));
        }
    }

    words.dedup();
    words.truncate(MAX_EVENTS);
    words
}

/// What may have caused a jump in a tick, in words, and what happens without it.
pub(super) fn candidates(trunk: &Trunk, tick: Tick) -> Vec<(String, Counterfactual)> {
    let mut found = all(trunk, tick);
    found.truncate(MAX_CANDIDATES);
    found
}

/// All that can be left out of a tick, what is rare first.
fn all(trunk: &Trunk, tick: Tick) -> Vec<(String, Counterfactual)> {
    let mut found: Vec<(u8, String, Counterfactual)> = Vec::new();
    for event in trunk.events(tick) {
        // A command that was delayed and doubled is two events, and without both it just arrives: that is tried once.
        if let Some((rank, what, instead)) = left_out(trunk, tick, event)
            && !found.iter().any(|(_, _, other)| *other == instead)
        {
            found.push((rank, what, instead));
        }
    }

    // Stable: of the same rank, those that come first in the record, so the ones beyond the limit are always the same.
    found.sort_by_key(|(rank, ..)| *rank);
    found
        .into_iter()
        .map(|(_, what, instead)| (what, instead))
        .collect()
}

/// What is without an event, which is named in words, with its rank; `None` for an event that follows from others.
fn left_out(trunk: &Trunk, tick: Tick, event: &Event) -> Option<(u8, String, Counterfactual)> {
    let arrives = |from: &RobotName, to: &RobotName, seq: Seq| Counterfactual::Arrives {
        from: from.clone(),
        to: to.clone(),
        seq,
    };
    let command = |from, to, seq| named(trunk, tick, from, to, seq);

    match event {
        Event::Changed { set, by_hand: true } => Some((
            0,
            format!("what was changed by hand: {set}"),
            Counterfactual::NothingByHand,
        )),
        Event::CommandSent {
            from, to, command, ..
        } if from.is_operator() => Some((
            0,
            format!("the operator's command {command:?} to {to}"),
            Counterfactual::NothingByHand,
        )),
        Event::CommandDropped {
            from,
            to,
            seq,
            because,
        } if is_of_network(*because) => Some((
            1,
            format!("{} was lost", command(from, to, *seq)),
            arrives(from, to, *seq),
        )),
        Event::CommandDelayed { from, to, seq, .. } => Some((
            2,
            format!("{} was delayed", command(from, to, *seq)),
            arrives(from, to, *seq),
        )),
        Event::CommandDuplicated { from, to, seq, .. } => Some((
            2,
            format!("{} came twice", command(from, to, *seq)),
            arrives(from, to, *seq),
        )),
        Event::QueryLost { from, to, .. } => Some((
            3,
            format!("{from} could not query {to}"),
            Counterfactual::IsAnswered {
                from: from.clone(),
                to: to.clone(),
            },
        )),
        Event::Blocked {
            robot,
            by: Blocker::Guest,
            ..
        } => Some((
            4,
            format!("a guest blocked {robot}"),
            Counterfactual::WayIsFree {
                robot: robot.clone(),
            },
        )),
        Event::CommandDelivered { from, to, seq } if !from.is_operator() => Some((
            5,
            format!("{} arrived", command(from, to, *seq)),
            Counterfactual::IsLost {
                from: from.clone(),
                to: to.clone(),
                seq: *seq,
            },
        )),
        // Named one by one, so that a new event has to be decided about here. These follow from others, or
        // nothing happens instead of them.
        Event::Init { .. }
        | Event::Joined { .. }
        | Event::Lost { .. }
        | Event::Missed { .. }
        | Event::DoneLate { .. }
        | Event::Blocked { .. }
        | Event::Emotion { .. }
        | Event::Behavior { .. }
        | Event::CommandSent { .. }
        | Event::CommandDelivered { .. }
        | Event::CommandDropped { .. }
        | Event::LinkCut { .. }
        | Event::LinkHealed { .. }
        | Event::Fault { .. }
        | Event::Changed { .. }
        | Event::Say { .. }
        | Event::Guest { .. }
        | Event::GuestEntered { .. }
        | Event::GuestLeft { .. }
        | Event::SiteChanged { .. }
        | Event::SiteRefused { .. }
        | Event::LayerChanged { .. }
        | Event::LayerRefused { .. }
        | Event::Warned { .. }
        | Event::Judged { .. }
        | Event::Tick { .. }
        | Event::End { .. } => None,
    }
}

/// A command in words, with its text.
fn named(trunk: &Trunk, tick: Tick, by: &RobotName, target: &RobotName, number: Seq) -> String {
    let first = tick.saturating_sub(MAX_UNDER_WAY);

    // Backwards: without delay a command is sent in the tick before.
    for tick in (first..=tick).rev() {
        for event in trunk.events(tick) {
            if let Event::CommandSent {
                from, seq, command, ..
            } = event
                && from == by
                && *seq == number
            {
                return format!("command {number} ({command}) from {by} to {target}");
            }
        }
    }
    format!("command {number} from {by} to {target}")
}

/// Whether the network lost a message, and not its target or its sender.
fn is_of_network(because: Cause) -> bool {
    !matches!(because, Cause::Missed | Cause::Overflow | Cause::Unknown)
}

/// Whether it is the fate of a command that the scenario names by its number.
fn is_named(event: &Event) -> bool {
    matches!(
        event,
        Event::CommandDropped {
            because: Cause::Scripted,
            ..
        } | Event::CommandDelayed {
            because: Some(Cause::Scripted),
            ..
        } | Event::CommandDuplicated {
            because: Some(Cause::Scripted),
            ..
        }
    )
}

/// What the scenario plans, in words, and what is without it: partitions, faults, and commands that it names by their numbers.
pub(super) fn planned(trunk: &Trunk, scenario: &Scenario) -> Vec<(Tick, String, Counterfactual)> {
    let last = trunk.last();
    let mut planned = Vec::new();

    // Forks go on after tick 0 at the earliest. What a change takes away or moves before it begins never took place.
    for (index, partition) in scenario.network.partitions.iter().enumerate() {
        let known = &scenario.network_at(partition.from).partitions;
        if (1..=last).contains(&partition.from) && known.get(index) == Some(partition) {
            let time_s = protocol::time::time_s(partition.from, scenario.tick_s);
            let what = format!("the partition at {time_s} s");
            planned.push((partition.from, what, Counterfactual::NoPartition { index }));
        }
    }

    for (index, fault) in scenario.faults.iter().enumerate() {
        let known = scenario.faults_at(fault.at);
        if (1..=last).contains(&fault.at) && known.get(index) == Some(fault) {
            let time_s = protocol::time::time_s(fault.at, scenario.tick_s);
            let kind = match fault.kind {
                FaultKind::Crash => "crash",
                FaultKind::Hang => "hang",
                FaultKind::Slow => "slow time",
                FaultKind::Restart => "restart",
            };
            let what = format!("the {kind} of {} at {time_s} s", fault.robot);
            planned.push((fault.at, what, Counterfactual::NoFault { index }));
        }
    }

    // Only the run tells in which tick a command has the number that is named.
    if !scenario.network.named.is_empty() {
        for tick in 1..=last {
            for event in trunk.events(tick) {
                if is_named(event)
                    && let Some((_, what, instead)) = left_out(trunk, tick, event)
                {
                    planned.push((tick, what, instead));
                }
            }
        }
    }

    planned.sort_by_key(|(tick, ..)| *tick);
    planned.truncate(MAX_PLANNED);
    planned
}
