//! What Leguin remembers to appraise her situation \[I\].

use affect::{Episode, Prediction, RecentShare};
use serde::{Deserialize, Serialize};

/// What she remembers to appraise her situation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LeguinChecks {
    pub(super) episode: Episode,
    /// The pressure of her errand.
    pressure: Prediction,
    /// Time since the first call that she has not answered by an exchange, s.
    owed_s: Option<f64>,
    /// The ticks in which no call was overdue.
    duty: RecentShare,
    is_on_errand: bool,
    /// Whether she gave up, and nothing good has happened since.
    is_lost: bool,
    /// Errands that have ended, and those of them that she completed.
    ended: u32,
    completed: u32,
}

impl LeguinChecks {
    /// The waiter calls her.
    pub(super) fn owe(&mut self) {
        self.owed_s.get_or_insert(0.0);
    }

    /// She begins an errand.
    pub(super) fn begin_errand(&mut self) {
        self.is_on_errand = true;
    }

    /// She gives up; returns whether that was an errand, and not her wait after an exchange.
    pub(super) fn give_up(&mut self) -> bool {
        let was_on_errand = self.is_on_errand;
        self.is_lost = true;
        self.end_errand();
        was_on_errand
    }

    /// Something brought her nearer to her goal: what was lost is past.
    pub(super) fn progress(&mut self) {
        self.is_lost = false;
    }

    /// Whether her errand is lost.
    pub(super) fn are_of_loss(&self) -> bool {
        self.is_lost
    }

    /// She has met the waiter, for an exchange.
    pub(super) fn complete_errand(&mut self) {
        self.owed_s = None;
        self.completed += u32::from(self.is_on_errand);
        self.end_errand();
    }

    fn end_errand(&mut self) {
        self.ended += u32::from(self.is_on_errand);
        self.is_on_errand = false;
    }

    /// Adds a tick. She is to answer a call within `answer_s`, and is judged by the last `recent_s`.
    pub(super) fn advance(&mut self, answer_s: f64, recent_s: f64, tick_s: f64) {
        self.owed_s = self.owed_s.map(|owed_s| owed_s + tick_s);
        let is_overdue = self.owed_s.is_some_and(|owed_s| owed_s > answer_s);
        self.duty.add((!is_overdue).into(), 1, recent_s, tick_s);
    }

    /// Of the errands that have ended, the share that she completed.
    pub(super) fn completed(&self) -> f64 {
        if self.ended == 0 {
            1.0
        } else {
            f64::from(self.completed) / f64::from(self.ended)
        }
    }

    /// Adds the pressure of a tick, from which novelty follows.
    pub(super) fn measure(&mut self, pressure: f64, prediction_s: f64, tick_s: f64) {
        self.pressure.observe(pressure, prediction_s, tick_s);
    }

    /// How far the pressure is from what its trend predicted.
    pub(super) fn novelty(&self) -> f64 {
        self.pressure.novelty()
    }

    /// The share of recent time in which no call was overdue.
    pub(super) fn answered_in_time(&self) -> f64 {
        self.duty.share()
    }
}
