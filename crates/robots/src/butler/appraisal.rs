//! How Butler appraises his situation, from what he measures and knows \[I\].

use affect::StandardEmotion;
use affect::akr::{Agency, Appraisal};
use robot::Cars;

use super::Butler;
use super::tables::ButlerBehavior;

impl Butler {
    /// His judgment of this moment.
    ///
    /// Goal congruence is the need, not filtered: 1 for none, -1 for one that saturates his emotion. Controllability is
    /// the share of what he can do about it that he has not done yet: to call, to ask to hurry, to intercept. Certainty
    /// falls with the age of the refiller's last answer. She is responsible as soon as he has called and she has not
    /// come, unless he is HAPPY, which is his own doing \[D\].
    pub(super) fn appraisal(&self, cars: &Cars<'_>) -> Appraisal {
        let state = &self.state;
        let behavior = self.behavior();
        let pressure = if state.measures.exchange_is_over {
            0.0
        } else {
            self.pressure()
        };

        let may_intercept =
            behavior != ButlerBehavior::Intercept && self.context(cars).may_intercept();
        let open = [!state.called, !state.hurried, may_intercept];
        let count = open.iter().filter(|is_open| **is_open).count();

        let is_let_down = state.need && state.called && behavior != ButlerBehavior::Exchange;
        let is_happy = self.feeling().emotion == StandardEmotion::Happy;
        let agency = if is_let_down && !is_happy {
            Agency::Other(state.refiller.name().to_owned())
        } else {
            Agency::Oneself
        };

        Appraisal::new(
            1.0 - 2.0 * pressure,
            count as f64 / open.len() as f64,
            state.refiller.certainty(self.parameters.query_stale_s),
            agency,
        )
    }
}
