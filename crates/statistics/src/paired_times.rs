//! Times of pairs of runs, as numbers whose differences can be tested and have intervals.

use crate::survival::{CensoredTime, RiskCounts, tally};

/// The differences between the times of two arms, pair by pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairedTimes {
    /// Arm minus baseline, seconds. Their mean is the difference of the restricted mean times.
    pub differences_s: Vec<f64>,
    /// Up to which time the times count, seconds: as far as the curves of both arms are known. The curve of an arm all of whose
    /// longest times are those of events is at zero from then on.
    pub until_s: f64,
}

impl PairedTimes {
    /// Times of the arm, and those of the baseline with the same seeds, in the same order.
    ///
    /// Each run has its time, at most `until_s`. A run that ends earlier without the event has the expectation of its time: its
    /// pseudo-value in the sample of all runs of both arms (Andersen, Hansen and Klein 2004, Regression analysis of restricted
    /// mean survival time based on pseudo-observations, Lifetime Data Analysis 10).
    #[must_use]
    pub fn of(arm: &[CensoredTime], baseline: &[CensoredTime]) -> Self {
        let longest_s = longest_s(arm).max(longest_s(baseline));
        let known_s = known_until_s(arm).min(known_until_s(baseline));
        let until_s = known_s.min(longest_s);

        let both: Vec<CensoredTime> = arm.iter().chain(baseline).copied().collect();
        let values_s = restricted_s(&both, until_s);
        let (of_arm, of_baseline) = values_s.split_at(arm.len());
        let pairs = of_arm.iter().zip(of_baseline);
        Self {
            differences_s: pairs.map(|(time_s, other_s)| time_s - other_s).collect(),
            until_s,
        }
    }
}

/// The time of each run up to `until_s`, or what it is expected to be.
fn restricted_s(times: &[CensoredTime], until_s: f64) -> Vec<f64> {
    let mut restricted = Vec::new();
    for time in times {
        restricted.push(CensoredTime {
            time_s: time.time_s.min(until_s),
            is_event: time.is_event && time.time_s < until_s,
        });
    }

    let is_known = |time: &CensoredTime| time.is_event || time.time_s >= until_s;
    if restricted.iter().all(is_known) {
        return restricted.iter().map(|time| time.time_s).collect();
    }
    pseudo_values(&restricted, until_s)
}

/// n times the restricted mean of the sample, less n - 1 times that of the sample without the run.
fn pseudo_values(times: &[CensoredTime], until_s: f64) -> Vec<f64> {
    let steps = tally(times);
    let rest_s = rest_s(&steps, until_s);
    let before = before_with_one_fewer(&steps);

    let n = times.len() as f64;
    let mean_s = steps[0].time_s + stays(steps[0].events, steps[0].at_risk) * rest_s[0];
    let mut values_s = Vec::new();
    for time in times {
        let index = steps.partition_point(|step| step.time_s < time.time_s);
        let others = steps[index].events - usize::from(time.is_event);
        let (area_s, share) = before[index];
        let without_s = area_s + share * stays(others, steps[index].at_risk - 1) * rest_s[index];
        values_s.push(n * mean_s - (n - 1.0) * without_s);
    }
    values_s
}

/// What follows each step until the end, as seen from there: the area under the curve divided by its height.
fn rest_s(steps: &[RiskCounts], until_s: f64) -> Vec<f64> {
    let mut rest_s = vec![0.0; steps.len()];
    for index in (0..steps.len()).rev() {
        rest_s[index] = match steps.get(index + 1) {
            Some(next) => {
                let share = stays(next.events, next.at_risk);
                next.time_s - steps[index].time_s + share * rest_s[index + 1]
            }
            None => until_s - steps[index].time_s,
        };
    }
    rest_s
}

/// The area under the curve until each step and its height there, with one run fewer at risk: a run is at risk until its own
/// step.
fn before_with_one_fewer(steps: &[RiskCounts]) -> Vec<(f64, f64)> {
    let mut before = Vec::new();
    let mut area_s = 0.0;
    let mut share = 1.0;
    let mut since_s = 0.0;
    for step in steps {
        area_s += share * (step.time_s - since_s);
        since_s = step.time_s;
        before.push((area_s, share));
        share *= stays(step.events.min(step.at_risk - 1), step.at_risk - 1);
    }
    before
}

/// Share of the runs at risk that stay without the event; all where there are none.
fn stays(events: usize, at_risk: usize) -> f64 {
    if at_risk == 0 {
        return 1.0;
    }
    1.0 - events as f64 / at_risk as f64
}

fn longest_s(times: &[CensoredTime]) -> f64 {
    times.iter().map(|time| time.time_s).fold(0.0, f64::max)
}

/// Up to which time a curve is known, seconds: without an end if it reaches zero.
fn known_until_s(times: &[CensoredTime]) -> f64 {
    let longest_s = longest_s(times);
    let is_open = |time: &CensoredTime| time.time_s >= longest_s && !time.is_event;
    if times.iter().any(is_open) {
        longest_s
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Survival;

    fn event(time_s: f64) -> CensoredTime {
        CensoredTime {
            time_s,
            is_event: true,
        }
    }

    fn open(time_s: f64) -> CensoredTime {
        CensoredTime {
            time_s,
            is_event: false,
        }
    }

    /// The area under the curve of Kaplan and Meier.
    fn area_s(times: &[CensoredTime], until_s: f64) -> f64 {
        let mut area_s = 0.0;
        let mut since_s = 0.0;
        let mut share = 1.0;
        for step in Survival::of(times).curve {
            if step.time_s >= until_s {
                break;
            }
            area_s += share * (step.time_s - since_s);
            since_s = step.time_s;
            share = step.share;
        }
        area_s + share * (until_s - since_s)
    }

    #[test]
    fn times_count_as_far_as_both_curves_are_known() {
        let fast = [10.0, 20.0, 30.0].map(event);
        let slow = [10.0, 100.0, 190.0].map(event);
        let pairs = PairedTimes::of(&fast, &slow);
        assert_eq!(pairs.until_s, 190.0);
        assert_eq!(pairs.differences_s, [0.0, -80.0, -160.0]);

        // Of the last run of the other arm it is not known when it would have had the event.
        let cut = [event(10.0), event(100.0), open(190.0)];
        assert_eq!(PairedTimes::of(&fast, &cut).until_s, 190.0);
        let cut = [event(10.0), event(20.0), open(30.0)];
        let pairs = PairedTimes::of(&cut, &slow);
        assert_eq!(pairs.until_s, 30.0);
        assert_eq!(pairs.differences_s, [0.0, -10.0, 0.0]);
    }

    #[test]
    fn a_run_that_ends_at_once_counts_as_the_others() {
        let arm = [open(0.0), event(20.0), event(40.0)];
        let baseline = [event(30.0), event(30.0), event(30.0)];
        let pairs = PairedTimes::of(&arm, &baseline);
        assert_eq!(pairs.until_s, 40.0);
        // The mean of the five others.
        assert!((pairs.differences_s[0] - 0.0).abs() < 1e-9, "{pairs:?}");
        assert!(PairedTimes::of(&[], &[]).differences_s.is_empty());
    }

    proptest! {
        #[test]
        fn pseudo_values_are_those_of_the_definition(
            times in prop::collection::vec((0_u8..12, any::<bool>()), 2..14),
        ) {
            let times: Vec<CensoredTime> = times
                .iter()
                .map(|(time, is_event)| CensoredTime { time_s: f64::from(*time), is_event: *is_event })
                .collect();
            let until_s = longest_s(&times);

            let n = times.len() as f64;
            let found = pseudo_values(&times, until_s);
            for (index, found) in found.iter().enumerate() {
                let mut others = times.clone();
                others.remove(index);
                let expected = n * area_s(&times, until_s) - (n - 1.0) * area_s(&others, until_s);
                prop_assert!((found - expected).abs() < 1e-9, "{}: {} is not {}", index, found, expected);
            }
        }

        #[test]
        fn differences_turn_with_the_arms(
            times in prop::collection::vec(((0_u8..12, any::<bool>()), (0_u8..12, any::<bool>())), 1..14),
        ) {
            let time = |(time, is_event): (u8, bool)| CensoredTime { time_s: f64::from(time), is_event };
            let arm: Vec<CensoredTime> = times.iter().map(|pair| time(pair.0)).collect();
            let baseline: Vec<CensoredTime> = times.iter().map(|pair| time(pair.1)).collect();
            let found = PairedTimes::of(&arm, &baseline);
            let turned = PairedTimes::of(&baseline, &arm);
            prop_assert_eq!(found.until_s, turned.until_s);
            for (one, other) in found.differences_s.iter().zip(turned.differences_s) {
                prop_assert!((one + other).abs() < 1e-9);
            }
        }
    }
}
