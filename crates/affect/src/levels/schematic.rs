//! The level of prototypes: an emotion makes a set of behaviors active.

use crate::label::EmotionLabel;

/// Which behaviors each emotion makes active.
///
/// ```
/// use affect::StandardEmotion::{Frustrated, Happy};
/// use affect::levels::Schematic;
/// let level = Schematic::new(vec!["wander", "serve"]).with(Frustrated, vec!["intercept"]);
/// assert_eq!(level.active(Happy), ["wander", "serve"]); // no prototype of its own
/// assert_eq!(level.active(Frustrated), ["intercept"]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schematic<E, B> {
    neutral: Vec<B>,
    prototypes: Vec<(E, Vec<B>)>,
}

impl<E: EmotionLabel, B> Schematic<E, B> {
    /// No prototype yet: every emotion makes the neutral set active.
    pub fn new(neutral: Vec<B>) -> Self {
        Self {
            neutral,
            prototypes: Vec::new(),
        }
    }

    /// Adds the prototype of an emotion, or replaces it.
    #[must_use]
    pub fn with(mut self, emotion: E, behaviors: Vec<B>) -> Self {
        self.prototypes.retain(|(other, _)| *other != emotion);
        self.prototypes.push((emotion, behaviors));
        self
    }

    /// The behaviors that this emotion makes active.
    pub fn active(&self, emotion: E) -> &[B] {
        let prototype = self.prototypes.iter().find(|(other, _)| *other == emotion);
        prototype.map_or(&self.neutral, |(_, behaviors)| behaviors)
    }

    /// The behaviors that are active for an emotion without prototype, or when emotion has no say.
    pub fn neutral(&self) -> &[B] {
        &self.neutral
    }
}
