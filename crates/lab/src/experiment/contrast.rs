//! Differences between arms, paired by seed: runs with the same seed begin alike and have the same chance.

use std::collections::BTreeMap;

use serde::Serialize;
use statistics::{
    Bootstrapped, LogRank, RestrictedMeans, SignFlip, TimeTo, bootstrap, dominance, holm,
    share_of_events,
};

use super::estimate::{conditions_of, numbers, times};
use super::file::Experiment;
use super::outcome::Outcome;

/// The difference between an arm and the baseline in one measure under one condition.
#[derive(Debug, Clone, Serialize)]
pub struct Contrast {
    /// Name of the measure.
    pub measure: String,
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Name of the arm that it is compared with.
    pub baseline: String,
    /// Number of pairs: seeds with which both arms were run.
    pub n: usize,
    /// Arm minus baseline.
    #[serde(flatten)]
    pub difference: Difference,
    /// The p value of the test, corrected by Holm's procedure for all contrasts of this measure: every arm under every
    /// condition.
    pub p_holm: f64,
}

/// Arm minus baseline.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Difference {
    /// Of a number of each run.
    Number {
        /// Difference of the means.
        mean: Bootstrapped,
        /// Cliff's delta of the pairs, from -1 to 1.
        dominance: f64,
        /// Test of the pairs.
        test: SignFlip,
    },
    /// Of the time to an event, which some runs do not reach.
    Time {
        /// Difference of the shares of runs with the event.
        share: Bootstrapped,
        /// Difference of the mean times, seconds, where longer times and those of runs without the event count as `until_s`.
        restricted_mean_s: Bootstrapped,
        /// Up to which time the means count, seconds.
        until_s: f64,
        /// Test of the times, unpaired.
        test: LogRank,
    },
}

impl Difference {
    /// The p value of the test, not corrected.
    #[must_use]
    pub fn p(&self) -> f64 {
        match self {
            Self::Number { test, .. } => test.p,
            Self::Time { test, .. } => test.p,
        }
    }

    fn of_numbers(arm: &[f64], baseline: &[f64]) -> Self {
        let pairs = arm.iter().zip(baseline);
        let differences: Vec<f64> = pairs.map(|(value, other)| value - other).collect();

        Self::Number {
            mean: bootstrap(differences.len(), |indices| {
                let sum: f64 = indices.iter().map(|index| differences[*index]).sum();
                sum / indices.len() as f64
            }),
            dominance: dominance(&differences),
            test: SignFlip::of(&differences),
        }
    }

    fn of_times(arm: &[TimeTo], baseline: &[TimeTo]) -> Self {
        let means = RestrictedMeans::of_pairs(arm, baseline);
        Self::Time {
            share: bootstrap(arm.len(), |indices| {
                share_of_events(arm, indices) - share_of_events(baseline, indices)
            }),
            restricted_mean_s: bootstrap(arm.len(), |indices| means.difference_s(indices)),
            until_s: means.until_s,
            test: LogRank::of(arm, baseline),
        }
    }
}

impl Experiment {
    /// Differences of every arm to the baseline in every measure under each condition, in the order of the file; none without
    /// a baseline, or where no seed was run in both arms.
    #[must_use]
    pub fn contrast(&self, outcomes: &[Outcome]) -> Vec<Contrast> {
        let Some(baseline) = &self.baseline else {
            return Vec::new();
        };

        let mut contrasts = Vec::new();
        for measure in &self.measures {
            if !measure.contrast {
                continue;
            }

            let mut family = Vec::new();
            for condition in conditions_of(outcomes) {
                for arm in &self.arms {
                    if arm.name == *baseline {
                        continue;
                    }
                    let cells = [arm.name.as_str(), baseline];
                    let difference = if measure.is_time() {
                        let samples = cells.map(|arm| times(outcomes, measure, condition, arm));
                        paired(&samples, Difference::of_times)
                    } else {
                        let samples = cells.map(|arm| numbers(outcomes, measure, condition, arm));
                        paired(&samples, Difference::of_numbers)
                    };
                    let Some((n, difference)) = difference else {
                        continue;
                    };
                    family.push(Contrast {
                        measure: measure.name.clone(),
                        condition: condition.to_owned(),
                        arm: arm.name.clone(),
                        baseline: baseline.clone(),
                        n,
                        difference,
                        p_holm: 1.0,
                    });
                }
            }

            correct(&mut family);
            contrasts.append(&mut family);
        }
        contrasts
    }
}

/// Compares the runs of two arms that have the same seeds; returns their number, too. `None` if there are no such runs.
fn paired<T: Copy>(
    [arm, baseline]: &[BTreeMap<u64, T>; 2],
    compare: impl Fn(&[T], &[T]) -> Difference,
) -> Option<(usize, Difference)> {
    let mut runs = Vec::new();
    let mut others = Vec::new();
    for (seed, run) in arm {
        if let Some(other) = baseline.get(seed) {
            runs.push(*run);
            others.push(*other);
        }
    }

    if runs.is_empty() {
        return None;
    }

    Some((runs.len(), compare(&runs, &others)))
}

/// Corrects the p values of a family of contrasts.
fn correct(family: &mut [Contrast]) {
    let p_values: Vec<f64> = family
        .iter()
        .map(|contrast| contrast.difference.p())
        .collect();
    for (contrast, p_holm) in family.iter_mut().zip(holm(&p_values)) {
        contrast.p_holm = p_holm;
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use observe::Measured;
    use statistics::Interval;

    use super::super::estimate::Estimated;
    use super::*;

    /// Runs of the shipped experiment under two conditions with eight seeds, in which an arm is so much better than the
    /// baseline, and deadlocks in every second run, while the baseline never does.
    fn outcomes(experiment: &Experiment, better: &BTreeMap<&str, f64>) -> Vec<Outcome> {
        let mut outcomes = Vec::new();
        for condition in ["0", "0.5"] {
            for arm in &experiment.arms {
                for seed in 1..=8_u32 {
                    let is_baseline = arm.name == "emotions";
                    let is_stalled = !is_baseline && seed % 2 == 0;
                    let own = better.get(arm.name.as_str()).copied().unwrap_or(0.0);

                    let mut measures = BTreeMap::new();
                    for measure in &experiment.measures {
                        let number = f64::from(seed * seed) + own * f64::from(seed);
                        let measured = match (measure.is_time(), is_stalled) {
                            (false, _) => Measured::Value { value: number },
                            (true, true) => Measured::Reached { time_s: 60.0 },
                            (true, false) => Measured::NotReached { waited_s: 600.0 },
                        };
                        measures.insert(measure.name.clone(), measured);
                    }
                    outcomes.push(Outcome {
                        unit: outcomes.len(),
                        condition: condition.to_owned(),
                        levels: Vec::new(),
                        arm: arm.name.clone(),
                        seed: u64::from(seed),
                        yoked_to_seed: None,
                        digest: String::new(),
                        measures,
                        verdicts: BTreeMap::new(),
                    });
                }
            }
        }
        outcomes
    }

    fn find<'a>(contrasts: &'a [Contrast], measure: &str, arm: &str) -> &'a Contrast {
        let mut found = contrasts.iter();
        let found = found.find(|contrast| contrast.measure == measure && contrast.arm == arm);
        found.unwrap()
    }

    #[test]
    fn numbers_are_compared_in_pairs_and_corrected_in_families() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let better = BTreeMap::from([("rules", 2.0), ("timer", -1.0)]);
        let contrasts = experiment.contrast(&outcomes(&experiment, &better));

        // Each of the four other arms under each condition, in two measures.
        let compared = experiment
            .measures
            .iter()
            .filter(|measure| measure.contrast);
        assert_eq!(contrasts.len(), 4 * 2 * compared.count());
        let rules = find(&contrasts, "served", "rules");
        assert_eq!((rules.n, rules.condition.as_str()), (8, "0"));
        let Difference::Number {
            mean,
            dominance,
            test,
        } = &rules.difference
        else {
            panic!("{rules:?}");
        };
        assert_eq!((mean.value, *dominance), (9.0, 1.0));
        let (low, high) = mean.interval.bounds().unwrap();
        assert!(
            low > 2.0 && low < 9.0 && high > 9.0 && high < 16.0,
            "{mean:?}"
        );

        // Eight equal signs: 2 of 256. Four of the eight tests of the family have this p value.
        assert_eq!(test.p, 2.0 / 256.0);
        assert_eq!(rules.p_holm, 8.0 * 2.0 / 256.0);
        let neither = find(&contrasts, "served", "neither");
        assert_eq!((neither.difference.p(), neither.p_holm), (1.0, 1.0));
        let Difference::Number { mean, .. } = &neither.difference else {
            panic!("{neither:?}");
        };
        assert_eq!((mean.value, mean.interval), (0.0, Interval::AllEqual));
    }

    #[test]
    fn times_are_compared_by_their_curves() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let outcomes = outcomes(&experiment, &BTreeMap::new());
        let contrasts = experiment.contrast(&outcomes);
        let rules = find(&contrasts, "deadlock", "rules");
        let Difference::Time {
            share,
            restricted_mean_s,
            until_s,
            test,
        } = &rules.difference
        else {
            panic!("{rules:?}");
        };
        assert_eq!((share.value, *until_s), (0.5, 600.0));
        assert!(
            (restricted_mean_s.value + 270.0).abs() < 1e-9,
            "{restricted_mean_s:?}"
        );
        assert!(test.p > 0.01 && test.p < 0.05, "{test:?}");

        let cells = experiment.estimate(&outcomes);
        assert_eq!(cells.len(), 5 * 2 * experiment.measures.len());
        let mut cells = cells.iter();
        let cell = cells.find(|cell| cell.measure == "deadlock" && cell.arm == "rules");
        let Estimated::Time(survival) = &cell.unwrap().estimate else {
            panic!("{cell:?}");
        };
        assert_eq!((survival.n, survival.events), (8, 4));
        assert_eq!(survival.median_s, Some(60.0));
    }

    #[test]
    fn only_seeds_of_both_arms_count() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let mut outcomes = outcomes(&experiment, &BTreeMap::new());
        outcomes.retain(|run| run.arm != "timer" && (run.arm != "rules" || run.seed < 3));
        let contrasts = experiment.contrast(&outcomes);
        assert!(contrasts.iter().all(|contrast| contrast.arm != "timer"));

        let rules = find(&contrasts, "served", "rules");
        assert_eq!(rules.n, 2);
        let Difference::Number { mean, .. } = &rules.difference else {
            panic!("{rules:?}");
        };
        assert_eq!(mean.interval, Interval::TooFew);
    }

    #[test]
    fn the_json_of_a_contrast_is_flat() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let better = BTreeMap::from([("rules", 2.0)]);
        let contrasts = experiment.contrast(&outcomes(&experiment, &better));
        let json = serde_json::to_value(find(&contrasts, "served", "rules")).unwrap();
        assert_eq!(json["kind"], "number");
        assert_eq!(json["baseline"], "emotions");
        assert_eq!(json["mean"]["value"], 9.0);
        assert!(json["mean"]["interval"]["bca"]["low"].is_f64());
        assert_eq!(json["test"]["is_exact"], true);
        let json = serde_json::to_value(find(&contrasts, "served", "neither")).unwrap();
        assert_eq!(json["mean"]["interval"], "all_equal");
    }
}
