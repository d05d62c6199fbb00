//! Whether another robot comes nearer: the time since a distance was last smaller than ever before.

use serde::{Deserialize, Serialize};

/// The course of a distance on one way. A goal that moves to and fro brings it no nearer: only a new minimum counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Closing {
    /// The smallest distance so far, in steps of the least progress, meters.
    nearest_m: Option<f64>,
    /// Time since there was progress, seconds.
    stalled_s: f64,
}

impl Closing {
    /// Adds a distance after `dt_s` seconds; `None` if it is unknown, which is no progress. A distance that is
    /// `progress_m` smaller than all before is progress. Returns whether there was one before, and this one is.
    pub fn observe(&mut self, distance_m: Option<f64>, progress_m: f64, dt_s: f64) -> bool {
        self.stalled_s += dt_s;
        let has_begun = self.nearest_m.is_some();

        if let Some(distance_m) = distance_m
            && self
                .nearest_m
                .is_none_or(|nearest_m| distance_m <= nearest_m - progress_m)
        {
            self.nearest_m = Some(distance_m);
            self.stalled_s = 0.0;
            return has_begun;
        }
        false
    }

    /// Time without progress, seconds.
    #[must_use]
    pub fn stalled_s(&self) -> f64 {
        self.stalled_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_new_minimum_is_progress() {
        let mut closing = Closing::default();
        let came = [10.0, 9.0, 12.0, 9.5, 9.0]
            .map(|distance_m| closing.observe(Some(distance_m), 0.5, 1.0));
        assert_eq!(came, [false, true, false, false, false]);
        assert_eq!(closing.stalled_s(), 3.0);

        closing.observe(Some(8.7), 0.5, 1.0);
        closing.observe(None, 0.5, 1.0);
        assert_eq!(
            closing.stalled_s(),
            5.0,
            "0.3 m is less than the least progress"
        );

        closing.observe(Some(8.5), 0.5, 1.0);
        assert_eq!(closing.stalled_s(), 0.0, "slow progress adds up");
    }
}
