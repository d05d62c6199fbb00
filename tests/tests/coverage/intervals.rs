//! How often intervals cover.

use std::collections::BTreeMap;
use std::fmt::Write;

use protocol::random;
use statistics::{CensoredTime, Estimate, PairedTimes};

use crate::population::{NUMBERS, Population, TIMES, draw};
use crate::{ERRORS, MIN_COVERED, SIZES, before, error};

/// Samples of each size.
const SAMPLES: usize = 4_000;
/// Samples of each size for what was used before.
const SAMPLES_BEFORE: usize = 300;

/// Of what there are intervals.
pub(crate) enum Kind {
    Mean(Vec<f64>),
    Difference(Vec<f64>),
    Share(Vec<bool>),
    DifferenceOfShares(Vec<(bool, bool)>),
    RestrictedMeans(Vec<(CensoredTime, CensoredTime)>),
}

/// An interval, if there is one, and the truth.
type Drawn = (Option<(f64, f64)>, f64);

/// The coverage of one kind of interval in one measure.
pub(crate) struct Row {
    name: String,
    /// Before and now, for each size: share that covers, and share of the samples that have an interval.
    covered: Vec<[(f64, f64); 2]>,
}

/// Everything that there are intervals of, with its name.
pub(crate) fn kinds(population: &Population) -> Vec<(String, Kind)> {
    let mut all = Vec::new();
    let mut add = |what: &str, of: &str, kind| all.push((format!("{what} | {of}"), kind));
    for arm in ["same", "faster"] {
        for measure in NUMBERS {
            let differences = population.differences(arm, measure);
            add(
                "difference of means",
                &format!("{measure}, {arm}"),
                Kind::Difference(differences),
            );
        }
    }
    for arm in ["same", "faster"] {
        for measure in TIMES {
            let pairs = population.pairs_of_times(arm, measure);
            add(
                "difference of restricted means",
                &format!("{measure}, {arm}"),
                Kind::RestrictedMeans(pairs),
            );
        }
    }
    for arm in ["base", "faster"] {
        for measure in NUMBERS {
            let numbers = population.numbers(arm, measure);
            add(
                "mean of an arm",
                &format!("{measure}, {arm}"),
                Kind::Mean(numbers),
            );
        }
    }

    for measure in TIMES {
        let times = population.times("base", measure);
        let ends = times.iter().map(|time| time.is_event).collect();
        add(
            "share of an arm",
            &format!("{measure}, by the end"),
            Kind::Share(ends),
        );
        let half_s = middle_s(&times);
        let halves = times.iter().map(|time| comes(time, half_s)).collect();
        add(
            "share of an arm",
            &format!("{measure}, by {half_s} s"),
            Kind::Share(halves),
        );

        let pairs = population.pairs_of_times("faster", measure);
        let ends = pairs
            .iter()
            .map(|(arm, base)| (arm.is_event, base.is_event));
        add(
            "difference of shares",
            &format!("{measure}, faster, by the end"),
            Kind::DifferenceOfShares(ends.collect()),
        );
        let halves = pairs
            .iter()
            .map(|(arm, base)| (comes(arm, half_s), comes(base, half_s)));
        add(
            "difference of shares",
            &format!("{measure}, faster, by {half_s} s"),
            Kind::DifferenceOfShares(halves.collect()),
        );
    }
    all.sort_by(|(one, _), (other, _)| {
        let what = |name: &str| name.split(" | ").next().map(str::to_owned);
        what(one).cmp(&what(other))
    });
    all
}

/// The median.
fn middle_s(times: &[CensoredTime]) -> f64 {
    let mut times_s: Vec<f64> = times.iter().map(|time| time.time_s).collect();
    times_s.sort_by(f64::total_cmp);
    times_s[times_s.len() / 2]
}

/// Whether the event comes by this time.
fn comes(time: &CensoredTime, by_s: f64) -> bool {
    time.is_event && time.time_s <= by_s
}

impl Row {
    pub(crate) fn of((name, kind): &(String, Kind)) -> Self {
        let mut covered = Vec::new();
        for n in SIZES {
            covered.push([false, true].map(|is_now| {
                let samples = if is_now { SAMPLES } else { SAMPLES_BEFORE };
                let mut stream = random::stream(n as u64, name);
                let mut truths = BTreeMap::new();
                let mut with_interval = 0;
                let mut covering = 0;
                for _ in 0..samples {
                    let (ends, truth) = kind.interval(n, is_now, &mut stream, &mut truths);
                    let Some((low, high)) = ends else {
                        continue;
                    };
                    with_interval += 1;
                    // A share of 1 is a sum whose last bits may differ.
                    let rounding = 1e-9 * (1.0 + truth.abs());
                    let covers = low - rounding <= truth && truth <= high + rounding;
                    covering += usize::from(covers);
                }
                let share = f64::from(covering as u32) / f64::from(with_interval.max(1) as u32);
                (share, with_interval as f64 / samples as f64)
            }));
        }
        Self {
            name: name.clone(),
            covered,
        }
    }

    /// From 8 pairs on, no interval of a mean covers too rarely. Those of shares depend on how the share fits the number of
    /// runs, so they are held on the average of the sizes.
    pub(crate) fn check(&self) {
        let mut sum = 0.0;
        for (n, [_, (covered, with_interval)]) in SIZES.iter().zip(&self.covered).skip(1) {
            sum += covered;
            let draws = (SAMPLES as f64 * with_interval) as usize;
            let least = MIN_COVERED - ERRORS * error(MIN_COVERED, draws);
            let is_share = self.name.contains("share");
            assert!(
                is_share || *covered >= least,
                "{}: {covered} at {n}",
                self.name
            );
        }
        assert!(sum / 4.0 >= MIN_COVERED - 0.01, "{}: {sum}", self.name);
    }
}

impl Kind {
    /// The interval of a sample.
    fn interval(
        &self,
        n: usize,
        is_now: bool,
        stream: &mut random::Stream,
        truths: &mut BTreeMap<u64, f64>,
    ) -> Drawn {
        match self {
            Self::Mean(all) => {
                let sample = draw(all, n, stream);
                let ends = if is_now {
                    Estimate::mean(&sample).bounds()
                } else {
                    // Before, it was Student's t.
                    Estimate::difference(&sample).bounds()
                };
                (ends, mean(all))
            }
            Self::Difference(all) => {
                let sample = draw(all, n, stream);
                let ends = if is_now {
                    Estimate::difference(&sample).bounds()
                } else {
                    before::bca(n, |indices| mean_at(&sample, indices))
                };
                (ends, mean(all))
            }
            Self::Share(all) => {
                let events = count(&draw(all, n, stream));
                let ends = if is_now {
                    Estimate::share(events, n).bounds()
                } else {
                    Some(before::greenwood(events, n))
                };
                (ends, count(all) as f64 / all.len() as f64)
            }
            Self::DifferenceOfShares(all) => {
                let signs = |pairs: &[(bool, bool)]| -> Vec<f64> {
                    let sign = |(arm, base): &(bool, bool)| {
                        f64::from(u8::from(*arm)) - f64::from(u8::from(*base))
                    };
                    pairs.iter().map(sign).collect()
                };
                let sample = signs(&draw(all, n, stream));
                let ends = if is_now {
                    let more = sample.iter().filter(|sign| **sign > 0.0).count();
                    let fewer = sample.iter().filter(|sign| **sign < 0.0).count();
                    Estimate::difference_of_shares(more, fewer, n).bounds()
                } else {
                    before::bca(n, |indices| mean_at(&sample, indices))
                };
                (ends, mean(&signs(all)))
            }
            Self::RestrictedMeans(all) => {
                let sample = draw(all, n, stream);
                let (arm, baseline): (Vec<CensoredTime>, Vec<CensoredTime>) =
                    sample.iter().copied().unzip();
                let times = PairedTimes::of(&arm, &baseline);
                let until_s = times.until_s;
                let ends = if is_now {
                    Estimate::mean(&times.differences_s).bounds()
                } else {
                    before::bca(n, |indices| before::restricted_s(&sample, indices, until_s))
                };
                let truth = truths.entry(until_s.to_bits()).or_insert_with(|| {
                    let indices: Vec<usize> = (0..all.len()).collect();
                    before::restricted_s(all, &indices, until_s)
                });
                (ends, *truth)
            }
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn mean_at(values: &[f64], indices: &[usize]) -> f64 {
    let sum: f64 = indices.iter().map(|index| values[*index]).sum();
    sum / indices.len() as f64
}

fn count(events: &[bool]) -> usize {
    events.iter().filter(|is_event| **is_event).count()
}

/// The table as Markdown: coverage before and now; in brackets the share of samples that have an interval, where not all do.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut text = "| Interval of | measure |".to_owned();
    for n in SIZES {
        let _infallible = write!(text, " n = {n} |");
    }
    text += "\n| --- | --- | ---: | ---: | ---: | ---: | ---: |\n";
    for row in rows {
        let _infallible = write!(text, "| {} |", row.name);
        for [before, now] in &row.covered {
            let cell = |(covered, with_interval): (f64, f64)| {
                if with_interval == 0.0 {
                    "none".to_owned()
                } else if with_interval < 0.995 {
                    format!("{:.1} ({:.0})", covered * 100.0, with_interval * 100.0)
                } else {
                    format!("{:.1}", covered * 100.0)
                }
            };
            let _infallible = write!(text, " {} → {} |", cell(*before), cell(*now));
        }
        text += "\n";
    }
    text
}
