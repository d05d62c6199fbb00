//! What Butler remembers to appraise his situation \[I\].

use affect::{Episode, Prediction, RecentShare};
use serde::{Deserialize, Serialize};

/// What he remembers to appraise his situation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ButlerChecks {
    pub(super) episode: Episode,
    /// The pressure of his need.
    pressure: Prediction,
    /// Of the guests who reached for a treat, those who got one.
    guests: RecentShare,
    /// The ticks in which there were treats on the tray.
    supply: RecentShare,
}

impl ButlerChecks {
    /// Adds a tick in which guests took so many treats and so many times reached for an empty tray.
    pub(super) fn count(
        &mut self,
        [served, missed]: [u32; 2],
        has_treats: bool,
        recent_s: f64,
        tick_s: f64,
    ) {
        let asked = served.saturating_add(missed);
        self.guests.add(served, asked, recent_s, tick_s);
        self.supply.add(has_treats.into(), 1, recent_s, tick_s);
    }

    /// Adds the pressure of a tick, from which novelty follows.
    pub(super) fn measure(&mut self, pressure: f64, prediction_s: f64, tick_s: f64) {
        self.pressure.observe(pressure, prediction_s, tick_s);
    }

    /// How far the pressure is from what its trend predicted.
    pub(super) fn novelty(&self) -> f64 {
        self.pressure.novelty()
    }

    /// Of the guests who reached for a treat lately, the share who got one.
    pub(super) fn guests_served(&self) -> f64 {
        self.guests.share()
    }

    /// The share of recent time with treats on the tray.
    pub(super) fn supplied(&self) -> f64 {
        self.supply.share()
    }
}
