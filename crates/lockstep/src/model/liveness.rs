//! Whether what must come stays within reach, by steps that happen when nothing goes wrong any more.

use std::collections::{BTreeMap, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};

use protocol::messages::OnLate;
use stateright::Model;

use super::star::{ModelState, ModelStep, Star};

/// A state from which something that must come is out of reach.
pub(super) struct Stuck {
    pub(super) what: &'static str,
    pub(super) steps: Vec<ModelStep>,
}

/// All states, as far as the search backwards needs them.
#[derive(Default)]
struct Graph {
    numbers: BTreeMap<u64, u32>,
    /// How each state was reached first.
    reached: Vec<Option<(u32, ModelStep)>>,
    /// From where each state is reached by a fair step.
    before: Vec<Vec<u32>>,
    /// Where the run is over.
    ends: Vec<u32>,
    /// Where the run is over, all robots reported in the last tick, and no replaced process is connected.
    full_ends: Vec<u32>,
    /// Which states are so early that a full end must be within reach.
    is_early: Vec<bool>,
}

impl Graph {
    fn number(&mut self, state: &ModelState) -> (u32, bool) {
        let mut hasher = DefaultHasher::new();
        state.hash(&mut hasher);
        let next = self.reached.len() as u32;
        let number = *self.numbers.entry(hasher.finish()).or_insert(next);

        (number, number == next)
    }

    fn add(&mut self, star: &Star, state: &ModelState, reached: Option<(u32, ModelStep)>) {
        let number = self.reached.len() as u32;
        self.reached.push(reached);
        self.before.push(Vec::new());

        let ticks_to_return = if star.on_late == OnLate::Continue {
            2
        } else {
            1
        };
        let has_time = state.simulation.tick + ticks_to_return <= star.last_tick;
        self.is_early.push(has_time);

        let is_full = state.simulation.is_full && !state.has_replaced_process();
        // A violation is the other search's business.
        let is_violated = state.violation.is_some();
        if state.simulation.is_over || is_violated {
            self.ends.push(number);
            if is_full || is_violated {
                self.full_ends.push(number);
            }
        }
    }

    /// A state, of those meant, from which none of the goals can be reached.
    fn stuck(&self, goals: &[u32], is_meant: impl Fn(usize) -> bool) -> Option<usize> {
        let mut can_reach = vec![false; self.reached.len()];
        let mut open: VecDeque<u32> = goals.iter().copied().collect();
        while let Some(number) = open.pop_front() {
            if !std::mem::replace(&mut can_reach[number as usize], true) {
                open.extend(&self.before[number as usize]);
            }
        }

        (0..can_reach.len()).find(|number| is_meant(*number) && !can_reach[*number])
    }

    fn steps_to(&self, number: usize) -> Vec<ModelStep> {
        let mut steps = Vec::new();
        let mut at = number;
        while let Some((from, step)) = &self.reached[at] {
            steps.push(step.clone());
            at = *from as usize;
        }
        steps.reverse();
        steps
    }
}

/// The shortest way to a state from which something that must come is out of reach.
pub(super) fn stuck(star: &Star) -> Option<Stuck> {
    let mut graph = Graph::default();
    let mut open = VecDeque::new();
    for state in star.init_states() {
        let (number, _) = graph.number(&state);
        graph.add(star, &state, None);
        open.push_back((number, state));
    }

    let mut steps = Vec::new();
    while let Some((number, state)) = open.pop_front() {
        star.actions(&state, &mut steps);
        for step in steps.drain(..) {
            let Some(next) = star.next_state(&state, step.clone()) else {
                continue;
            };
            let (to, is_new) = graph.number(&next);
            if is_new {
                graph.add(star, &next, Some((number, step.clone())));
                open.push_back((to, next));
            }
            if step.is_fair() {
                graph.before[to as usize].push(number);
            }
        }
    }

    let end = graph
        .stuck(&graph.ends, |_| true)
        .map(|number| ("the end is out of reach", number));
    let full = || {
        let is_early = |number: usize| graph.is_early[number];
        let number = graph.stuck(&graph.full_ends, is_early)?;
        Some(("an end with all robots is out of reach", number))
    };
    end.or_else(full).map(|(what, number)| Stuck {
        what,
        steps: graph.steps_to(number),
    })
}
