//! A robot's emotion: a generator that an experiment can switch off or put a script in the place of, whose state can be
//! saved and restored.

use affect::{
    DynamicGenerator, EmotionGenerator, EmotionLabel, EmotionState, Feeling, RuleGenerator,
    StandardEmotion,
};
use robot::Cars;

use crate::script::Script;
use crate::switch::Switch;

/// The emotion that a robot without emotions publishes.
pub(crate) const NEUTRAL: &str = "NEUTRAL";

/// A generator whose state can be saved and restored.
pub(crate) trait Restore: EmotionGenerator {
    /// Everything that the generator remembers.
    type State: PartialEq;

    fn state(&self) -> Self::State;

    /// Whether the generator can be in this state.
    fn accepts(&self, state: &Self::State) -> bool;

    fn restore(&mut self, state: Self::State);
}

impl<M, B, E: EmotionLabel> Restore for DynamicGenerator<M, B, E> {
    type State = EmotionState<E>;

    fn state(&self) -> EmotionState<E> {
        self.state().clone()
    }

    fn accepts(&self, state: &EmotionState<E>) -> bool {
        self.dynamics().accepts(state)
    }

    fn restore(&mut self, state: EmotionState<E>) {
        self.restore(state);
    }
}

impl<M, B: PartialEq, E: EmotionLabel> Restore for RuleGenerator<M, B, E> {
    type State = Feeling<E>;

    fn state(&self) -> Feeling<E> {
        self.feeling()
    }

    fn accepts(&self, _: &Feeling<E>) -> bool {
        true
    }

    fn restore(&mut self, feeling: Feeling<E>) {
        self.restore(feeling);
    }
}

/// A generator and its switch. Switched off, the generator never runs and stays in its initial state.
pub(crate) struct SwitchableGenerator<G> {
    switch: Switch,
    script: Script,
    /// The feeling of the script at this time.
    scripted: Option<Feeling<StandardEmotion>>,
    generator: G,
}

impl<G: Restore + EmotionGenerator<Emotion = StandardEmotion>> SwitchableGenerator<G> {
    pub(crate) fn new(switch: Switch, script: Script, generator: G) -> Self {
        Self {
            switch,
            script,
            scripted: None,
            generator,
        }
    }

    /// The step of this tick.
    pub(crate) fn update(
        &mut self,
        measures: &G::Measures,
        behavior: &G::Behavior,
        cars: &Cars<'_>,
    ) {
        if self.switch.is_on() {
            self.generator.update(measures, behavior, cars.tick_s());
        }

        let time_s = cars.tick() as f64 * cars.tick_s();
        self.scripted = self.script.feeling_at(time_s);
    }

    /// The feeling; switched off, the initial one.
    pub(crate) fn feeling(&self) -> Feeling<StandardEmotion> {
        match self.scripted {
            Some(feeling) if self.switch.is_on() => feeling,
            _ => self.generator.feeling(),
        }
    }

    /// The feeling; `None` if it is switched off.
    pub(crate) fn shown(&self) -> Option<Feeling<StandardEmotion>> {
        self.switch.is_on().then(|| self.feeling())
    }

    /// Whether it is HAPPY; switched off, it is not.
    pub(crate) fn is_happy(&self) -> bool {
        self.shown()
            .is_some_and(|feeling| feeling.emotion == StandardEmotion::Happy)
    }

    /// The name under which the emotion is published.
    pub(crate) fn name(&self) -> &'static str {
        self.shown()
            .map_or(NEUTRAL, |feeling| feeling.emotion.name())
    }

    pub(crate) fn save(&self) -> G::State {
        self.generator.state()
    }

    /// Continues from a saved state.
    ///
    /// # Errors
    /// The emotion cannot be in this state.
    pub(crate) fn restore(&mut self, state: G::State) -> Result<(), String> {
        let is_possible = if self.switch.is_on() {
            self.generator.accepts(&state)
        } else {
            state == self.generator.state()
        };
        if !is_possible {
            return Err("the saved emotion does not fit these parameters".to_owned());
        }

        self.generator.restore(state);
        Ok(())
    }
}
