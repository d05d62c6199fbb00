//! The schematic level, which selects the active behaviors by emotion.

use crate::label::EmotionLabel;

/// The set of active behaviors for each emotion.
///
/// ```
/// use affect::StandardEmotion::{Frustrated, Happy};
/// use affect::levels::Schematic;
/// let level = Schematic::new(vec!["wander", "serve"]).with(Frustrated, vec!["intercept"]);
/// assert_eq!(level.active(Happy), ["wander", "serve"]); // no prototype: the neutral set
/// assert_eq!(level.active(Frustrated), ["intercept"]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schematic<E, B> {
    neutral: Vec<B>,
    prototypes: Vec<(E, Vec<B>)>,
}

impl<E: EmotionLabel, B> Schematic<E, B> {
    /// Creates a level without prototypes, in which every emotion activates the neutral set.
    pub fn new(neutral: Vec<B>) -> Self {
        Self {
            neutral,
            prototypes: Vec::new(),
        }
    }

    /// Adds or replaces the prototype of an emotion.
    #[must_use]
    pub fn with(mut self, emotion: E, behaviors: Vec<B>) -> Self {
        self.prototypes.retain(|(other, _)| *other != emotion);
        self.prototypes.push((emotion, behaviors));
        self
    }

    /// The behaviors that are active under this emotion.
    pub fn active(&self, emotion: E) -> &[B] {
        let prototype = self.prototypes.iter().find(|(other, _)| *other == emotion);
        prototype.map_or(&self.neutral, |(_, behaviors)| behaviors)
    }

    /// The behaviors that are active under an emotion without a prototype, or when this level is disabled.
    pub fn neutral(&self) -> &[B] {
        &self.neutral
    }
}
