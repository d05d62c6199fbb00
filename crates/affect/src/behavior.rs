//! The behavior state generator (BSG): a table of guarded transitions.
//!
//! Guards receive a shared reference to a context, which holds the progress measures and a copy of the current
//! [`Feeling`]. A BSG therefore cannot change the emotion. The context is a snapshot taken at the start of the step
//! and is the same for all rows: guards see the effects of actions one step later, so rows cannot depend on each
//! other in hidden ways.
//!
//! # Evaluation
//!
//! Rows are evaluated from top to bottom. A row *applies* if it includes the current state and its guard holds. The
//! actions of a row that applies are performed. Evaluation then continues with the next row for [`Then::Stay`],
//! while [`Then::Go`] changes the state and ends the step. Several `Stay` rows can thus act in one step, but only
//! the first `Go` row takes effect, and rows below it are not evaluated. The state does not change if no `Go` row
//! applies.
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
//!     when: |c| { c.feeling.intensity = Intensity::MAX; true }, // does not compile: a BSG cannot change the emotion
//!     act: &[],
//!     then: Then::Stay,
//! }];
//! ```
//!
//! [`Feeling`]: crate::Feeling

use crate::scalar::has_elapsed;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What happens after the actions of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Then<S> {
    /// Continue with the next row.
    Stay,
    /// Change to this state, which may be the current one, and stop.
    Go(S),
}

/// One row of a behavior table.
pub struct Row<S: 'static, C: 'static, A: 'static> {
    /// The states in which the row can apply.
    pub from: &'static [S],
    /// The guard.
    pub when: fn(&C) -> bool,
    /// Actions to perform if the row applies, in order.
    pub act: &'static [A],
    /// What happens after the actions.
    pub then: Then<S>,
}

/// The result of evaluating a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision<S, A> {
    /// Actions of all rows that applied, in order. The robot performs them.
    pub actions: Vec<A>,
    /// The next state, if a `Go` row applied.
    pub next: Option<S>,
    /// Indices of the rows that applied, which explain the decision.
    pub rows: Vec<usize>,
}

/// Evaluates a table once, without side effects.
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
        let applies = row.from.contains(state) && (row.when)(context);
        if !applies {
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

/// The state of a behavior generator between steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BehaviorState<S> {
    current: S,
    lasting_s: f64,
}

/// A behavior table with its current state.
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

    /// How long the current behavior has lasted, in seconds.
    pub fn lasting_s(&self) -> f64 {
        self.state.lasting_s
    }

    /// Whether the current behavior has lasted at least `seconds`.
    ///
    /// Prefer this to comparing [`lasting_s`](Self::lasting_s), because sums of steps such as 0.1 s are not exact.
    pub fn has_lasted(&self, seconds: f64) -> bool {
        has_elapsed(self.state.lasting_s, seconds)
    }

    /// Advances the time by `dt_s` seconds.
    ///
    /// Call this before building the context, so that guards see how long the behavior has lasted.
    pub fn advance(&mut self, dt_s: f64) {
        self.state.lasting_s += dt_s;
    }

    /// Evaluates the table and changes to the next state. `Go` to the current state resets its time.
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

    /// The state to save.
    pub fn state(&self) -> &BehaviorState<S> {
        &self.state
    }

    /// Resumes from a saved state.
    pub fn restore(&mut self, state: BehaviorState<S>) {
        self.state = state;
    }
}

// Derived implementations would add bounds on contexts and actions, although no value of them is stored.

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
    fn stay_rows_fall_through_and_the_first_go_row_wins() {
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
        assert!(bsg.has_lasted(2.0), "{}", bsg.lasting_s());
        assert!(!bsg.has_lasted(2.01), "{}", bsg.lasting_s());

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
