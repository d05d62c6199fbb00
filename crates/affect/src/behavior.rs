//! The behavior state generator (BSG): a table of guarded transitions.
//!
//! A guard sees a context by shared reference: the progress measures, and the current [`Feeling`], which is a
//! copy. So a BSG cannot write emotion. The context is the snapshot from the start of the step, and stays the
//! same for all rows: what an action changes is seen by guards one step later, and rows cannot depend on
//! each other in hidden ways.
//!
//! **Meaning of a table.** Rows are read from the top. A row *applies* if it is for the current state and
//! its guard holds. An applying row has its actions performed; then [`Then::Stay`] reads on, and
//! [`Then::Go`] moves to the next state and ends the step. So any number of rows that stay may act in a step,
//! the first row that goes wins, and rows below it are not read. Without a row that goes, the state stays.
//!
//! ```
//! use affect::StandardEmotion::{self, Confident, Frustrated};
//! use affect::behavior::{BehaviorGenerator, Row, Then::{Go, Stay}};
//!
//! #[derive(Debug, Clone, PartialEq)]
//! enum State { Serve, Search }
//! #[derive(Debug, Clone, PartialEq)]
//! enum Act { Call, Sing }
//! struct Context { emotion: StandardEmotion, has_called: bool, is_found: bool }
//! use {Act::*, State::*};
//!
//! const TABLE: &[Row<State, Context, Act>] = &[
//!     Row { from: &[Serve], when: |c| c.emotion.reaches(Confident) && !c.has_called, act: &[Call], then: Stay },
//!     Row { from: &[Serve], when: |c| c.emotion.reaches(Frustrated), act: &[], then: Go(Search) },
//!     Row { from: &[Search], when: |c| c.is_found, act: &[Sing], then: Go(Serve) },
//! ];
//!
//! let mut bsg = BehaviorGenerator::new(TABLE, Serve);
//! let decision = bsg.update(&Context { emotion: Frustrated, has_called: false, is_found: false });
//! assert_eq!(decision.actions, [Call]);
//! assert_eq!(bsg.current(), &Search);
//! ```
//!
//! ```compile_fail,E0594
//! use affect::{Feeling, Intensity, StandardEmotion};
//! use affect::behavior::{Row, Then};
//! struct Context { feeling: Feeling<StandardEmotion> }
//! const TABLE: &[Row<u8, Context, u8>] = &[Row {
//!     from: &[0],
//!     when: |c| { c.feeling.intensity = Intensity::MAX; true }, // a BSG never writes emotion: does not compile
//!     act: &[],
//!     then: Then::Stay,
//! }];
//! ```
//!
//! [`Feeling`]: crate::Feeling

use crate::scalar::has_elapsed;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What follows when a row applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Then<S> {
    /// Read on with the next row.
    Stay,
    /// Move to this state (which may be the current one) and read no further.
    Go(S),
}

/// One row of a behavior table.
pub struct Row<S: 'static, C: 'static, A: 'static> {
    /// The states in which the row counts.
    pub from: &'static [S],
    /// The condition.
    pub when: fn(&C) -> bool,
    /// What to do if it holds, in this order.
    pub act: &'static [A],
    /// Where that leads.
    pub then: Then<S>,
}

/// What a step of the table decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision<S, A> {
    /// The actions of all rows that applied, in order. Performing them is the robot's part.
    pub actions: Vec<A>,
    /// The state to go to, if a row went.
    pub next: Option<S>,
    /// Indices of the rows that applied: why this was decided.
    pub rows: Vec<usize>,
}

/// Reads a table once, without changing anything.
pub fn decide<S: Clone + PartialEq, C, A: Clone>(
    rows: &'static [Row<S, C, A>],
    state: &S,
    context: &C,
) -> Decision<S, A> {
    let mut decision = Decision {
        actions: Vec::new(),
        next: None,
        rows: Vec::new(),
    };
    for (index, row) in rows.iter().enumerate() {
        if !(row.from.contains(state) && (row.when)(context)) {
            continue;
        }
        decision.actions.extend_from_slice(row.act);
        decision.rows.push(index);
        if let Then::Go(next) = &row.then {
            decision.next = Some(next.clone());
            break;
        }
    }
    decision
}

/// All that a behavior generator remembers from one step to the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BehaviorState<S> {
    current: S,
    lasting_s: f64,
}

/// A table and the state it has led to. Owns the behavior, and nothing else.
pub struct BehaviorGenerator<S: 'static, C: 'static, A: 'static> {
    rows: &'static [Row<S, C, A>],
    state: BehaviorState<S>,
}

impl<S: Clone + PartialEq, C, A: Clone> BehaviorGenerator<S, C, A> {
    /// A generator in the state `start`.
    pub fn new(rows: &'static [Row<S, C, A>], start: S) -> Self {
        Self {
            rows,
            state: BehaviorState {
                current: start,
                lasting_s: 0.0,
            },
        }
    }

    /// The current behavior.
    pub fn current(&self) -> &S {
        &self.state.current
    }

    /// For how long, in seconds, it has lasted.
    pub fn lasting_s(&self) -> f64 {
        self.state.lasting_s
    }

    /// Whether it has lasted `seconds` or more; use this and not a comparison, because sums of steps
    /// such as 0.1 s are not exact.
    pub fn has_lasted(&self, seconds: f64) -> bool {
        has_elapsed(self.state.lasting_s, seconds)
    }

    /// Lets `dt_s` seconds pass. Belongs before the context is made, so that a guard can ask how long the
    /// behavior has lasted by now.
    pub fn advance(&mut self, dt_s: f64) {
        self.state.lasting_s += dt_s;
    }

    /// Decides, and goes where the decision leads. Going to the current state starts its time anew.
    pub fn update(&mut self, context: &C) -> Decision<S, A> {
        let decision = decide(self.rows, &self.state.current, context);
        if let Some(next) = &decision.next {
            self.state = BehaviorState {
                current: next.clone(),
                lasting_s: 0.0,
            };
        }
        decision
    }

    /// All that is to be saved of it.
    pub fn state(&self) -> &BehaviorState<S> {
        &self.state
    }

    /// Continues from a saved state.
    pub fn restore(&mut self, state: BehaviorState<S>) {
        self.state = state;
    }
}

// Derived implementations would ask the same of contexts and actions, of which nothing is owned.

impl<S: Clone, C, A> Clone for BehaviorGenerator<S, C, A> {
    fn clone(&self) -> Self {
        Self {
            rows: self.rows,
            state: self.state.clone(),
        }
    }
}

impl<S: fmt::Debug, C, A> fmt::Debug for BehaviorGenerator<S, C, A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BehaviorGenerator")
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Then::{Go, Stay};

    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    enum State {
        A,
        B,
    }
    use State::{A, B};

    struct Context {
        need: bool,
        near: bool,
    }

    const ROWS: &[Row<State, Context, &str>] = &[
        Row {
            from: &[A, B],
            when: |c| c.need,
            act: &["note need"],
            then: Stay,
        },
        Row {
            from: &[A],
            when: |c| c.near,
            act: &["greet", "give"],
            then: Go(B),
        },
        Row {
            from: &[A],
            when: |c| c.near,
            act: &["never read"],
            then: Go(A),
        },
        Row {
            from: &[A],
            when: |c| c.need,
            act: &["call"],
            then: Stay,
        },
        Row {
            from: &[B],
            when: |c| !c.near,
            act: &[],
            then: Go(A),
        },
    ];

    fn decided(
        state: State,
        need: bool,
        near: bool,
    ) -> (Vec<&'static str>, Option<State>, Vec<usize>) {
        let decision = decide(ROWS, &state, &Context { need, near });
        (decision.actions, decision.next, decision.rows)
    }

    #[test]
    fn rows_that_stay_fall_through_and_the_first_that_goes_wins() {
        assert_eq!(
            decided(A, true, true),
            (vec!["note need", "greet", "give"], Some(B), vec![0, 1])
        );
        assert_eq!(
            decided(A, true, false),
            (vec!["note need", "call"], None, vec![0, 3])
        );
        assert_eq!(decided(B, false, true), (vec![], None, vec![]));
        assert_eq!(
            decided(B, true, false),
            (vec!["note need"], Some(A), vec![0, 4])
        );
    }

    #[test]
    fn time_counts_since_the_state_was_entered() {
        let mut bsg = BehaviorGenerator::new(ROWS, A);
        for _ in 0..20 {
            bsg.advance(0.1);
        }
        assert!(
            bsg.has_lasted(2.0) && !bsg.has_lasted(2.01),
            "{}",
            bsg.lasting_s()
        );
        bsg.update(&Context {
            need: false,
            near: true,
        });
        assert_eq!((bsg.current(), bsg.lasting_s()), (&B, 0.0));
    }

    #[test]
    fn a_saved_state_continues() {
        let mut bsg = BehaviorGenerator::new(ROWS, A);
        bsg.advance(0.3);
        let saved = serde_json::to_string(bsg.state()).unwrap();
        let mut other = BehaviorGenerator::new(ROWS, B);
        other.restore(serde_json::from_str(&saved).unwrap());
        assert_eq!(other.state(), bsg.state());
    }
}
