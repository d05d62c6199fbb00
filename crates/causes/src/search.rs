//! Where the expected outcome of a run jumps, and why: pure, over anything that plays forks.
//!
//! Forks are spent where neighboring points differ: a coarse grid first, then halves of the intervals that differ, down to a tick. All of
//! this may be wrong. A jump is reported only if forks that took no part in finding it confirm it, at a level of 5 % for all of them
//! together (Holm). So the search decides what is missed, and never what is claimed.

use std::collections::BTreeMap;
use std::ops::Range;

use lab::LabError;
use protocol::Tick;
use scenario::ChanceKind;
use statistics::{SignFlip, holm};
use timeline::{DecisionCause, DecisionJump, DecisionPoint, ForkOutcomes};

use super::answer::{Jump, KindEffect, PlannedEffect, TriedCause, outcomes_of};
use super::plan::{Counterfactual, ForkOutcome, ForkPlan};

/// Points of the curve at first, beside tick 0.
const GRID: Tick = 40;
/// Forks of each of them.
const SCOUTS: u64 = 64;
/// Forks of each point at the ends of an interval that is halved.
const FORKS: u64 = 200;
/// Forks that confirm a jump on each of its sides.
const CONFIRMING: u64 = 400;
/// Number of the first of them: they took no part in finding it.
const FIRST_CONFIRMING: u64 = 1_000_000;
/// Forks of each cause that is tried, and of each kind of chance.
const TRYING: u64 = 200;
/// Least change of a probability in a tick that counts as a jump.
const MIN_JUMP: f64 = 0.1;
/// The same of a number, in its largest standard deviation over the run.
const MIN_JUMP_SD: f64 = 0.5;
/// Part of the least jump that a jump must surely exceed.
const SURE_PART: f64 = 0.5;
/// Share of the least jump that both halves of an interval together must have, so that it is looked at.
const WORTH_A_LOOK: f64 = 0.7;
/// Points of the grid on each side of an interval that are looked at together, and how many standard errors must lie between them.
const WINDOW: usize = 3;
const CLEAR_Z: f64 = 2.5;
/// Most ticks that are tested for jumps.
const MAX_JUMPS: usize = 8;
/// Most intervals that are halved at the same time.
const MAX_INTERVALS: usize = 12;
/// Level of each family of tests.
const LEVEL: f64 = 0.05;

/// Plays forks.
pub(super) trait Forks {
    /// The outcomes of the forks of a plan with these numbers.
    ///
    /// # Errors
    /// If the run cannot be executed again, or the caller ends it.
    fn play(&mut self, plan: &ForkPlan, numbers: Range<u64>) -> Result<Vec<ForkOutcome>, LabError>;

    /// Whether more forks may be played.
    fn has_budget(&self) -> bool;
}

/// What is known of the run beside its forks.
pub(super) struct SearchedRun<'a> {
    /// The last tick.
    pub(super) last: Tick,
    /// The outcome of the run itself.
    pub(super) recorded: Option<f64>,
    pub(super) is_share: bool,
    /// The kinds of chance that there are.
    pub(super) kinds: Vec<ChanceKind>,
    /// What the scenario plans: when it begins, what it is in words, and what is without it.
    pub(super) planned: Vec<(Tick, String, Counterfactual)>,
    /// What may have caused a jump in a tick, in words, and what is without it.
    pub(super) candidates: &'a dyn Fn(Tick) -> Vec<(String, Counterfactual)>,
    /// What happened in a tick, in words.
    pub(super) events: &'a dyn Fn(Tick) -> Vec<String>,
}

/// What was found.
#[derive(Debug, Default)]
pub(super) struct FoundJumps {
    pub(super) curve: Vec<DecisionPoint>,
    pub(super) jumps: Vec<Jump>,
    pub(super) kinds: Vec<KindEffect>,
    pub(super) planned: Vec<PlannedEffect>,
    pub(super) least_jump: f64,
    pub(super) is_complete: bool,
}

/// Finds where the expected outcome jumps, and why.
///
/// # Errors
/// As [`Forks::play`].
pub(super) fn search(run: &SearchedRun<'_>, forks: &mut dyn Forks) -> Result<FoundJumps, LabError> {
    let mut search = Search {
        run,
        forks,
        points: BTreeMap::new(),
        is_complete: true,
    };
    // What the scenario plans is few and may be all of the answer, so a small budget goes there.
    search.reach(0, SCOUTS)?;
    let planned = search.planned()?;

    search.scout()?;
    let least_jump = search.least_jump();
    let ticks = search.narrow(least_jump)?;
    let jumps = search.confirm(&ticks, least_jump)?;
    let kinds = search.kinds()?;

    // Only here: the least jump, which an effect that matters must reach, is known after the curve.
    let planned = planned.into_iter().map(|(mut effect, change)| {
        effect.matters = effect.p <= LEVEL && change.abs() >= least_jump;
        effect
    });

    Ok(FoundJumps {
        curve: search.curve(),
        jumps,
        kinds,
        planned: planned.collect(),
        least_jump,
        is_complete: search.is_complete,
    })
}

struct Search<'a> {
    run: &'a SearchedRun<'a>,
    forks: &'a mut dyn Forks,
    /// Outcomes after ticks, by the numbers of forks from 0 on.
    points: BTreeMap<Tick, Vec<ForkOutcome>>,
    is_complete: bool,
}

impl Search<'_> {
    /// The curve at a few ticks.
    fn scout(&mut self) -> Result<(), LabError> {
        let last = self.run.last;
        let grid = GRID.min(last).max(1);
        for index in 0..grid {
            if !self.goes_on() {
                break;
            }
            self.reach(last * index / grid, SCOUTS)?;
        }
        Ok(())
    }

    /// Whether there is a budget; notes that it was not enough.
    fn goes_on(&mut self) -> bool {
        let goes_on = self.forks.has_budget();
        self.is_complete &= goes_on;
        goes_on
    }

    /// Plays as many forks after a tick, if they are not played yet. After the last one the outcome is known.
    fn reach(&mut self, tick: Tick, forks: u64) -> Result<(), LabError> {
        let have = self.points.get(&tick).map_or(0, |point| point.len() as u64);
        if tick >= self.run.last || have >= forks {
            return Ok(());
        }

        // Numbered from 0 without gaps: the place of an outcome is the number of its fork, by which points are compared in pairs.
        let more = self.forks.play(&ForkPlan::After { tick }, have..forks)?;
        self.points.entry(tick).or_default().extend(more);
        Ok(())
    }

    /// The differences between the outcomes after two ticks, fork by fork.
    fn differences(&self, from: Tick, to: Tick) -> Vec<f64> {
        let known = [ForkOutcome::from(self.run.recorded)];
        let of = |tick| self.points.get(&tick).map(Vec::as_slice);
        let before = of(from).unwrap_or_default();
        let after = of(to).unwrap_or_default();

        // After its last tick a run has one outcome, whatever is drawn then.
        if to >= self.run.last {
            return differences(before, known.iter().cycle());
        }
        differences(before, after.iter())
    }

    fn least_jump(&self) -> f64 {
        if self.run.is_share {
            return MIN_JUMP;
        }
        let deviations = self.points.values().map(|point| {
            let values: Vec<f64> = point.iter().filter_map(ForkOutcome::number).collect();
            deviation(&values)
        });
        MIN_JUMP_SD * deviations.fold(0.0, f64::max)
    }

    /// The ticks that may have jumps: intervals that differ are halved until they are a tick.
    fn narrow(&mut self, least_jump: f64) -> Result<Vec<Tick>, LabError> {
        // Where chance changes nothing, nothing jumps.
        if least_jump == 0.0 {
            return Ok(Vec::new());
        }

        let worth = least_jump * WORTH_A_LOOK;
        let mut intervals = self.screen(worth);
        let mut ticks = Vec::new();
        while !intervals.is_empty() {
            // The largest first, and of equal ones the earlier.
            intervals.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1)));
            intervals.truncate(MAX_INTERVALS);

            let mut halves = Vec::new();
            for (size, from, to) in intervals {
                // Before the budget is asked for: what is narrowed down already costs no fork.
                if to - from <= 1 {
                    ticks.push((size, to));
                    continue;
                }
                if !self.goes_on() {
                    continue;
                }

                let middle = from + (to - from) / 2;
                for tick in [from, middle, to] {
                    self.reach(tick, FORKS)?;
                }
                // Both may stay: an interval can have several jumps, also such as cancel each other in it.
                for (from, to) in [(from, middle), (middle, to)] {
                    let size = mean(&self.differences(from, to)).abs();
                    if size >= worth {
                        halves.push((size, from, to));
                    }
                }
            }
            intervals = halves;
        }

        // Each test costs forks, and by Holm's correction makes the others harder to pass: only the largest are tested.
        ticks.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1)));
        ticks.truncate(MAX_JUMPS);
        let mut ticks: Vec<Tick> = ticks.into_iter().map(|(_, tick)| tick).collect();
        ticks.sort_unstable();
        Ok(ticks)
    }

    /// The intervals between points that may have jumps, with their sizes. Where the curve is flat on both sides of a jump, several points
    /// together show it that two of them do not.
    fn screen(&self, worth: f64) -> Vec<(f64, Tick, Tick)> {
        let mut ends: Vec<Tick> = self.points.keys().copied().collect();
        ends.push(self.run.last);

        let mut contrasts = Vec::new();
        for index in 1..ends.len() {
            let before = &ends[index.saturating_sub(WINDOW)..index];
            let after = &ends[index..(index + WINDOW).min(ends.len())];
            contrasts.push(self.contrast(before, after));
        }

        let mut intervals: Vec<(f64, Tick, Tick)> = Vec::new();
        for index in 0..contrasts.len() {
            let (from, to) = (ends[index], ends[index + 1]);
            let differences = self.differences(from, to);
            let alone = mean(&differences).abs();
            if alone >= worth && SignFlip::of(&differences).p <= LEVEL {
                intervals.push((alone, from, to));
            }

            // A jump shows in the contrasts beside its own as well, less clearly: only the clearest of them is taken.
            let (size, z) = contrasts[index];
            let near = &contrasts[index.saturating_sub(2)..(index + 3).min(contrasts.len())];
            let is_peak = near.iter().all(|(_, other)| *other <= z);
            if is_peak && z >= CLEAR_Z && size >= worth {
                // By chance the peak may be one interval beside the jump.
                let from = ends[index.saturating_sub(1)];
                let to = ends[(index + 2).min(ends.len() - 1)];
                intervals.push((size, from, to));
            }
        }
        merged(intervals)
    }

    /// How far the outcomes after some ticks are from those after others, and that in standard errors.
    fn contrast(&self, before: &[Tick], after: &[Tick]) -> (f64, f64) {
        let of = |ticks: &[Tick]| -> Vec<f64> {
            let outcomes = ticks.iter().filter_map(|tick| self.points.get(tick));
            outcomes.flatten().filter_map(ForkOutcome::number).collect()
        };
        let [before, after] = [of(before), of(after)];
        if before.is_empty() || after.is_empty() {
            return (0.0, 0.0);
        }

        let size = (mean(&after) - mean(&before)).abs();
        let error = |values: &[f64]| deviation(values) * deviation(values) / values.len() as f64;
        let variance = error(&before) + error(&after);
        // Where neither side varies, any difference is clear.
        let z = if variance > 0.0 {
            size / variance.sqrt()
        } else if size > 0.0 {
            f64::INFINITY
        } else {
            0.0
        };
        (size, z)
    }

    /// The jumps among these ticks.
    fn confirm(&mut self, ticks: &[Tick], least_jump: f64) -> Result<Vec<Jump>, LabError> {
        let mut sides = Vec::new();
        let mut p_values = Vec::new();
        for &tick in ticks {
            // What is left out here is not tested, so the correction below does not count it.
            if !self.goes_on() {
                break;
            }
            // It is the later end of an interval, so there is a tick before it.
            let before = self.fresh(tick - 1, CONFIRMING)?;
            let after = self.fresh(tick, CONFIRMING)?;
            let mut beyond = differences(&before, after.iter());
            // Chance in any tick changes the outcome a little: a jump must surely be more than that.
            let surely = mean(&beyond).signum() * least_jump * SURE_PART;
            for difference in &mut beyond {
                *difference -= surely;
            }
            p_values.push(SignFlip::of(&beyond).p);
            sides.push((tick, before, after));
        }

        let mut jumps = Vec::new();
        for ((tick, before, after), p) in sides.into_iter().zip(holm(&p_values)) {
            let change = mean(&differences(&before, after.iter()));
            // Surely more than a part of the least jump, by the test, and by the estimate at least all of it.
            if p > LEVEL || change.abs() < least_jump {
                continue;
            }

            let is_share = self.run.is_share;
            let mut jump = Jump {
                shown: DecisionJump {
                    tick,
                    before: outcomes_of(&before, is_share),
                    after: outcomes_of(&after, is_share),
                    events: (self.run.events)(tick),
                    cause: None,
                },
                p,
                tried: Vec::new(),
            };
            self.explain(&mut jump, &after, change)?;
            jumps.push(jump);
        }
        Ok(jumps)
    }

    /// Outcomes after a tick of forks that took no part in the search.
    fn fresh(&mut self, tick: Tick, forks: u64) -> Result<Vec<ForkOutcome>, LabError> {
        if tick >= self.run.last {
            return Ok(vec![self.run.recorded.into(); forks as usize]);
        }

        let numbers = FIRST_CONFIRMING..FIRST_CONFIRMING + forks;
        self.forks.play(&ForkPlan::After { tick }, numbers)
    }

    /// Tries each event of a tick, and each kind of chance, as the cause of its jump.
    fn explain(
        &mut self,
        jump: &mut Jump,
        after: &[ForkOutcome],
        change: f64,
    ) -> Result<(), LabError> {
        let tick = jump.shown.tick;
        let mut plans: Vec<(String, ForkPlan)> = Vec::new();
        for (what, event) in (self.run.candidates)(tick) {
            plans.push((what, ForkPlan::Without { tick, event }));
        }
        for kind in &self.run.kinds {
            let kind = kind.clone();
            plans.push((format!("chance of {kind}"), ForkPlan::KindAt { tick, kind }));
        }

        let mut p_values = Vec::new();
        let mut tried = Vec::new();
        for (what, plan) in plans {
            if !self.goes_on() {
                break;
            }
            // These numbers are the first of those of `after`, so both are compared fork by fork; the further ones have no pair.
            let numbers = FIRST_CONFIRMING..FIRST_CONFIRMING + TRYING;
            let without = self.forks.play(&plan, numbers)?;
            let restored = differences(after, without.iter());
            p_values.push(SignFlip::of(&restored).p);
            // 1 where the outcome is as it was before the tick, 0 where it is as after it.
            let gone = -mean(&restored) / change;
            tried.push((what, plan, without, gone));
        }

        let mut best: Option<(bool, f64, usize)> = None;
        for ((what, plan, without, gone), p) in tried.into_iter().zip(holm(&p_values)) {
            let is_event = matches!(plan, ForkPlan::Without { .. });
            let restores = p <= LEVEL && gone >= 0.5;
            // An event says more than the chance that it came from.
            let rank = (is_event, gone, jump.tried.len());
            let is_better = best.is_none_or(|best| (rank.0, rank.1) > (best.0, best.1));
            if restores && is_better {
                best = Some(rank);
            }

            // All of them, so that the place in this list is the one that `rank` keeps.
            jump.tried.push(TriedCause {
                what,
                plan,
                without: outcomes_of(&without, self.run.is_share),
                p,
                restores,
            });
        }
        jump.shown.cause = best.map(|(is_event, _, index)| DecisionCause {
            what: jump.tried[index].what.clone(),
            is_event,
            without: jump.tried[index].without,
        });
        Ok(())
    }

    /// What each kind of chance can change by itself.
    fn kinds(&mut self) -> Result<Vec<KindEffect>, LabError> {
        let mut effects = Vec::new();
        for kind in &self.run.kinds {
            if !self.goes_on() {
                break;
            }

            let plan = ForkPlan::KindAfter {
                tick: 0,
                kind: kind.clone(),
            };
            let outcomes = self.forks.play(&plan, 0..SCOUTS)?;
            // Whether the outcome is another one, not by how much: changes in both directions do not cancel.
            let recorded = ForkOutcome::from(self.run.recorded);
            let changed: Vec<ForkOutcome> = outcomes
                .into_iter()
                .map(|outcome| match outcome {
                    failed @ ForkOutcome::Failed(_) => failed,
                    outcome => ForkOutcome::Number(f64::from(u8::from(outcome != recorded))),
                })
                .collect();

            effects.push(KindEffect {
                kind: kind.to_string(),
                changed: outcomes_of(&changed, true),
            });
        }
        Ok(effects)
    }

    /// What the scenario plans, with how far the outcome is another one without it. Whether that matters is not said yet.
    fn planned(&mut self) -> Result<Vec<(PlannedEffect, f64)>, LabError> {
        let mut effects: Vec<(PlannedEffect, f64)> = Vec::new();
        let mut p_values = Vec::new();
        for (tick, what, event) in &self.run.planned {
            if !self.goes_on() {
                break;
            }

            let with = self.fresh(tick.saturating_sub(1), TRYING)?;
            let plan = ForkPlan::Without {
                tick: *tick,
                event: event.clone(),
            };
            let numbers = FIRST_CONFIRMING..FIRST_CONFIRMING + TRYING;
            let without = self.forks.play(&plan, numbers)?;
            let change = differences(&with, without.iter());
            p_values.push(SignFlip::of(&change).p);

            // Its p value is corrected below, when all are known.
            let effect = PlannedEffect {
                what: what.clone(),
                tick: *tick,
                with: outcomes_of(&with, self.run.is_share),
                without: outcomes_of(&without, self.run.is_share),
                p: 1.0,
                matters: false,
            };
            effects.push((effect, mean(&change)));
        }

        for ((effect, _), p) in effects.iter_mut().zip(holm(&p_values)) {
            effect.p = p;
        }
        Ok(effects)
    }

    fn curve(&self) -> Vec<DecisionPoint> {
        let is_share = self.run.is_share;
        let mut curve: Vec<DecisionPoint> = self
            .points
            .iter()
            .map(|(&tick, outcomes)| DecisionPoint {
                tick,
                outcome: outcomes_of(outcomes, is_share),
            })
            .collect();

        curve.push(DecisionPoint {
            tick: self.run.last,
            outcome: ForkOutcomes {
                n: u64::from(self.run.recorded.is_some()),
                value: self.run.recorded,
                low: None,
                high: None,
                failed: 0,
            },
        });
        curve
    }
}

/// Intervals that overlap as one.
fn merged(mut intervals: Vec<(f64, Tick, Tick)>) -> Vec<(f64, Tick, Tick)> {
    // By their beginnings, so that each can overlap only the last of those that were merged.
    intervals.sort_by_key(|(_, from, to)| (*from, *to));

    let mut merged: Vec<(f64, Tick, Tick)> = Vec::new();
    for (size, from, to) in intervals {
        match merged.last_mut() {
            Some(last) if from < last.2 => {
                last.0 = last.0.max(size);
                last.2 = last.2.max(to);
            }
            _ => merged.push((size, from, to)),
        }
    }
    merged
}

/// The differences of pairs of which both have an outcome.
fn differences<'a>(
    before: &[ForkOutcome],
    after: impl Iterator<Item = &'a ForkOutcome>,
) -> Vec<f64> {
    let pairs = before.iter().zip(after);
    pairs
        .filter_map(|(before, after)| Some(after.number()? - before.number()?))
        .collect()
}

/// The mean; 0 without values.
fn mean(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.iter().sum::<f64>() / values.len() as f64
}

/// The standard deviation; 0 of fewer than two values.
fn deviation(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let mean = mean(values);
    let squares: f64 = values
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use protocol::random::{stream, unit};

    use super::*;

    /// Forks whose outcomes are 1 with a probability that depends on the tick alone.
    struct Coins<'a> {
        case: u64,
        probability: &'a dyn Fn(Tick) -> f64,
    }

    impl Forks for Coins<'_> {
        fn play(
            &mut self,
            plan: &ForkPlan,
            numbers: Range<u64>,
        ) -> Result<Vec<ForkOutcome>, LabError> {
            let probability = (self.probability)(plan.shared());
            let outcomes = numbers.map(|number| {
                let name = format!("{}/{plan:?}/{number}", self.case);
                let is_one = unit(&mut stream(1, &name)) < probability;
                ForkOutcome::Number(f64::from(u8::from(is_one)))
            });
            Ok(outcomes.collect())
        }

        fn has_budget(&self) -> bool {
            true
        }
    }

    fn jumps(case: u64, recorded: f64, probability: &dyn Fn(Tick) -> f64) -> Vec<Jump> {
        let run = SearchedRun {
            last: 1200,
            recorded: Some(recorded),
            is_share: true,
            kinds: Vec::new(),
            planned: Vec::new(),
            candidates: &|_| Vec::new(),
            events: &|_| Vec::new(),
        };
        search(&run, &mut Coins { case, probability })
            .unwrap()
            .jumps
    }

    const CASES: u64 = 60;

    #[test]
    fn jumps_are_found_at_their_ticks() {
        let mut found = 0;
        for case in 0..CASES {
            let at = 17 + 19 * case;
            let probability = |tick: Tick| match tick {
                tick if tick < at => 0.3,
                1200.. => 1.0,
                _ => 0.7,
            };
            // The rest is decided by chance in the last tick.
            let jumps = jumps(case, 1.0, &probability);
            found += u64::from(jumps.iter().any(|jump| jump.shown.tick == at));
        }
        assert!(found * 100 >= CASES * 95, "{found} of {CASES}");
    }

    #[test]
    fn where_nothing_jumps_no_jump_is_named() {
        let mut wrong = 0;
        for case in 0..CASES {
            // From even chances to certainty, or without any change to the last tick.
            let drift = |tick: Tick| 0.5 + 0.5 * tick as f64 / 1200.0;
            wrong += u64::from(!jumps(case, 1.0, &drift).is_empty());
        }
        assert!(wrong * 100 <= CASES * 5, "{wrong} of {CASES}");
    }
}
