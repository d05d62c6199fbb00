//! Progress measures: how fast a stock is used up, when help arrives, and the ratio between the two.
//!
//! An emotion generator needs a measure of progress, and the published one was not readable. This module provides
//! the building blocks of a measure chosen for this project [I throughout]. They are pure functions and small
//! estimators in SI units, for any robot that consumes a stock and waits for another robot.

use crate::parameters::{ParameterError, not_negative, positive};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Constants of a [`RateEstimator`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RateParameters {
    /// Length of the sliding window, in seconds of observed time. Default 15 \[I\].
    pub window_s: f64,
    /// Weight of the prior, as a number of events. Default 5 \[I\].
    pub prior_n: f64,
    /// Mean time between events assumed by the prior, in seconds. Default 1 \[I\].
    pub prior_interval_s: f64,
}

impl Default for RateParameters {
    fn default() -> Self {
        Self {
            window_s: 15.0,
            prior_n: 5.0,
            prior_interval_s: 1.0,
        }
    }
}

/// Estimates the rate of events from recent observations and a prior.
///
/// The estimate is `(prior_n + k) / (prior_n * prior_interval_s + min(window_s, observed_s))` for `k` events in the
/// last `window_s` of observed time. Robots advance the estimator only while events can happen; other time is not
/// observed.
///
/// ```
/// use affect::progress::{RateEstimator, RateParameters};
/// let mut rate = RateEstimator::new(RateParameters::default())?;
/// assert_eq!(rate.per_second(), 1.0); // the prior alone
/// for _ in 0..30 {
///     rate.advance(0.5, 1); // two a second
/// }
/// assert_eq!(rate.per_second(), 35.0 / 20.0);
/// # Ok::<(), affect::ParameterError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RateEstimator {
    parameters: RateParameters,
    observed_s: f64,
    /// Observed time of each event inside the window, oldest first.
    recent_s: VecDeque<f64>,
}

impl RateEstimator {
    /// Creates an estimator without observations.
    ///
    /// # Errors
    ///
    /// Returns an error unless all parameters are positive.
    pub fn new(parameters: RateParameters) -> Result<Self, ParameterError> {
        positive("window_s", parameters.window_s)?;
        positive("prior_n", parameters.prior_n)?;
        positive("prior_interval_s", parameters.prior_interval_s)?;

        Ok(Self {
            parameters,
            observed_s: 0.0,
            recent_s: VecDeque::new(),
        })
    }

    /// Records `dt_s` seconds of observed time, with `events` events at their end.
    pub fn advance(&mut self, dt_s: f64, events: u32) {
        self.observed_s += dt_s;
        for _ in 0..events {
            self.recent_s.push_back(self.observed_s);
        }

        let begin_s = self.observed_s - self.parameters.window_s;
        while self.recent_s.front().is_some_and(|&at_s| at_s <= begin_s) {
            self.recent_s.pop_front();
        }
    }

    /// Estimated events per second of observed time; always positive.
    pub fn per_second(&self) -> f64 {
        let RateParameters {
            window_s,
            prior_n,
            prior_interval_s,
        } = self.parameters;

        // The window holds a few thousand events at most, which f64 represents exactly.
        let events = prior_n + self.recent_s.len() as f64;
        let time_s = prior_n * prior_interval_s + self.observed_s.min(window_s);

        events / time_s
    }

    /// Total observed time, in seconds.
    pub fn observed_s(&self) -> f64 {
        self.observed_s
    }
}

/// Constants of an [`ApproachEstimator`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ApproachParameters {
    /// Speed assumed until the peer has been observed approaching, in m/s. Default 3 ft/s = 0.9144 m/s \[I\].
    pub expected_mps: f64,
    /// Minimum speed used for arrival times, in m/s. Default 0.3 ft/s = 0.09144 m/s \[I\].
    pub floor_mps: f64,
    /// Time constant of the estimate, in seconds. Default 3 \[I\].
    pub tau_s: f64,
}

impl Default for ApproachParameters {
    fn default() -> Self {
        Self {
            expected_mps: 0.9144,
            floor_mps: 0.09144,
            tau_s: 3.0,
        }
    }
}

/// Estimates the speed at which a peer approaches, and stores its last known distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ApproachEstimator {
    parameters: ApproachParameters,
    speed_mps: f64,
    distance_m: Option<f64>,
}

impl ApproachEstimator {
    /// Creates an estimator that starts with the expected speed and no known distance.
    ///
    /// # Errors
    ///
    /// Returns an error if the floor or the time constant is not positive, or the expected speed is negative.
    pub fn new(parameters: ApproachParameters) -> Result<Self, ParameterError> {
        positive("floor_mps", parameters.floor_mps)?;
        positive("tau_s", parameters.tau_s)?;
        not_negative("expected_mps", parameters.expected_mps)?;

        Ok(Self {
            parameters,
            speed_mps: parameters.expected_mps,
            distance_m: None,
        })
    }

    /// Records the distance of the peer, in meters, at the end of the last `dt_s` seconds.
    ///
    /// The speed is updated only while the peer `is_coming`. At other times its motion does not show how fast it would
    /// approach.
    pub fn observe(&mut self, distance_m: f64, is_coming: bool, dt_s: f64) {
        if let Some(before_m) = self.distance_m
            && is_coming
            && dt_s > 0.0
        {
            self.learn((before_m - distance_m) / dt_s, dt_s);
        }

        self.distance_m = Some(distance_m);
    }

    /// Tells the estimator how far away the peer was at the last observation, as seen from where the robot is now. The next
    /// observation then measures the peer's own approach, and not that of the robot.
    pub fn measure_from(&mut self, distance_m: f64) {
        self.distance_m = Some(distance_m);
    }

    /// Records that nothing is known of the peer for the last `dt_s` seconds.
    ///
    /// The distance stays the same, and the speed decays to the floor, so that missing information raises concern.
    pub fn observe_silence(&mut self, dt_s: f64) {
        if self.speed_mps > self.parameters.floor_mps {
            self.learn(self.parameters.floor_mps, dt_s);
        }
    }

    /// Resets the speed to the expected speed, for instance when a new task begins. Keeps the distance.
    pub fn expect_again(&mut self) {
        self.speed_mps = self.parameters.expected_mps;
    }

    /// Estimated speed of approach, in m/s; negative if the peer moves away.
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Last known distance, in meters.
    pub fn distance_m(&self) -> Option<f64> {
        self.distance_m
    }

    /// Estimated time until the peer is within `reach_m` meters, in seconds. `None` if its distance is unknown.
    pub fn arrival_s(&self, reach_m: f64) -> Option<f64> {
        let speed_mps = self.speed_mps.max(self.parameters.floor_mps);
        self.distance_m
            .map(|distance_m| time_to_arrive_s(distance_m - reach_m, speed_mps))
    }

    fn learn(&mut self, closing_mps: f64, dt_s: f64) {
        let share = (dt_s / self.parameters.tau_s).min(1.0);

        self.speed_mps += (closing_mps - self.speed_mps) * share;
    }
}

/// Time until `stock` pieces are used up at `per_second` pieces per second, in seconds.
pub fn time_to_empty_s(stock: f64, per_second: f64) -> f64 {
    stock / per_second
}

/// Time to cover `distance_m` meters at `speed_mps`, in seconds; 0 for a negative distance.
pub fn time_to_arrive_s(distance_m: f64, speed_mps: f64) -> f64 {
    distance_m.max(0.0) / speed_mps
}

/// Time until a peer arrives by way of a depot, in seconds.
///
/// The peer covers `to_depot_m` meters to the depot, reloads for `reload_s` seconds, and covers `from_depot_m` meters
/// from there.
pub fn time_to_arrive_by_depot_s(
    to_depot_m: f64,
    reload_s: f64,
    from_depot_m: f64,
    speed_mps: f64,
) -> f64 {
    time_to_arrive_s(to_depot_m + from_depot_m, speed_mps) + reload_s
}

/// The time until help arrives divided by the time the stock lasts (dimensionless). Above 1, help arrives too late.
///
/// An empty stock is treated as lasting half of the mean time between two pieces. The ratio then stays finite and
/// still grows with the time until help arrives.
pub fn need_ratio(time_to_refill_s: f64, time_to_empty_s: f64, per_second: f64) -> f64 {
    time_to_refill_s / time_to_empty_s.max(0.5 / per_second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_older_than_the_window_are_dropped() {
        let parameters = RateParameters {
            window_s: 2.0,
            prior_n: 1.0,
            prior_interval_s: 1.0,
        };
        let mut rate = RateEstimator::new(parameters).unwrap();
        rate.advance(1.0, 1);
        assert_eq!(rate.per_second(), 2.0 / 2.0);
        rate.advance(1.0, 0);
        assert_eq!(rate.per_second(), 2.0 / 3.0);
        rate.advance(1.0, 0);
        assert_eq!(rate.per_second(), 1.0 / 3.0);
        assert_eq!(rate.observed_s(), 3.0);
    }

    #[test]
    fn invalid_parameters_are_rejected() {
        let rate = RateParameters {
            prior_n: 0.0,
            ..Default::default()
        };
        assert!(RateEstimator::new(rate).is_err());

        let approach = ApproachParameters {
            floor_mps: 0.0,
            ..Default::default()
        };
        assert!(ApproachEstimator::new(approach).is_err());
    }

    #[test]
    fn the_speed_is_learned_only_from_an_approaching_peer() {
        let parameters = ApproachParameters {
            expected_mps: 1.0,
            floor_mps: 0.1,
            tau_s: 2.0,
        };
        let mut approach = ApproachEstimator::new(parameters).unwrap();
        assert_eq!(approach.arrival_s(1.0), None);

        approach.observe(10.0, true, 1.0); // first observation: the speed is unknown
        approach.observe(10.0, false, 1.0);
        assert_eq!(approach.speed_mps(), 1.0);
        assert_eq!(approach.arrival_s(1.0), Some(9.0));

        approach.observe(10.0, true, 1.0); // expected to approach, but stationary
        assert_eq!(approach.speed_mps(), 0.5);

        approach.expect_again();
        assert_eq!(approach.speed_mps(), 1.0);
        assert_eq!(approach.distance_m(), Some(10.0));
    }

    #[test]
    fn the_speed_decays_to_the_floor_in_silence_and_never_rises() {
        let mut approach = ApproachEstimator::new(ApproachParameters::default()).unwrap();
        approach.observe(5.0, false, 0.5);
        for _ in 0..1000 {
            approach.observe_silence(0.5);
        }
        assert!((approach.speed_mps() - 0.09144).abs() < 1e-9);

        for _ in 0..10 {
            let distance_m = approach.distance_m().unwrap();
            approach.observe(distance_m + 1.0, true, 0.5);
        }
        let receding_mps = approach.speed_mps();
        assert!(receding_mps < 0.0);

        approach.observe_silence(0.5);
        assert_eq!(approach.speed_mps(), receding_mps);
        assert!(approach.arrival_s(0.0).unwrap().is_finite());
    }

    #[test]
    fn times_and_ratio() {
        assert_eq!(time_to_empty_s(6.0, 2.0), 3.0);
        assert_eq!(time_to_arrive_s(-1.0, 2.0), 0.0);
        assert_eq!(time_to_arrive_by_depot_s(4.0, 2.0, 6.0, 5.0), 4.0);
        assert_eq!(need_ratio(6.0, 3.0, 1.0), 2.0);
        assert_eq!(need_ratio(6.0, 0.0, 1.0), 12.0);
    }
}
