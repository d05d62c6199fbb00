//! Times to an event that does not occur in every run.

use serde::Serialize;

use crate::digits::{decimals_alone, fixed};
use crate::shares::wilson;

/// A time, seconds, and whether it ends with the event; otherwise the run ends then, without the event (right-censored).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CensoredTime {
    /// The time, seconds.
    pub time_s: f64,
    /// Whether the event occurs then.
    pub is_event: bool,
}

/// The estimate of Kaplan and Meier (1958) of the share of runs that are still without the event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survival {
    /// Size of the sample: runs at risk.
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
    /// Lower end of the 95 % confidence band at this time: the score interval of a share of as many runs as have Greenwood's
    /// variance without censoring (Rothman 1978, Estimation of confidence limits for the cumulative probability of survival in
    /// life table analysis, Journal of Chronic Diseases 31).
    pub low: f64,
    /// Upper end of the band.
    pub high: f64,
}

impl Survival {
    /// The estimate from independent runs.
    #[must_use]
    pub fn of(times: &[CensoredTime]) -> Self {
        let mut curve: Vec<SurvivalStep> = Vec::new();
        let mut share = 1.0;
        // Greenwood's sum.
        let mut sum = 0.0;
        let mut effective = times.len() as f64;
        for counts in tally(times) {
            let at_risk = counts.at_risk as f64;
            let events = counts.events as f64;
            share *= 1.0 - events / at_risk;
            sum += events / (at_risk * (at_risk - events));

            // Where no run is left, the variance is not defined, and the number is that of the step before.
            if share == 1.0 {
                effective = at_risk;
            } else if share > 0.0 {
                effective = (1.0 - share) / (share * sum);
            }
            let (low, high) = wilson(share, effective);
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
}

impl std::fmt::Display for Survival {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (sign, time_s) = match self.median_s {
            Some(median_s) => ("", median_s),
            None => ("> ", self.until_s),
        };
        write!(f, "{sign}{}", fixed(time_s, decimals_alone(time_s)))
    }
}

/// What happens to a sample at one time.
pub(super) struct RiskCounts {
    pub(super) time_s: f64,
    pub(super) at_risk: usize,
    pub(super) events: usize,
    censored: usize,
}

/// The times of a sample in their order, each once.
pub(super) fn tally(times: &[CensoredTime]) -> Vec<RiskCounts> {
    let mut sorted = times.to_vec();
    sorted.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));

    let mut tally: Vec<RiskCounts> = Vec::new();
    for (before, time) in sorted.iter().enumerate() {
        if tally.last().is_none_or(|last| last.time_s != time.time_s) {
            tally.push(RiskCounts {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{Estimate, ecdf};

    fn sample(events: &[f64], censored: &[f64]) -> Vec<CensoredTime> {
        let mut times = Vec::new();
        for time_s in events {
            times.push(CensoredTime {
                time_s: *time_s,
                is_event: true,
            });
        }
        for time_s in censored {
            times.push(CensoredTime {
                time_s: *time_s,
                is_event: false,
            });
        }
        times
    }

    /// Weeks of remission of children with leukemia (Freireich et al. 1963), with 6-mercaptopurine.
    fn mercaptopurine() -> Vec<CensoredTime> {
        sample(
            &[6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0],
            &[
                6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0,
            ],
        )
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

            // The interval of Wilson (1927), from the published standard error and back.
            let z = 1.96;
            let root = (step.share * (1.0 - step.share)).sqrt();
            let n = (root / error) * (root / error);
            let center = (step.share + z * z / (2.0 * n)) / (1.0 + z * z / n);
            let width = z * (root * root / n + z * z / (4.0 * n * n)).sqrt() / (1.0 + z * z / n);
            assert!((step.low - (center - width)).abs() < 2e-3, "{step:?}");
            assert!((step.high - (center + width)).abs() < 2e-3, "{step:?}");
        }
    }

    #[test]
    fn a_median_that_is_not_reached_is_open() {
        let half = Survival::of(&sample(&[10.0, 20.0], &[600.0, 600.0]));
        assert_eq!(half.median_s, Some(20.0));
        assert_eq!(half.to_string(), "20");
        assert_eq!(Survival::of(&sample(&[20.5], &[])).to_string(), "20.5");

        let fewer = Survival::of(&sample(&[10.0], &[600.0, 600.0]));
        assert_eq!(fewer.median_s, None);
        assert_eq!(fewer.to_string(), "> 600");
    }

    #[test]
    fn a_band_is_never_of_width_zero() {
        let all = Survival::of(&sample(&[10.0, 20.0], &[]));
        assert_eq!((all.curve[1].share, all.curve[1].low), (0.0, 0.0));
        assert!(all.curve[1].high > 0.5 && all.curve[1].high < all.curve[0].high);

        let none = Survival::of(&sample(&[], &[30.0; 64]));
        let (low, high) = Estimate::share(64, 64).bounds().unwrap();
        assert_eq!((none.curve[0].low, none.curve[0].high), (low, high));
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
                let events = (other.share * times.len() as f64).round() as usize;
                let (low, high) = Estimate::share(events, times.len()).bounds().unwrap();
                prop_assert!((step.low - (1.0 - high)).abs() < 1e-9, "{:?}", step);
                prop_assert!((step.high - (1.0 - low)).abs() < 1e-9, "{:?}", step);
            }
        }

        #[test]
        fn a_band_surrounds_its_curve_and_both_fall(
            times in prop::collection::vec((0_u8..20, any::<bool>()), 1..30),
        ) {
            let mut values = Vec::new();
            for (time, is_event) in times {
                values.push(CensoredTime { time_s: f64::from(time), is_event });
            }
            let survival = Survival::of(&values);
            for step in &survival.curve {
                prop_assert!(0.0 <= step.low && step.low <= step.share);
                prop_assert!(step.share <= step.high && step.high <= 1.0);
                prop_assert!(step.high - step.low > 0.05);
            }
            for pair in survival.curve.windows(2) {
                prop_assert!(pair[1].share <= pair[0].share);
            }
        }
    }
}
