//! How p values are distributed where there is no difference, and how often they are small where there is one.

use std::fmt::Write;

use protocol::random;
use statistics::{CensoredTime, PairedTimes, SignFlip};

use crate::population::{NUMBERS, Population, TIMES, draw};
use crate::{ERRORS, before, error};

/// Sizes of samples, and how many of each: with 64 pairs, a test takes a hundred times as long as with 8.
const SAMPLES: [(usize, usize); 3] = [(8, 2_000), (16, 600), (64, 200)];
/// Shares of p values below these limits are counted.
const LIMITS: [f64; 3] = [0.05, 0.1, 0.5];

/// Pairs of numbers, or of times.
pub(crate) enum Pairs {
    Numbers(Vec<f64>),
    Times(Vec<(CensoredTime, CensoredTime)>),
}

/// Pairs with their name, and whether it is drawn by lot which run of a pair is that of the arm.
type Kind = (String, Pairs, bool);

/// The p values in one measure.
pub(crate) struct Row {
    name: String,
    is_null: bool,
    is_time: bool,
    /// For each size, before and now: shares of the p values up to each limit.
    below: Vec<[[f64; 3]; 2]>,
}

/// Everything that is tested.
pub(crate) fn kinds(population: &Population) -> Vec<Kind> {
    let mut all = Vec::new();
    for (arm, is_null) in [("same", true), ("faster", false)] {
        let name = |measure: &str| {
            let what = if is_null { "no difference" } else { "faster" };
            format!("{what} | {measure}")
        };
        for measure in TIMES {
            let pairs = population.pairs_of_times(arm, measure);
            all.push((name(measure), Pairs::Times(pairs), is_null));
        }
        for measure in NUMBERS {
            let differences = population.differences(arm, measure);
            all.push((name(measure), Pairs::Numbers(differences), is_null));
        }
    }
    all
}

impl Row {
    pub(crate) fn of((name, pairs, is_null): &Kind) -> Self {
        let mut below = Vec::new();
        for (n, samples) in SAMPLES {
            let mut stream = random::stream(n as u64, name);
            let mut shares = [[0.0; 3]; 2];
            for _ in 0..samples {
                let p = pairs.p(n, *is_null, &mut stream);
                for (shares, p) in shares.iter_mut().zip(p) {
                    for (share, limit) in shares.iter_mut().zip(LIMITS) {
                        *share += f64::from(u8::from(p <= limit)) / samples as f64;
                    }
                }
            }
            below.push(shares);
        }
        Self {
            name: name.clone(),
            is_null: *is_null,
            is_time: matches!(pairs, Pairs::Times(_)),
            below,
        }
    }

    /// Where there is no difference, no limit is met more often than it says.
    pub(crate) fn check(&self) {
        if !self.is_null {
            return;
        }
        for ((n, samples), [_, now]) in SAMPLES.iter().zip(&self.below) {
            for (share, limit) in now.iter().zip(LIMITS) {
                let most = limit + ERRORS * error(limit, *samples);
                assert!(
                    *share <= most,
                    "{}: {share} up to {limit} at {n}",
                    self.name
                );
            }
        }
    }
}

impl Pairs {
    /// The p values of a sample, before and now.
    fn p(&self, n: usize, is_null: bool, stream: &mut random::Stream) -> [f64; 2] {
        match self {
            Self::Numbers(all) => {
                let mut sample = draw(all, n, stream);
                for difference in &mut sample {
                    if is_null && random::unit(stream) < 0.5 {
                        *difference = -*difference;
                    }
                }
                let p = SignFlip::of(&sample).p;
                [p, p]
            }
            Self::Times(all) => {
                let mut sample = draw(all, n, stream);
                for pair in &mut sample {
                    if is_null && random::unit(stream) < 0.5 {
                        *pair = (pair.1, pair.0);
                    }
                }
                let (arm, baseline): (Vec<CensoredTime>, Vec<CensoredTime>) =
                    sample.iter().copied().unzip();
                let times = PairedTimes::of(&arm, &baseline);
                let now = SignFlip::of(&times.differences_s).p;
                [before::log_rank(&sample), now]
            }
        }
    }
}

/// The table as Markdown: percentages of p values up to each limit.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut text = "| Arms | measure |".to_owned();
    for (n, _) in SAMPLES {
        let _infallible = write!(text, " n = {n} |");
    }
    text += "\n| --- | --- | ---: | ---: | ---: |\n";
    for row in rows {
        let _infallible = write!(text, "| {} |", row.name);
        for [before, now] in &row.below {
            let cell = |shares: &[f64; 3]| {
                let shares = shares.map(|share| format!("{:.1}", share * 100.0));
                shares.join(", ")
            };
            if row.is_time {
                let _infallible = write!(text, " {} → {} |", cell(before), cell(now));
            } else {
                let _infallible = write!(text, " {} |", cell(now));
            }
        }
        text += "\n";
    }
    text
}
