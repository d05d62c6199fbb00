//! The states from which a hunt goes on: those that a run was the first to reach.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::Tick;

use super::coverage::{Feature, MAX_FEATURES};
use super::draw::MAX_STEPS;
use super::fault::PlannedFault;
use super::sent::{Link, Onset};
use super::trial::{PlayedPlan, SavedRun, TrialPlan, TrialResult};

/// Most states; a hunt that has as many goes on from these.
const MAX_STATES: usize = 4096;
/// Most states that are kept in memory. Runs from the others are played from their beginning.
const MAX_SAVED: usize = 256;
/// Most texts of the commands of a link that count as states: robots write numbers into them.
const MAX_TEXTS: usize = 32;

/// A state that a run was the first to reach.
#[derive(Debug)]
pub(super) struct ReachedState {
    /// The faults that had begun by then.
    pub(super) faults: Vec<PlannedFault>,
    /// When it was reached.
    pub(super) onset: Onset,
    /// The run at that time, if it could be copied.
    pub(super) saved: Option<Arc<SavedRun>>,
    /// What was new in that tick.
    features: Vec<Feature>,
    /// Number of plans that have gone on from it.
    chosen: u64,
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct Corpus {
    states: Vec<ReachedState>,
    /// How many plans have reached each feature anew: not before the state from which they went on.
    reached: BTreeMap<Feature, u64>,
    /// Number of texts on each link that count.
    texts: BTreeMap<Link, usize>,
    saved: usize,
}

impl Corpus {
    /// Whether no run has reached a feature that makes a state.
    pub(super) fn is_new(&self, feature: &Feature) -> bool {
        if !feature.is_state() || self.reached.contains_key(feature) {
            return false;
        }
        match feature {
            Feature::Message { link, .. } => {
                self.texts.get(link).copied().unwrap_or_default() < MAX_TEXTS
            }
            _ => self.reached.len() < MAX_FEATURES,
        }
    }

    /// The state to go on from: a rare one from which few plans have gone on. A state from which as many plans have gone on as
    /// from another one, and that ten times fewer plans have reached, is chosen ten times as often.
    pub(super) fn choose(&mut self) -> Option<&ReachedState> {
        let reached = &self.reached;
        let rarity = |state: &ReachedState| {
            let counts = state.features.iter().filter_map(|one| reached.get(one));
            counts.min().copied().unwrap_or(1)
        };
        let states = self.states.iter_mut().rev();
        let next = states.min_by_key(|state| rarity(state) * (state.chosen + 1))?;
        next.chosen += 1;
        Some(next)
    }

    /// Adds what a plan has reached.
    pub(super) fn add(&mut self, plan: &TrialPlan, played: &mut PlayedPlan) {
        let result = &played.result;
        let mut new: BTreeMap<Tick, Vec<Feature>> = BTreeMap::new();
        for (feature, tick) in &result.features {
            if *tick <= plan.after {
                continue;
            }
            // A state from which nothing can go on is left to a plan with fewer faults.
            if self.is_new(feature) && begun(plan, *tick, result).len() < MAX_STEPS {
                new.entry(*tick).or_default().push(feature.clone());
                if let Feature::Message { link, .. } = feature {
                    *self.texts.entry(link.clone()).or_default() += 1;
                }
                self.reached.insert(feature.clone(), 0);
            }
            if let Some(count) = self.reached.get_mut(feature) {
                *count += 1;
            }
        }

        for (tick, features) in new {
            // Nothing goes on from the last tick of a run.
            if tick >= result.ticks || self.states.len() >= MAX_STATES {
                continue;
            }
            let saved = played.saved.remove(&tick);
            let saved = saved.filter(|_| self.saved < MAX_SAVED);
            self.saved += usize::from(saved.is_some());

            let faults = begun(plan, tick, result);
            self.states.push(ReachedState {
                faults,
                onset: Onset::of(&result.sent, tick),
                saved,
                features,
                chosen: 0,
            });
        }
    }
}

/// The faults of a plan that had begun by a tick of its run.
fn begun(plan: &TrialPlan, tick: Tick, result: &TrialResult) -> Vec<PlannedFault> {
    let mut faults = plan.case.faults.clone();
    faults.retain(|fault| fault.has_begun(tick, &result.sent));
    faults
}

#[cfg(test)]
mod tests {
    use protocol::RobotName;

    use super::*;
    use crate::case::FaultCase;

    fn change(to: &str) -> Feature {
        Feature::Behavior {
            robot: RobotName::new("A").unwrap(),
            from: "IDLE".to_owned(),
            to: to.to_owned(),
        }
    }

    /// A plan that goes on after a tick, and reaches these states in these ticks.
    fn played(after: Tick, seen: &[(&str, Tick)]) -> (TrialPlan, PlayedPlan) {
        let plan = TrialPlan {
            case: FaultCase::default(),
            after,
            saved: None,
        };
        let features = seen.iter().map(|(to, tick)| (change(to), *tick));
        let result = TrialResult {
            ticks: 100,
            features: features.collect(),
            ..TrialResult::default()
        };
        let saved = BTreeMap::new();
        (plan, PlayedPlan { result, saved })
    }

    fn corpus_of(plans: &[(Tick, &[(&str, Tick)])]) -> Corpus {
        let mut corpus = Corpus::default();
        for (after, seen) in plans {
            let (plan, mut played) = played(*after, seen);
            corpus.add(&plan, &mut played);
        }
        corpus
    }

    #[test]
    fn a_state_is_new_once_and_before_the_last_tick() {
        let corpus = corpus_of(&[(0, &[("X", 5), ("Y", 5), ("Z", 100)]), (0, &[("X", 3)])]);
        let ticks: Vec<Tick> = corpus.states.iter().map(|one| one.onset.after).collect();
        assert_eq!(ticks, [5], "X and Y are one state, Z is the last tick");
        assert!(!corpus.is_new(&change("X")) && corpus.is_new(&change("W")));
        assert!(!corpus.is_new(&Feature::Fault {
            kind: crate::fault::FaultClass::Lose
        }));
    }

    #[test]
    fn a_state_from_which_nothing_can_go_on_is_left_to_another_plan() {
        let (mut plan, mut result) = played(0, &[("X", 5)]);
        let reseed = |at| PlannedFault::Reseed {
            at,
            seed: 1,
            of: Vec::new(),
        };
        plan.case = FaultCase::of(
            (1..=MAX_STEPS as Tick)
                .map(|at| reseed(at.min(4)))
                .collect(),
        );
        assert_eq!(plan.case.faults.len(), MAX_STEPS);
        let mut corpus = Corpus::default();
        corpus.add(&plan, &mut result);
        assert!(corpus.states.is_empty() && corpus.is_new(&change("X")));

        let (plan, mut result) = played(0, &[("X", 7)]);
        corpus.add(&plan, &mut result);
        assert_eq!(corpus.states[0].onset.after, 7);
    }

    #[test]
    fn what_was_reached_before_a_plan_goes_on_does_not_count() {
        let corpus = corpus_of(&[(0, &[("X", 5)]), (5, &[("X", 5), ("Y", 9)])]);
        assert_eq!(corpus.reached[&change("X")], 1);
        assert_eq!(corpus.reached[&change("Y")], 1);
    }

    /// X is reached by all plans, Y by one of ten.
    #[test]
    fn rare_states_are_chosen_more_often() {
        let all: [(Tick, &[(&str, Tick)]); 10] = [(0, &[("X", 5)]); 10];
        let mut plans = all.to_vec();
        plans[3] = (0, &[("X", 5), ("Y", 8)]);
        let mut corpus = corpus_of(&plans);
        let mut counts: BTreeMap<Tick, u64> = BTreeMap::new();
        for _ in 0..110 {
            let state = corpus.choose().unwrap();
            *counts.entry(state.onset.after).or_default() += 1;
        }
        assert_eq!(counts, BTreeMap::from([(5, 10), (8, 100)]));
    }

    #[test]
    fn the_texts_of_a_link_are_bounded() {
        let mut corpus = Corpus::default();
        let link = Link {
            from: RobotName::new("A").unwrap(),
            to: RobotName::new("B").unwrap(),
        };
        let message = |number: usize| Feature::Message {
            link: link.clone(),
            text: format!("at {number}"),
            fate: crate::coverage::CommandFate::Delivered,
        };
        let (plan, mut played) = played(0, &[]);
        let ticks = (0..100).map(|number| (message(number), 1 + number as Tick / 2));
        played.result.features = ticks.collect();
        corpus.add(&plan, &mut played);
        assert_eq!(corpus.reached.len(), MAX_TEXTS);
        assert!(!corpus.is_new(&message(1000)));
    }
}
