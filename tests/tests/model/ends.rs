//! Whether the end of a run stays within reach.

use std::collections::{BTreeMap, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};

use stateright::Model;

use crate::machine::State;
use crate::protocol::{Action, Protocol};

fn fingerprint(state: &State) -> u64 {
    let mut hasher = DefaultHasher::new();
    state.hash(&mut hasher);
    hasher.finish()
}

/// The shortest way to a state from which no end can be reached; `None` if there is no such state.
pub(crate) fn unending(model: &Protocol) -> Option<Vec<Action>> {
    let mut numbers: BTreeMap<u64, usize> = BTreeMap::new();
    // Of each state: how it was reached first, and from where it can be reached.
    let (mut reached, mut before, mut ends) = (Vec::new(), Vec::<Vec<u32>>::new(), VecDeque::new());
    let mut open = VecDeque::new();
    for state in model.init_states() {
        numbers.insert(fingerprint(&state), reached.len());
        reached.push(None);
        before.push(Vec::new());
        open.push_back((0, state));
    }
    while let Some((number, state)) = open.pop_front() {
        if state.simulator.is_over {
            ends.push_back(number);
        }
        let mut actions = Vec::new();
        model.actions(&state, &mut actions);
        for action in actions {
            let Some(next) = model.next_state(&state, action) else {
                continue;
            };
            let to = *numbers.entry(fingerprint(&next)).or_insert_with(|| {
                reached.push(Some((number, action)));
                before.push(Vec::new());
                open.push_back((reached.len() - 1, next));
                reached.len() - 1
            });
            before[to].push(number as u32);
        }
    }
    let mut can_end = vec![false; reached.len()];
    while let Some(number) = ends.pop_front() {
        if !std::mem::replace(&mut can_end[number], true) {
            ends.extend(before[number].iter().map(|from| *from as usize));
        }
    }
    let stuck = can_end.iter().position(|can_end| !can_end)?;
    let mut way = Vec::new();
    let mut at = stuck;
    while let Some((from, action)) = reached[at] {
        way.push(action);
        at = from;
    }
    way.reverse();
    Some(way)
}
