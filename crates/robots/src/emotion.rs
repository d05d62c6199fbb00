//! A robot's emotion: a generator that an experiment can switch off or put a script in the place of, whose state can be
//! saved and restored.

use affect::{
    DynamicGenerator, EmotionGenerator, EmotionLabel, EmotionState, Feeling, Progress, Schemata,
    StandardEmotion, Urgency,
};
use robot::{Cars, StateVariables};

use crate::policy::Policy;
use crate::published::{number, text};
use crate::script::{Script, ScriptRole};
use crate::switch::Switch;

/// The emotion that a robot without emotions publishes.
pub(crate) const NEUTRAL: &str = "NEUTRAL";

/// A generator and its switch. Switched off, the generator never runs and stays in its initial state.
#[derive(Clone)]
pub(crate) struct SwitchableGenerator<M, B> {
    switch: Switch,
    script: Script,
    role: ScriptRole,
    /// The feeling of the script at this time.
    scripted: Option<Feeling<StandardEmotion>>,
    generator: DynamicGenerator<M, B, StandardEmotion>,
}

impl<M, B> SwitchableGenerator<M, B> {
    pub(crate) fn new(
        switch: Switch,
        (script, role): (Script, ScriptRole),
        generator: DynamicGenerator<M, B, StandardEmotion>,
    ) -> Self {
        Self {
            switch,
            script,
            role,
            scripted: None,
            generator,
        }
    }

    /// The step of this tick. Returns what counted as progress in it.
    pub(crate) fn update(
        &mut self,
        measures: &M,
        behavior: &B,
        cars: &Cars<'_>,
    ) -> Option<Progress> {
        let mut progress = None;
        if self.switch.is_on() {
            self.generator.update(measures, behavior, cars.tick_s());
            progress = self.generator.state().progress();
        }

        let time_s = cars.tick() as f64 * cars.tick_s();
        self.scripted = self.script.feeling_at(time_s);
        progress
    }

    /// The feeling; switched off, the initial one.
    pub(crate) fn feeling(&self) -> Feeling<StandardEmotion> {
        match self.scripted {
            Some(feeling) if self.switch.is_on() && self.role == ScriptRole::Felt => feeling,
            _ => self.generator.feeling(),
        }
    }

    /// The feeling that others see; `None` if it is switched off.
    pub(crate) fn shown(&self) -> Option<Feeling<StandardEmotion>> {
        let shown = self.scripted.unwrap_or_else(|| self.generator.feeling());
        self.switch.is_on().then_some(shown)
    }

    /// The mood, -1 to 1.
    pub(crate) fn mood(&self) -> f64 {
        self.generator.state().mood()
    }

    /// Whether it is HAPPY; switched off, it is not.
    pub(crate) fn is_happy(&self) -> bool {
        self.switch.is_on() && self.feeling().emotion == StandardEmotion::Happy
    }

    /// Whether a robot that acts by this policy does nothing about its goal any more: DISCOURAGED, it is not inclined to do
    /// anything \[I\].
    pub(crate) fn despairs(&self, policy: Policy) -> bool {
        policy == Policy::Emotion && self.feeling().emotion == StandardEmotion::Discouraged
    }

    /// The name under which the emotion is published.
    pub(crate) fn name(&self) -> &'static str {
        self.shown()
            .map_or(NEUTRAL, |feeling| feeling.emotion.name())
    }

    pub(crate) fn save(&self) -> EmotionState<StandardEmotion> {
        self.generator.state().clone()
    }

    /// Continues from a saved state.
    ///
    /// # Errors
    /// The emotion cannot be in this state.
    pub(crate) fn restore(&mut self, state: EmotionState<StandardEmotion>) -> Result<(), String> {
        let is_possible = if self.switch.is_on() {
            self.generator.dynamics().accepts(&state)
        } else {
            state == *self.generator.state()
        };
        if !is_possible {
            return Err("the saved emotion does not fit these parameters".to_owned());
        }

        self.generator.restore(state);
        Ok(())
    }

    /// Continues from what a lost incarnation published: its urgency, the emotion of its action tendency, and its mood. What a
    /// script showed was not its own. Without beliefs it has none of their emotions, and has the one that leads to them.
    pub(crate) fn take_over(&mut self, last: &StateVariables, has_beliefs: bool) {
        if !self.switch.is_on() {
            return;
        }

        let taken_over = if self.script.is_empty() {
            self.taken_over(last, has_beliefs)
        } else {
            None
        };
        let mood = number(last, affect::frame::MOOD).unwrap_or(self.mood());
        let state = taken_over.unwrap_or(self.save());
        self.generator.restore(state.with_mood(mood));
    }

    /// The state of the emotion that a lost incarnation published; `None` if it published none.
    fn taken_over(
        &self,
        last: &StateVariables,
        has_beliefs: bool,
    ) -> Option<EmotionState<StandardEmotion>> {
        let tendency = text(last, affect::frame::ACTION_TENDENCY);
        let emotion = StandardEmotion::ALL.into_iter().find(|emotion| {
            let schema = Schemata::standard().get(emotion.name());
            schema.is_some_and(|schema| Some(schema.action_tendency.name()) == tendency)
        });
        let urgency = number(last, affect::frame::URGENCY);

        let emotion = match emotion? {
            StandardEmotion::Discouraged if !has_beliefs => StandardEmotion::Frustrated,
            StandardEmotion::Hopeful if !has_beliefs => StandardEmotion::Concerned,
            other => other,
        };
        let urgency = Urgency::saturating(urgency?);
        let dynamics = self.generator.dynamics();
        Some(dynamics.taken_over(Feeling { emotion, urgency }))
    }
}
