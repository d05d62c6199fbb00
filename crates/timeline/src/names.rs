//! The names of the states of a run.

use crate::span::StateKind;

/// Most names of a kind that are kept: a robot can publish any number of names.
const MAX_NAMES: usize = 64;

/// The names of the emotions and the behaviors of a run, each once, in the order in which they first occurred: so a name that is
/// new changes nothing about those before it. The first 64 of each kind are kept.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StateOrder {
    emotions: Vec<String>,
    behaviors: Vec<String>,
}

impl StateOrder {
    /// The names of a kind.
    #[must_use]
    pub fn of(&self, kind: StateKind) -> &[String] {
        match kind {
            StateKind::Emotion => &self.emotions,
            StateKind::Behavior => &self.behaviors,
        }
    }

    /// Adds a name, unless it is known.
    pub fn add(&mut self, kind: StateKind, name: &str) {
        let names = match kind {
            StateKind::Emotion => &mut self.emotions,
            StateKind::Behavior => &mut self.behaviors,
        };
        if names.len() < MAX_NAMES && !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }

    /// Adds the names of another run that are not known.
    pub fn add_all(&mut self, other: &Self) {
        for kind in [StateKind::Emotion, StateKind::Behavior] {
            for name in other.of(kind) {
                self.add(kind, name);
            }
        }
    }
}
