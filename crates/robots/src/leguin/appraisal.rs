//! How Leguin appraises her situation, from what she measures and knows \[I\].

use affect::StandardEmotion::{self, Discouraged, Happy, Hopeful};
use affect::akr::{Agency, Appraisal, Valence};
use affect::{Circumstances, EmotionLabel, Episode, EpisodeCause, Schemata};
use robot::Cars;

use super::Leguin;
use super::tables::{LeguinBehavior, urgency};

/// The name of what blocks her way.
const CROWD: &str = "the crowd";

impl Leguin {
    /// Judges this moment, and follows the episode of her emotion.
    pub(super) fn check(&mut self, cars: &Cars<'_>) {
        let pressure = urgency(&self.state.measures, &self.behavior()).value();
        let prediction_s = self.parameters.appraisal.prediction_s;
        let checks = &mut self.state.checks;
        checks.measure(pressure, prediction_s, cars.tick_s());

        self.state.appraisal = self.appraisal(pressure);
        self.follow_episode(cars.tick_s());
    }

    /// Goes on with the episode of her emotion, or begins another one.
    pub(super) fn follow_episode(&mut self, dt_s: f64) {
        let Some(feeling) = self.emotion.shown() else {
            return;
        };

        let mut episode = std::mem::take(&mut self.state.checks.episode);
        episode.update(feeling.emotion.name(), dt_s, |before| {
            self.cause(feeling.emotion, before)
        });
        self.state.checks.episode = episode;
    }

    /// Her judgment of this moment.
    ///
    /// Goal congruence is the pressure of her errand: 1 for none, -1 where her patience ends. Novelty is that of the pressure.
    /// Controllability is the share of her patience with a blocked way that is left. After she gave up an errand it is lost, and
    /// nothing can be done about it, until something brings her nearer to her goal again, or while she believes that she cannot.
    /// The situation changes without her if the waiter comes to meet her or takes treats, or, while she waits at the table, may
    /// call; a crowd in her way may move. Certainty falls with the time since she last knew where the waiter is. What she owes
    /// are answers to his calls, and what she expects of herself are errands that she completes.
    fn appraisal(&self, pressure: f64) -> Appraisal {
        let measures = &self.state.measures;
        let waiter = &self.state.waiter;
        let checks = &self.state.checks;
        let stale_s = self.parameters.query_stale_s;

        let modifiability = match (waiter.behavior(stale_s), self.behavior()) {
            (_, LeguinBehavior::Exchange) => 1.0,
            (None, _) => 0.5,
            (Some("INTERCEPT" | "EXCHANGE"), _) | (_, LeguinBehavior::Wait) => 1.0,
            _ if measures.blocked >= measures.th_concerned => 0.5,
            _ => 0.0,
        };

        let is_lost = checks.are_of_loss() || self.state.beliefs.are_of_failure();
        let [goal_congruence, controllability] = if is_lost {
            [-1.0, 0.0]
        } else {
            [1.0 - 2.0 * pressure, 1.0 - measures.blocked.min(1.0)]
        };
        Appraisal::new(
            goal_congruence,
            controllability,
            waiter.location_certainty(stale_s),
        )
        .with_novelty(checks.novelty())
        .with_modifiability(modifiability)
        .with_standards(checks.answered_in_time(), checks.completed())
    }

    /// The cause of an emotion that begins.
    ///
    /// She is responsible for her happiness, and for what she believes of herself. Of the others the crowd is responsible if it
    /// blocks her, and the waiter if he told her to hurry or keeps her waiting. An unpleasant emotion without either has the
    /// agent of the one before: the same trouble eases.
    fn cause(&self, emotion: StandardEmotion, before: &Episode) -> EpisodeCause {
        let measures = &self.state.measures;
        let waiter = self.parameters.waiter.as_str();
        let is_blocked = measures.blocked >= measures.th_concerned;
        let agency = match emotion {
            Happy | Discouraged | Hopeful => Agency::Oneself,
            _ if is_blocked => Agency::Other(CROWD.to_owned()),
            _ if measures.hurried || measures.waiting > 0.0 => Agency::Other(waiter.to_owned()),
            _ if emotion.valence() == Valence::Negative => before.cause().agency.clone(),
            _ => Agency::Oneself,
        };

        let event = match self.behavior() {
            LeguinBehavior::Wait => "the rest",
            LeguinBehavior::Refill if is_blocked => "the blocked way",
            LeguinBehavior::Refill => "the call",
            LeguinBehavior::Exchange => "the exchange",
            LeguinBehavior::AwaitGoHome => "the wait",
            LeguinBehavior::GoHome => "the way home",
        };

        let goal = format!("to bring {} to {waiter}", self.parameters.goods);
        let circumstances = Circumstances {
            other: Some(waiter),
            goal: Some(&goal),
            ..Circumstances::default()
        };
        Schemata::standard().cause(emotion.name(), agency, event, &circumstances)
    }
}
