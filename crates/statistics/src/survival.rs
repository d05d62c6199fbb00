//! Times to an event that does not occur in every run.

use serde::Serialize;

use crate::distribution::{chi_square_1_tail, normal_quantile};

/// A time, seconds, and whether it ends with the event; otherwise the run ends then, without the event (right-censored).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeTo {
    /// The time, seconds.
    pub time_s: f64,
    /// Whether the event occurs then.
    pub is_event: bool,
}

/// The estimate of Kaplan and Meier (1958) of the share of runs that are still without the event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survival {
    /// Size of the sample.
    pub n: usize,
    /// Number of runs with the event.
    pub events: usize,
    /// Time by which half of the runs have the event, seconds; `None` if that is not reached.
    pub median_s: Option<f64>,
    /// Lower end of the 95 % confidence interval of the median, seconds (Brookmeyer and Crowley 1982, from the band).
    pub median_low_s: Option<f64>,
    /// Upper end of that interval, seconds; `None` if the band does not fall to one half.
    pub median_high_s: Option<f64>,
    /// Longest time in the sample, seconds: where there is no median, it is more than this.
    pub until_s: f64,
    /// One step for each time at which the event occurs, or a run is censored. Before the first one, the share is 1.
    pub curve: Vec<SurvivalStep>,
}

/// A step of a survival curve; the share holds from its time on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurvivalStep {
    /// The time, seconds.
    pub time_s: f64,
    /// Number of runs that have been without the event and not censored until then.
    pub at_risk: usize,
    /// Number of runs with the event at this time.
    pub events: usize,
    /// Number of runs that are censored at this time; they count as at risk for its events.
    pub censored: usize,
    /// Share of runs without the event.
    pub share: f64,
    /// Lower end of the 95 % confidence band at this time: Greenwood's variance on the scale log(-log).
    pub low: f64,
    /// Upper end of the band. Where the share is 0, its variance is not defined, and the end is that of the step before.
    pub high: f64,
}

/// The log-rank test of two samples (Mantel 1966). It takes no account of pairs: where runs with the same seed are alike, its p
/// value is too large rather than too small.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LogRank {
    /// The test statistic; its distribution is chi-square with one degree of freedom if the samples do not differ.
    pub chi_square: f64,
    /// The p value; 1 where no time distinguishes the samples.
    pub p: f64,
}

/// The pairs of runs of two arms with the same seeds, prepared for restricted means of resamples.
#[derive(Debug, Clone)]
pub struct RestrictedMeans {
    arm: Vec<(usize, TimeTo)>,
    baseline: Vec<(usize, TimeTo)>,
    /// Up to which time the means count, seconds: as far as both curves are known. The curve of an arm all of whose longest
    /// times are those of events is at zero from then on.
    pub until_s: f64,
}

impl Survival {
    /// The estimate from independent runs.
    #[must_use]
    pub fn of(times: &[TimeTo]) -> Self {
        let z = normal_quantile(0.975);
        let mut curve: Vec<SurvivalStep> = Vec::new();
        let mut share = 1.0;
        let mut high = 1.0;
        // Greenwood's sum.
        let mut sum = 0.0;
        for counts in tally(times) {
            let at_risk = counts.at_risk as f64;
            let events = counts.events as f64;
            share *= 1.0 - events / at_risk;
            sum += events / (at_risk * (at_risk - events));

            let mut low = share;
            if share == 1.0 {
                high = 1.0;
            } else if share > 0.0 {
                let log = libm::log(share);
                let width = z * sum.sqrt() / log.abs();
                low = libm::pow(share, libm::exp(width));
                high = libm::pow(share, libm::exp(-width));
            }
            curve.push(SurvivalStep {
                time_s: counts.time_s,
                at_risk: counts.at_risk,
                events: counts.events,
                censored: counts.censored,
                share,
                low,
                high,
            });
        }

        Self {
            n: times.len(),
            events: times.iter().filter(|time| time.is_event).count(),
            median_s: falls_to_half(&curve, |step| step.share),
            median_low_s: falls_to_half(&curve, |step| step.low),
            median_high_s: falls_to_half(&curve, |step| step.high),
            until_s: curve.last().map_or(0.0, |step| step.time_s),
            curve,
        }
    }

    /// The mean of the times up to `until_s`, seconds, those that are longer counting as `until_s`: the area under the curve.
    #[must_use]
    pub fn restricted_mean_s(&self, until_s: f64) -> f64 {
        let mut area = 0.0;
        let mut since_s = 0.0;
        let mut share = 1.0;
        for step in &self.curve {
            if step.time_s >= until_s {
                break;
            }
            area += share * (step.time_s - since_s);
            since_s = step.time_s;
            share = step.share;
        }
        area + share * (until_s - since_s)
    }
}

impl std::fmt::Display for Survival {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.median_s {
            Some(median_s) => write!(f, "{median_s:.0}"),
            None => write!(f, "> {:.0}", self.until_s),
        }
    }
}

impl LogRank {
    /// Compares the times of two samples.
    #[must_use]
    pub fn of(a: &[TimeTo], b: &[TimeTo]) -> Self {
        let mut both = a.to_vec();
        both.extend_from_slice(b);
        let in_a = tally(a);

        let mut excess = 0.0;
        let mut variance = 0.0;
        for counts in tally(&both) {
            let at_risk = counts.at_risk as f64;
            let events = counts.events as f64;
            // The first time of `a` that is not before this one has the runs of `a` that are at risk now.
            let place = in_a.partition_point(|other| other.time_s < counts.time_s);
            let (at_risk_a, events_a) = match in_a.get(place) {
                Some(own) if own.time_s == counts.time_s => (own.at_risk, own.events),
                Some(own) => (own.at_risk, 0),
                None => (0, 0),
            };

            let share_a = at_risk_a as f64 / at_risk;
            excess += events_a as f64 - events * share_a;
            if counts.at_risk > 1 {
                let without = (at_risk - events) / (at_risk - 1.0);
                variance += events * share_a * (1.0 - share_a) * without;
            }
        }

        let chi_square = if variance > 0.0 {
            excess * excess / variance
        } else {
            0.0
        };
        Self {
            chi_square,
            p: chi_square_1_tail(chi_square),
        }
    }
}

impl RestrictedMeans {
    /// Pairs of times: those of the arm, and those of the baseline with the same seeds, in the same order.
    #[must_use]
    pub fn of_pairs(arm: &[TimeTo], baseline: &[TimeTo]) -> Self {
        let longest_s = longest_s(arm).max(longest_s(baseline));
        let until_s = known_until_s(arm).min(known_until_s(baseline));
        Self {
            until_s: until_s.min(longest_s),
            arm: sorted_with_indices(arm),
            baseline: sorted_with_indices(baseline),
        }
    }

    /// The difference of the restricted means of a resample of pairs, arm minus baseline, seconds.
    #[must_use]
    pub fn difference_s(&self, indices: &[usize]) -> f64 {
        let mut weights = vec![0; self.arm.len()];
        for index in indices {
            weights[*index] += 1;
        }

        let arm_s = weighted_mean_s(&self.arm, &weights, indices.len(), self.until_s);
        let baseline_s = weighted_mean_s(&self.baseline, &weights, indices.len(), self.until_s);
        arm_s - baseline_s
    }
}

/// Share of the runs with these indices that have the event.
#[must_use]
pub fn share_of_events(times: &[TimeTo], indices: &[usize]) -> f64 {
    let events = indices
        .iter()
        .filter(|index| times[**index].is_event)
        .count();
    events as f64 / indices.len() as f64
}

/// What happens to a sample at one time.
struct Counts {
    time_s: f64,
    at_risk: usize,
    events: usize,
    censored: usize,
}

/// The times of a sample in their order, each once.
fn tally(times: &[TimeTo]) -> Vec<Counts> {
    let mut sorted = times.to_vec();
    sorted.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));

    let mut tally: Vec<Counts> = Vec::new();
    for (before, time) in sorted.iter().enumerate() {
        if tally.last().is_none_or(|last| last.time_s != time.time_s) {
            tally.push(Counts {
                time_s: time.time_s,
                at_risk: sorted.len() - before,
                events: 0,
                censored: 0,
            });
        }
        if let Some(last) = tally.last_mut() {
            if time.is_event {
                last.events += 1;
            } else {
                last.censored += 1;
            }
        }
    }
    tally
}

fn falls_to_half(curve: &[SurvivalStep], end: impl Fn(&SurvivalStep) -> f64) -> Option<f64> {
    /// Shares are rounded products, also where they are one half.
    const HALF: f64 = 0.5 + 1e-9;

    let step = curve.iter().find(|step| end(step) <= HALF)?;
    Some(step.time_s)
}

fn longest_s(times: &[TimeTo]) -> f64 {
    times.iter().map(|time| time.time_s).fold(0.0, f64::max)
}

/// Up to which time a curve is known, seconds: without an end if it reaches zero.
fn known_until_s(times: &[TimeTo]) -> f64 {
    let longest_s = longest_s(times);
    let is_open = |time: &TimeTo| time.time_s >= longest_s && !time.is_event;
    if times.iter().any(is_open) {
        longest_s
    } else {
        f64::INFINITY
    }
}

/// The times in their order, each with its index in the sample. Events come first at the time at which a run is censored.
fn sorted_with_indices(times: &[TimeTo]) -> Vec<(usize, TimeTo)> {
    let mut sorted: Vec<(usize, TimeTo)> = times.iter().copied().enumerate().collect();
    sorted.sort_by(|(_, a), (_, b)| {
        let by_time = a.time_s.total_cmp(&b.time_s);
        by_time.then(b.is_event.cmp(&a.is_event))
    });
    sorted
}

/// The restricted mean of a sample in which the run of each index occurs as often as its weight. It is that of
/// [`Survival::restricted_mean_s`] without building the curve: it is computed for every resample.
fn weighted_mean_s(sorted: &[(usize, TimeTo)], weights: &[usize], n: usize, until_s: f64) -> f64 {
    let mut at_risk = n;
    let mut area = 0.0;
    let mut since_s = 0.0;
    let mut share = 1.0;

    for (index, time) in sorted {
        let weight = weights[*index];
        if weight == 0 {
            continue;
        }
        if time.time_s >= until_s {
            break;
        }

        if time.is_event {
            area += share * (time.time_s - since_s);
            since_s = time.time_s;
            // Equal times one after the other: the product is that of all of them at once.
            share *= (at_risk - weight) as f64 / at_risk as f64;
        }
        at_risk -= weight;
    }

    area + share * (until_s - since_s)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{bootstrap, ecdf};

    fn sample(events: &[f64], censored: &[f64]) -> Vec<TimeTo> {
        let mut times = Vec::new();
        for time_s in events {
            times.push(TimeTo {
                time_s: *time_s,
                is_event: true,
            });
        }
        for time_s in censored {
            times.push(TimeTo {
                time_s: *time_s,
                is_event: false,
            });
        }
        times
    }

    /// Weeks of remission of children with leukemia (Freireich et al. 1963), with 6-mercaptopurine.
    fn mercaptopurine() -> Vec<TimeTo> {
        sample(
            &[6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0],
            &[
                6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0,
            ],
        )
    }

    /// The same with a placebo.
    fn placebo() -> Vec<TimeTo> {
        sample(
            &[
                1.0, 1.0, 2.0, 2.0, 3.0, 4.0, 4.0, 5.0, 5.0, 8.0, 8.0, 8.0, 8.0, 11.0, 11.0, 12.0,
                12.0, 15.0, 17.0, 22.0, 23.0,
            ],
            &[],
        )
    }

    #[test]
    fn restricted_means_count_as_far_as_both_curves_are_known() {
        let events = |times: &[f64]| -> Vec<TimeTo> {
            let times = times.iter();
            times
                .map(|time_s| TimeTo {
                    time_s: *time_s,
                    is_event: true,
                })
                .collect()
        };
        let fast = events(&[10.0, 20.0, 30.0]);
        let slow = events(&[10.0, 100.0, 190.0]);
        let means = RestrictedMeans::of_pairs(&fast, &slow);
        assert_eq!(means.until_s, 190.0);
        assert!((means.difference_s(&[0, 1, 2]) + 80.0).abs() < 1e-9);

        // Of the last run of the other arm it is not known when it would have had the event.
        let mut cut = slow.clone();
        cut[2].is_event = false;
        assert_eq!(RestrictedMeans::of_pairs(&fast, &cut).until_s, 190.0);
        let mut cut = fast.clone();
        cut[2].is_event = false;
        assert_eq!(RestrictedMeans::of_pairs(&cut, &slow).until_s, 30.0);
    }

    #[test]
    fn the_curve_is_that_of_the_published_table() {
        // Klein and Moeschberger 2003, Survival Analysis, table 4.1A: time, events, at risk, share, standard error.
        let published = [
            (6.0, 3, 21, 0.857, 0.076),
            (7.0, 1, 17, 0.807, 0.087),
            (10.0, 1, 15, 0.753, 0.096),
            (13.0, 1, 12, 0.690, 0.107),
            (16.0, 1, 11, 0.628, 0.114),
            (22.0, 1, 7, 0.538, 0.128),
            (23.0, 1, 6, 0.448, 0.135),
        ];
        let found = Survival::of(&mercaptopurine());
        assert_eq!((found.n, found.events), (21, 9));
        assert_eq!(found.median_s, Some(23.0));

        let steps: Vec<&SurvivalStep> = found.curve.iter().filter(|step| step.events > 0).collect();
        assert_eq!(steps.len(), published.len());
        for (step, (time_s, events, at_risk, share, error)) in steps.into_iter().zip(published) {
            assert_eq!(
                (step.time_s, step.events, step.at_risk),
                (time_s, events, at_risk)
            );
            assert!((step.share - share).abs() < 6e-4, "{step:?}");

            // The band is symmetric on the scale log(-log), where the standard error is that of the share over S log S.
            let scale = |end: f64| libm::log(-libm::log(end));
            let width = (scale(step.low) - scale(step.high)) / 2.0;
            let found = width / 1.96 * -step.share * libm::log(step.share);
            assert!((found - error).abs() < 6e-4, "{step:?}: {found}");
        }
    }

    #[test]
    fn the_log_rank_test_is_the_published_one() {
        // The comparison of the two groups by R's survdiff, in textbooks: chi-square 16.8, p = 4e-05.
        let found = LogRank::of(&mercaptopurine(), &placebo());
        assert!((found.chi_square - 16.79).abs() < 5e-3, "{found:?}");
        assert!((found.p - 4.17e-5).abs() < 1e-7, "{found:?}");
    }

    #[test]
    fn samples_that_nothing_distinguishes_are_not_different() {
        let none = sample(&[], &[600.0, 600.0]);
        assert_eq!(LogRank::of(&none, &none).p, 1.0);
        assert_eq!(LogRank::of(&placebo(), &placebo()).p, 1.0);
        assert_eq!(LogRank::of(&[], &placebo()).p, 1.0);
    }

    #[test]
    fn a_median_that_is_not_reached_is_open() {
        let half = Survival::of(&sample(&[10.0, 20.0], &[600.0, 600.0]));
        assert_eq!(half.median_s, Some(20.0));
        assert_eq!(half.to_string(), "20");

        let fewer = Survival::of(&sample(&[10.0], &[600.0, 600.0]));
        assert_eq!(fewer.median_s, None);
        assert_eq!(fewer.to_string(), "> 600");
    }

    #[test]
    fn a_band_stays_where_no_run_is_left() {
        let all = Survival::of(&sample(&[10.0, 20.0], &[]));
        assert_eq!((all.curve[1].share, all.curve[1].low), (0.0, 0.0));
        assert_eq!(all.curve[1].high, all.curve[0].high);

        let none = Survival::of(&sample(&[], &[30.0]));
        assert_eq!((none.curve[0].low, none.curve[0].high), (1.0, 1.0));
    }

    #[test]
    fn the_restricted_mean_of_a_resample_is_that_of_its_curve() {
        let arm = mercaptopurine();
        let baseline = placebo();
        let means = RestrictedMeans::of_pairs(&arm, &baseline);
        // The curve of the placebo is at zero from 23 weeks on; that of the other arm is known for 35.
        assert_eq!(means.until_s, 35.0);

        let found = bootstrap(arm.len(), |indices| {
            let mut arms = Vec::new();
            let mut baselines = Vec::new();
            for index in indices {
                arms.push(arm[*index]);
                baselines.push(baseline[*index]);
            }
            let arm_s = Survival::of(&arms).restricted_mean_s(means.until_s);
            let expected = arm_s - Survival::of(&baselines).restricted_mean_s(means.until_s);

            let difference_s = means.difference_s(indices);
            assert!((difference_s - expected).abs() < 1e-9);
            difference_s
        });
        let (low, high) = found.interval.bounds().unwrap();
        assert!(
            low > 0.0 && low < found.value && found.value < high,
            "{found:?}"
        );
    }

    proptest! {
        #[test]
        fn without_censoring_the_curve_is_the_distribution(times in prop::collection::vec(0_u8..20, 1..30)) {
            let times: Vec<f64> = times.into_iter().map(f64::from).collect();
            let survival = Survival::of(&sample(&times, &[]));

            let steps = ecdf(&times);
            prop_assert_eq!(survival.curve.len(), steps.len());
            for (step, other) in survival.curve.iter().zip(steps) {
                prop_assert_eq!(step.time_s, other.value);
                prop_assert!((step.share - (1.0 - other.share)).abs() < 1e-12);
            }
            let mean = times.iter().sum::<f64>() / times.len() as f64;
            prop_assert!((survival.restricted_mean_s(20.0) - mean).abs() < 1e-9);
        }

        #[test]
        fn a_band_surrounds_its_curve_and_both_fall(
            times in prop::collection::vec((0_u8..20, any::<bool>()), 1..30),
        ) {
            let mut values = Vec::new();
            for (time, is_event) in times {
                values.push(TimeTo { time_s: f64::from(time), is_event });
            }
            let survival = Survival::of(&values);
            for step in &survival.curve {
                prop_assert!(0.0 <= step.low && step.low <= step.share);
                prop_assert!(step.share <= step.high && step.high <= 1.0);
            }
            for pair in survival.curve.windows(2) {
                prop_assert!(pair[1].share <= pair[0].share);
            }
        }
    }
}
