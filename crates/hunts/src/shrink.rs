//! Shrinking: from a case in which an expectation fails to a smaller one in which the same expectation fails.
//!
//! Faults are replaced by the single commands that they lost, delayed or doubled, left out by delta debugging (Zeller and Hildebrandt
//! 2002), and weakened and moved to earlier times and commands; robots, guests and the end of the run are left out. Only a case that was played, and in which the expectation
//! failed, is taken. A smaller scenario is taken only if the expectation does not fail in it without faults: otherwise what
//! is missing in it would be the cause.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

use experiments::parallel::first;
use protocol::{RobotName, Tick};

use super::case::FaultCase;
use super::fault::{Effect, Messages, PlannedFault, TickSpan, robot_chance};
use super::sent::SentMessage;
use super::trial::{Trial, TrialResult};

/// Least time of a fault, ticks.
const MIN_TICKS: Tick = 2;

/// How many of the first commands of a link are tried in the place of a later one, one by one.
const FIRST_COMMANDS: u64 = 16;
/// How many equal parts the numbers below a number are divided into, one of each being tried.
const STEPS: u64 = 8;

/// What bounds the shrinking of one case.
#[derive(Debug, Clone, Copy)]
pub struct Bounds<'a> {
    /// Most runs.
    pub runs: u64,
    /// Number of runs at the same time; the result does not depend on it.
    pub jobs: usize,
    /// Set to end with the smallest case so far.
    pub stop: &'a AtomicBool,
}

/// A case that was shrunk.
#[derive(Debug, Clone, PartialEq)]
pub struct Shrunk {
    /// The smallest case that was found.
    pub case: FaultCase,
    /// Its run, in which the expectation fails.
    pub played: TrialResult,
    /// Number of runs that it took.
    pub runs: u64,
    /// Whether no step makes it smaller. If not, the runs did not suffice.
    pub is_minimal: bool,
}

/// Shrinks a case in whose run the expectation `name` failed. The scenario has these robots, and this number of guests.
pub fn shrink(
    trial: &dyn Trial,
    name: &str,
    case: FaultCase,
    played: TrialResult,
    world: &ScenarioParts,
    bounds: Bounds<'_>,
) -> Shrunk {
    let mut shrinker = Shrinker {
        trial,
        name,
        wanted: BTreeSet::from([name.to_owned()]),
        world,
        bounds,
        best: case,
        played,
        runs: 0,
    };
    let is_minimal = shrinker.shrink();

    Shrunk {
        case: shrinker.best,
        played: shrinker.played,
        runs: shrinker.runs,
        is_minimal,
    }
}

/// What can be left out of a scenario.
#[derive(Debug, Clone, Default)]
pub struct ScenarioParts {
    /// The robots.
    pub roster: Vec<RobotName>,
    /// The number of guests.
    pub guests: usize,
}

struct Shrinker<'a> {
    trial: &'a dyn Trial,
    name: &'a str,
    wanted: BTreeSet<String>,
    world: &'a ScenarioParts,
    bounds: Bounds<'a>,
    /// The smallest case so far in which the expectation fails.
    best: FaultCase,
    /// Its run.
    played: TrialResult,
    runs: u64,
}

impl Shrinker<'_> {
    /// Shrinks until no step makes the case smaller; returns whether that was reached.
    fn shrink(&mut self) -> bool {
        // First of all: every run that follows is as short as the one in which the expectation failed.
        self.shorten();

        // Around again, because each step may make room for an earlier one: without a robot, a fault may not be needed any more.
        loop {
            let before = self.best.clone();
            self.make_concrete();
            self.remove_faults();
            self.weaken_faults();
            self.remove_robots();
            self.remove_guests();
            self.shorten();

            // Asked for first: steps that were cut off change nothing either, and that does not make the case minimal.
            if self.is_over() {
                return false;
            }
            if self.best == before {
                return true;
            }
        }
    }

    fn is_over(&self) -> bool {
        self.runs >= self.bounds.runs || self.bounds.stop.load(Ordering::Relaxed)
    }

    /// Takes the first of these cases in which the expectation fails; returns its place. The order decides, not which run
    /// ends first.
    fn take_first(&mut self, cases: Vec<FaultCase>) -> Option<usize> {
        let mut cases = cases;
        // To take the same case again would look like progress, for ever.
        cases.retain(|case| *case != self.best);
        let left = self.bounds.runs.saturating_sub(self.runs);
        cases.truncate(usize::try_from(left).unwrap_or(usize::MAX));

        let found = first(&cases, self.bounds.jobs, self.bounds.stop, |case| {
            self.failing(case)
        });
        // Those in their order up to the one that is taken, not those that other threads have begun after it: so the bound ends the
        // shrinking at the same place however many run at the same time.
        self.runs += match &found {
            Some((place, _)) => *place as u64 + 1,
            None => cases.len() as u64,
        };

        let (place, played) = found?;
        self.best = cases.swap_remove(place);
        self.played = played;
        Some(place)
    }

    /// The run of a case, if the expectation fails in it because of its faults.
    fn failing(&self, case: &FaultCase) -> Option<TrialResult> {
        let played = self.trial.play(case, &self.wanted).ok()?;
        if !played.failed.contains_key(self.name) {
            return None;
        }
        // In the world of the best case the faults are known to be the cause: this was looked at when that world was taken.
        if case.has_world_of(&self.best) {
            return Some(played);
        }

        let without = self
            .trial
            .play(&case.with_faults(Vec::new()), &self.wanted)
            .ok()?;
        let is_cause = !without.failed.contains_key(self.name);
        is_cause.then_some(played)
    }

    /// Ends the run where the expectation has failed.
    fn shorten(&mut self) {
        let Some(failure) = self.played.failed.get(self.name) else {
            return;
        };
        let mut case = self.best.clone();
        case.ticks = Some(failure.tick.max(1));
        self.take_first(vec![case]);
    }

    /// Replaces faults by the single commands that were lost, late or doubled in the run: all faults, or one of them.
    fn make_concrete(&mut self) {
        let mut concrete = Vec::new();
        for message in &self.played.sent {
            for fault in fates_as_faults(message) {
                if !self.best.faults.contains(&fault) {
                    concrete.push(fault);
                }
            }
        }
        let are_commands = self.best.faults.iter().all(|one| one.command().is_some());
        if concrete.is_empty() || are_commands {
            return;
        }

        // All faults that are not of single commands at once, and then each of them alone.
        let mut named = Vec::new();
        for fault in &self.best.faults {
            if fault.command().is_some() {
                named.push(fault.clone());
            }
        }
        named.extend(concrete.iter().cloned());

        let mut cases = vec![self.best.with_faults(named)];
        for (index, fault) in self.best.faults.iter().enumerate() {
            if fault.command().is_some() {
                continue;
            }
            let mut faults = self.best.faults.clone();
            faults.splice(index..=index, concrete.iter().cloned());
            cases.push(self.best.with_faults(faults));
        }
        self.take_first(cases);
    }

    /// Delta debugging: leaves out faults until each that is left is needed.
    fn remove_faults(&mut self) {
        // Each piece by itself, then all but each piece; where the expectation fails in none of these, smaller pieces.
        let mut pieces = 2;
        while self.best.faults.len() > 1 && !self.is_over() {
            let count = self.best.faults.len();
            pieces = pieces.min(count);

            let mut cases = Vec::new();
            for piece in 0..pieces {
                let begin = piece * count / pieces;
                let end = (piece + 1) * count / pieces;
                cases.push(self.best.with_faults(self.best.faults[begin..end].to_vec()));
            }
            // Of two pieces, all but the one is the other.
            if pieces > 2 {
                for piece in 0..pieces {
                    let begin = piece * count / pieces;
                    let end = (piece + 1) * count / pieces;
                    let mut faults = self.best.faults.clone();
                    faults.drain(begin..end);
                    cases.push(self.best.with_faults(faults));
                }
            }

            match self.take_first(cases) {
                // A piece by itself is enough: begin anew with it.
                Some(place) if place < pieces => pieces = 2,
                // One was not needed: the others are as large as before.
                Some(_) => pieces = (pieces - 1).max(2),
                // Pieces were single faults: each is needed.
                None if pieces == count => return,
                None => pieces = (2 * pieces).min(count),
            }
        }
    }

    /// Weakens one fault after the other, or moves it to an earlier time, as long as the expectation fails.
    fn weaken_faults(&mut self) {
        let mut index = 0;
        while index < self.best.faults.len() && !self.is_over() {
            let fault = &self.best.faults[index];
            let mut instead = weaker(fault, self.world);
            instead.extend(earlier(fault));
            // A fault that is there already would be there twice.
            instead.retain(|other| !self.best.faults.contains(other));

            let mut cases = Vec::new();
            for weaker in instead {
                let mut faults = self.best.faults.clone();
                faults[index] = weaker;
                cases.push(self.best.with_faults(faults));
            }

            // A fault that was weakened is looked at again; each step is smaller, so this ends.
            if self.take_first(cases).is_none() {
                index += 1;
            }
        }
    }

    fn remove_robots(&mut self) {
        for robot in &self.world.roster {
            if self.best.without.contains(robot) || self.is_over() {
                continue;
            }

            let mut case = self.best.clone();
            case.without.insert(robot.clone());
            case.faults = Vec::new();
            for fault in &self.best.faults {
                case.faults.extend(fault.without(robot));
            }

            // Without faults no expectation can fail because of them.
            if !case.faults.is_empty() {
                self.take_first(vec![case]);
            }
        }
    }

    fn remove_guests(&mut self) {
        let mut faults = self.best.faults.iter();
        if faults.any(|fault| matches!(fault, PlannedFault::Crowd { .. })) {
            return; // Weakening that fault leaves guests out.
        }

        while !self.is_over() {
            let guests = self.best.guests.unwrap_or(self.world.guests);
            let mut cases = Vec::new();
            for fewer in [0, guests / 8, guests / 4, guests / 2, guests * 3 / 4] {
                let mut case = self.best.clone();
                case.guests = Some(fewer);
                if fewer < guests && !cases.contains(&case) {
                    cases.push(case);
                }
            }
            if self.take_first(cases).is_none() {
                return;
            }
        }
    }
}

/// What became of a command, as faults that do exactly that.
fn fates_as_faults(message: &SentMessage) -> Vec<PlannedFault> {
    let link = || message.link.clone();
    let number = message.number;

    // What does not arrive is neither late nor doubled: one fault says it all.
    let mut faults = Vec::new();
    if message.is_lost {
        let link = link();
        return vec![PlannedFault::Lose { link, number }];
    }
    if message.late > 0 {
        faults.push(PlannedFault::Late {
            link: link(),
            number,
            by: message.late,
        });
    }
    if message.is_doubled {
        let link = link();
        faults.push(PlannedFault::Double { link, number });
    }
    faults
}

/// Weaker faults in the place of a fault, the weakest first. Each is smaller by a measure that cannot fall for ever.
fn weaker(fault: &PlannedFault, world: &ScenarioParts) -> Vec<PlannedFault> {
    let mut all = Vec::new();
    match fault {
        PlannedFault::Lose { .. } | PlannedFault::Double { .. } => {}
        PlannedFault::Late { link, number, by } => {
            for by in before(*by, 1, 1) {
                all.push(PlannedFault::Late {
                    link: link.clone(),
                    number: *number,
                    by,
                });
            }
        }
        PlannedFault::Reseed { at, seed, of } => {
            // One kind of chance in the place of all of it.
            if of.is_empty() {
                let kinds = ["network", "guests", "sensing"].map(str::to_owned);
                let robots = world.roster.iter().map(robot_chance);
                for kind in kinds.into_iter().chain(robots) {
                    all.push(PlannedFault::Reseed {
                        at: *at,
                        seed: *seed,
                        of: vec![kind],
                    });
                }
            }
        }
        PlannedFault::Channel {
            link,
            of,
            effect,
            span,
        } => {
            let with = |effect, span| PlannedFault::Channel {
                link: link.clone(),
                of: *of,
                effect,
                span,
            };

            for span in shorter(*span) {
                all.push(with(*effect, span));
            }
            if let Some(effect) = weaker_effect(*effect) {
                all.push(with(effect, *span));
            }
        }
        PlannedFault::Partition { .. } => all = weaker_partitions(fault),
        PlannedFault::Absence { robot, why, span } => {
            for span in shorter(*span) {
                all.push(PlannedFault::Absence {
                    robot: robot.clone(),
                    why: *why,
                    span,
                });
            }
        }
        PlannedFault::Wall { at } => {
            for left_out in 0..at.len() {
                let mut at = at.clone();
                at.remove(left_out);
                if !at.is_empty() {
                    all.push(PlannedFault::Wall { at });
                }
            }
        }
        PlannedFault::Crowd { guests: count } => {
            let guests = world.guests;
            for share in [4, 2] {
                let fewer = guests + count.saturating_sub(guests) / share;
                if fewer < *count && fewer > guests {
                    all.push(PlannedFault::Crowd { guests: fewer });
                }
            }
        }
    }

    all
}

/// The same fault at earlier times, the earliest first. A run in which it does the same is shorter.
fn earlier(fault: &PlannedFault) -> Vec<PlannedFault> {
    let mut all = Vec::new();
    if let Some((_, number)) = fault.command() {
        for number in before(number, 1, FIRST_COMMANDS) {
            all.push(fault.of_command(number));
        }
    }

    match fault {
        PlannedFault::Channel { span, .. }
        | PlannedFault::Partition { span, .. }
        | PlannedFault::Absence { span, .. } => {
            for from in before(span.from, 0, 1) {
                let span = TickSpan {
                    from,
                    until: from + (span.until - span.from),
                };
                all.push(fault.at(span));
            }
        }
        _ => {}
    }
    all
}

/// Numbers from `least` on that are smaller than a number, in their order: the `first` ones, some in equal steps, and those a little
/// smaller. An expectation need not fail for all numbers between two for which it fails.
fn before(number: u64, least: u64, first: u64) -> Vec<u64> {
    let steps = 1..STEPS;
    let mut all: BTreeSet<u64> = (least..least + first).collect();
    all.extend(steps.map(|step| least + number.saturating_sub(least) * step / STEPS));
    all.extend([8, 1].map(|less| number.saturating_sub(less)));
    all.retain(|other| (least..number).contains(other));
    all.into_iter().collect()
}

/// A shorter partition, one of a single direction, and one of a single kind of messages.
fn weaker_partitions(fault: &PlannedFault) -> Vec<PlannedFault> {
    let PlannedFault::Partition {
        one,
        other,
        one_way,
        cuts,
        span,
    } = fault
    else {
        return Vec::new();
    };

    let mut all = Vec::new();
    for span in shorter(*span) {
        all.push(partition(one, other, *one_way, cuts, span));
    }
    if !one_way {
        all.push(partition(one, other, true, cuts, *span));
        all.push(partition(other, one, true, cuts, *span));
    }
    if cuts.len() > 1 {
        for of in cuts {
            all.push(partition(one, other, *one_way, &[*of], *span));
        }
    }
    all
}

fn partition(
    one: &[RobotName],
    other: &[RobotName],
    one_way: bool,
    cuts: &[Messages],
    span: TickSpan,
) -> PlannedFault {
    PlannedFault::Partition {
        one: one.to_vec(),
        other: other.to_vec(),
        one_way,
        cuts: cuts.to_vec(),
        span,
    }
}

fn weaker_effect(effect: Effect) -> Option<Effect> {
    let half = |amount: u64| (amount > 1).then_some(amount / 2);
    Some(match effect {
        Effect::Loss(chance) => Effect::Loss(half(chance)?),
        Effect::Burst(enter, leave) => Effect::Burst(half(enter)?, leave),
        Effect::Delay(most_s) => Effect::Delay(half(most_s)?),
        Effect::Duplication(chance) => Effect::Duplication(half(chance)?),
    })
}

/// Shorter times: the second half and the first half of a time, and what is left without its first and its last part.
fn shorter(span: TickSpan) -> Vec<TickSpan> {
    let lasting = span.until - span.from;
    let mut all = Vec::new();
    for part in [lasting / 2, lasting / 8, 1] {
        if part == 0 || lasting.saturating_sub(part) < MIN_TICKS {
            continue;
        }

        all.push(TickSpan {
            from: span.from + part,
            until: span.until,
        });
        all.push(TickSpan {
            from: span.from,
            until: span.until - part,
        });
    }

    all
}

#[cfg(test)]
mod tests;
