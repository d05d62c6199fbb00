//! How Butler appraises his situation, from what he measures and knows \[I\].

use affect::StandardEmotion::{self, Angry, Discouraged, Frustrated, Happy, Hopeful};
use affect::akr::{Agency, Appraisal};
use affect::{Circumstances, EmotionLabel, Episode, EpisodeCause, Schemata};
use robot::Cars;

use super::Butler;
use super::tables::ButlerBehavior;

impl Butler {
    /// Judges this moment, and follows the episode of his emotion.
    pub(super) fn check(&mut self, cars: &Cars<'_>) {
        let pressure = self.appraised_pressure();
        let prediction_s = self.parameters.appraisal.prediction_s;
        let checks = &mut self.state.checks;
        checks.measure(pressure, prediction_s, cars.tick_s());

        self.state.appraisal = self.appraisal(cars);
        self.follow_episode(cars.tick_s());
    }

    /// Goes on with the episode of his emotion, or begins another one.
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

    /// The pressure of his need, not filtered; none while she refills him.
    fn appraised_pressure(&self) -> f64 {
        if self.behavior() == ButlerBehavior::Exchange {
            0.0
        } else {
            self.pressure()
        }
    }

    /// His judgment of this moment.
    ///
    /// Goal congruence is the pressure: 1 for none, -1 for one that saturates his emotion. Novelty is that of the pressure.
    /// Controllability is the share of what he can do about it that he has not done yet: to call, to ask to hurry, to
    /// intercept; none while he believes that he cannot. The situation changes without him if the refiller comes, refills him,
    /// or has an errand. Certainty falls with the age of her last answer. What he owes are treats for those who reach for one,
    /// and what he expects of himself is a tray that is never empty.
    fn appraisal(&self, cars: &Cars<'_>) -> Appraisal {
        let state = &self.state;
        let checks = &state.checks;
        let behavior = self.behavior();

        let may_intercept =
            behavior != ButlerBehavior::Intercept && self.context(cars).may_intercept();
        let open = [!state.called, !state.hurried, may_intercept];
        let count = if state.mind.beliefs.are_of_failure() {
            0
        } else {
            open.iter().filter(|is_open| **is_open).count()
        };

        let stale_s = self.parameters.query_stale_s;
        let modifiability = match state.refiller.behavior(stale_s) {
            _ if behavior == ButlerBehavior::Exchange => 1.0,
            None => 0.5,
            Some("REFILL" | "EXCHANGE") => 1.0,
            Some(_) if state.refiller_is_called => 1.0,
            Some(_) => 0.0,
        };

        Appraisal::new(
            1.0 - 2.0 * self.appraised_pressure(),
            count as f64 / open.len() as f64,
            state.refiller.certainty(stale_s),
        )
        .with_novelty(checks.novelty())
        .with_modifiability(modifiability)
        .with_standards(checks.guests_served(), checks.supplied())
    }

    /// The cause of an emotion that begins.
    ///
    /// He is responsible for his happiness, and she for his frustration and anger \[D\]. Of the others: he for what he believes
    /// of himself, and she for what is because she has been called and is not there.
    fn cause(&self, emotion: StandardEmotion, before: &Episode) -> EpisodeCause {
        let state = &self.state;
        let refiller = state.refiller.name();
        let is_hers = match emotion {
            Happy | Discouraged | Hopeful => false,
            Frustrated | Angry => true,
            _ => state.need && state.called,
        };
        let agency = if is_hers {
            Agency::Other(refiller.to_owned())
        } else {
            Agency::Oneself
        };

        let was_worse = StandardEmotion::named(before.emotion())
            .is_some_and(|before| before.reaches(emotion) || before == Discouraged);
        let event = match emotion {
            Happy if state.measures.exchange_is_over => "the exchange",
            Happy => "the service",
            Discouraged => "the failed chase",
            _ if was_worse => "her approach",
            _ if !state.called && !is_hers => "the low tray",
            _ => "the delay",
        };

        let goods = &self.parameters.goods;
        let amount = match state.treats {
            0 => format!("no {goods}"),
            1 => format!("one of the {goods}"),
            treats => format!("{treats} {goods}"),
        };
        let circumstances = Circumstances {
            other: Some(refiller),
            goal: Some(&self.parameters.goal),
            amount: Some(&amount),
        };
        Schemata::standard().cause(emotion.name(), agency, event, &circumstances)
    }
}
