//! Progress measures: how fast a stock empties, when help arrives, and how the two compare.
//!
//! An emotion generator needs a measure of progress, and the published one is not readable. These are the
//! pieces of a measure chosen for this project [I throughout]: pure, in SI units, and of use to any
//! robot that consumes something and waits for somebody.

use crate::parameters::{ParameterError, not_negative, positive};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Constants of a [`RateEstimator`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RateParameters {
    /// How far back, in seconds of observed time, events count. Default 15 \[I\].
    pub window_s: f64,
    /// How many events the prior is worth. Default 5 \[I\].
    pub prior_n: f64,
    /// Mean time between events, in seconds, before any was seen. Default 1 \[I\].
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

/// Estimates how often something happens, from what happened lately and a prior.
///
/// `(prior_n + k) / (prior_n * prior_interval + min(window, observed time))`, where `k` events fell into
/// the last window of observed time. Time that was not observed does not count: the robot advances the
/// estimator only while events can happen.
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
    /// An estimator that has seen nothing yet.
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

    /// `dt_s` seconds were observed, at the end of which `events` had happened.
    pub fn advance(&mut self, dt_s: f64, events: u32) {
        self.observed_s += dt_s;
        self.recent_s.extend((0..events).map(|_| self.observed_s));
        let begin_s = self.observed_s - self.parameters.window_s;
        while self.recent_s.front().is_some_and(|&at_s| at_s <= begin_s) {
            self.recent_s.pop_front();
        }
    }

    /// Events for each second of observed time; always above zero.
    pub fn per_second(&self) -> f64 {
        let RateParameters {
            window_s,
            prior_n,
            prior_interval_s,
        } = self.parameters;
        // The window holds at most a few thousand events, which f64 represents exactly.
        let seen = self.recent_s.len() as f64;
        (prior_n + seen) / (prior_n * prior_interval_s + self.observed_s.min(window_s))
    }

    /// Observed time so far, in seconds.
    pub fn observed_s(&self) -> f64 {
        self.observed_s
    }
}

/// Constants of an [`ApproachEstimator`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ApproachParameters {
    /// Speed assumed until the peer has been seen to come, in m/s. Default 3 ft/s = 0.9144 m/s \[I\].
    pub expected_mps: f64,
    /// Least speed used for an arrival time, in m/s. Default 0.3 ft/s = 0.09144 m/s \[I\].
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

/// Estimates how fast a peer comes nearer, and remembers how far away it last was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ApproachEstimator {
    parameters: ApproachParameters,
    speed_mps: f64,
    distance_m: Option<f64>,
}

impl ApproachEstimator {
    /// An estimator that expects the peer to come at the expected speed.
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

    /// The peer was at `distance_m` metres at the end of the last `dt_s` seconds. The speed is learned only
    /// while the peer `is_coming`: before, it says nothing about how fast it would come.
    pub fn observe(&mut self, distance_m: f64, is_coming: bool, dt_s: f64) {
        if let Some(before_m) = self.distance_m
            && is_coming
            && dt_s > 0.0
        {
            self.learn((before_m - distance_m) / dt_s, dt_s);
        }
        self.distance_m = Some(distance_m);
    }

    /// Nothing was heard of the peer for `dt_s` seconds: the distance stays, the speed fades to the
    /// floor, so that silence raises concern.
    pub fn observe_silence(&mut self, dt_s: f64) {
        if self.speed_mps > self.parameters.floor_mps {
            self.learn(self.parameters.floor_mps, dt_s);
        }
    }

    /// Forgets what was learned of the speed, for instance when a new errand begins. Keeps the distance.
    pub fn expect_again(&mut self) {
        self.speed_mps = self.parameters.expected_mps;
    }

    /// Estimated closing speed in m/s; negative when the peer goes away.
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// The last known distance in metres.
    pub fn distance_m(&self) -> Option<f64> {
        self.distance_m
    }

    /// Seconds until the peer is within `reach_m` metres; none before it was ever seen.
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

/// Seconds until `stock` pieces are used up at `per_second` pieces a second.
pub fn time_to_empty_s(stock: f64, per_second: f64) -> f64 {
    stock / per_second
}

/// Seconds until `distance_m` metres are covered at `speed_mps`; 0 when it is already covered.
pub fn time_to_arrive_s(distance_m: f64, speed_mps: f64) -> f64 {
    distance_m.max(0.0) / speed_mps
}

/// Seconds until a peer arrives that first goes `to_depot_m` metres to a depot, reloads there for
/// `reload_s` seconds, and comes `from_depot_m` metres.
pub fn time_to_arrive_by_depot_s(
    to_depot_m: f64,
    reload_s: f64,
    from_depot_m: f64,
    speed_mps: f64,
) -> f64 {
    time_to_arrive_s(to_depot_m + from_depot_m, speed_mps) + reload_s
}

/// How much longer help takes than the stock lasts (dimensionless): above 1 it comes too late.
///
/// An empty stock counts as lasting half of the mean time between two pieces, so that the ratio stays finite
/// and still grows with the time help takes.
pub fn need_ratio(time_to_refill_s: f64, time_to_empty_s: f64, per_second: f64) -> f64 {
    time_to_refill_s / time_to_empty_s.max(0.5 / per_second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_counts_until_it_is_a_window_old() {
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
    fn senseless_constants_are_refused() {
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
    fn the_speed_is_learned_only_from_a_peer_that_comes() {
        let parameters = ApproachParameters {
            expected_mps: 1.0,
            floor_mps: 0.1,
            tau_s: 2.0,
        };
        let mut approach = ApproachEstimator::new(parameters).unwrap();
        assert_eq!(approach.arrival_s(1.0), None);
        approach.observe(10.0, true, 1.0); // first sight: no speed to be had
        approach.observe(10.0, false, 1.0);
        assert_eq!(approach.speed_mps(), 1.0);
        assert_eq!(approach.arrival_s(1.0), Some(9.0));
        approach.observe(10.0, true, 1.0); // it should come, and stands
        assert_eq!(approach.speed_mps(), 0.5);
        approach.expect_again();
        assert_eq!(
            (approach.speed_mps(), approach.distance_m()),
            (1.0, Some(10.0))
        );
    }

    #[test]
    fn silence_fades_to_the_floor_and_never_raises() {
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
