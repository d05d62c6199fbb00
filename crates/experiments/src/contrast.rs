//! Differences between arms, paired by seed: runs with the same seed begin alike and have the same chance.

use std::collections::BTreeMap;

use observe::{Measure, Measured};
use serde::Serialize;
use statistics::{
    CensoredTime, Estimate, Interval, MIN_VALUES, PairedTimes, SignFlip, dominance, holm, least_p,
};

use super::estimate::{Excluded, by_seed, conditions_of, failed, time_of};
use super::file::Experiment;
use super::outcome::{FailedUnit, UnitOutcome};

/// Largest p value, after Holm's correction, of a difference that is stated.
pub const SHOWN_P: f64 = 0.05;

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
    /// Number of pairs: seeds with which the runs of both arms have a number.
    pub n: usize,
    /// The runs of the arm that have none.
    pub excluded: Excluded,
    /// The runs of the baseline that have none.
    pub excluded_baseline: Excluded,
    /// Arm minus baseline.
    #[serde(flatten)]
    pub difference: ArmDifference,
    /// The p value of the test, corrected by Holm's procedure for all tests of this measure: every arm under every condition.
    /// `None` if there is no test.
    pub p_holm: Option<f64>,
    /// Number of these tests.
    pub comparisons: usize,
}

/// Arm minus baseline.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ArmDifference {
    /// Of a number of each run.
    Number {
        /// Difference of the means.
        mean: Estimate,
        /// Cliff's delta of the pairs, from -1 to 1.
        dominance: f64,
        /// Test of the pairs.
        test: SignFlip,
    },
    /// Of the time to an event, which some runs do not reach.
    Time {
        /// Difference of the shares of runs with the event.
        share: Estimate,
        /// Difference of the mean times, seconds, where longer times and those of runs without the event count as `until_s`.
        restricted_mean_s: Estimate,
        /// Up to which time the times count, seconds.
        until_s: f64,
        /// Test of the differences of these times.
        test: SignFlip,
    },
    /// There are fewer pairs than a test and an interval need.
    NoPair,
    /// The numbers are so large that their differences have no finite mean or variance.
    NotFinite,
}

impl ArmDifference {
    /// The p value of the test, not corrected.
    #[must_use]
    pub fn p(&self) -> Option<f64> {
        match self {
            Self::Number { test, .. } | Self::Time { test, .. } => Some(test.p),
            Self::NoPair | Self::NotFinite => None,
        }
    }

    fn of_numbers(pairs: &[(f64, f64)]) -> Self {
        let differences: Vec<f64> = pairs.iter().map(|(arm, baseline)| arm - baseline).collect();
        let mean = Estimate::difference(&differences);
        match mean.interval {
            Interval::TooFew => Self::NoPair,
            Interval::NotFinite => Self::NotFinite,
            Interval::AllEqual | Interval::Ends { .. } => Self::Number {
                mean,
                dominance: dominance(&differences),
                test: SignFlip::of(&differences),
            },
        }
    }

    fn of_times(pairs: &[(CensoredTime, CensoredTime)]) -> Self {
        if pairs.len() < MIN_VALUES {
            return Self::NoPair;
        }

        let (arm, baseline): (Vec<CensoredTime>, Vec<CensoredTime>) = pairs.iter().copied().unzip();
        let only = |one: &[CensoredTime], other: &[CensoredTime]| {
            let pairs = one.iter().zip(other);
            let only = pairs.filter(|(one, other)| one.is_event && !other.is_event);
            only.count()
        };
        let times = PairedTimes::of(&arm, &baseline);
        Self::Time {
            share: Estimate::difference_of_shares(
                only(&arm, &baseline),
                only(&baseline, &arm),
                pairs.len(),
            ),
            // Most pairs are alike and few differ by much, which is as skewed as the times of one arm.
            restricted_mean_s: within(Estimate::mean(&times.differences_s), times.until_s),
            until_s: times.until_s,
            test: SignFlip::of(&times.differences_s),
        }
    }
}

impl Contrast {
    /// Why there is no difference, if there is none.
    #[must_use]
    pub fn no_difference(&self) -> Option<String> {
        match self.difference {
            ArmDifference::Number { .. } | ArmDifference::Time { .. } => None,
            ArmDifference::NoPair if self.n == 0 => Some("no pair".to_owned()),
            ArmDifference::NoPair => Some("too few pairs".to_owned()),
            ArmDifference::NotFinite => Some("not finite".to_owned()),
        }
    }
}

impl Experiment {
    /// Differences of every arm to the baseline in every measure under each condition, in the order of the file; none without
    /// a baseline, or where one of the arms was not run.
    #[must_use]
    pub fn contrast(&self, outcomes: &[UnitOutcome], failures: &[FailedUnit]) -> Vec<Contrast> {
        let Some(baseline) = &self.baseline else {
            return Vec::new();
        };

        let mut contrasts = Vec::new();
        for measure in &self.measures {
            if !measure.contrast {
                continue;
            }

            let mut family = Vec::new();
            for condition in conditions_of(outcomes, failures) {
                let of_baseline = by_seed(outcomes, measure, condition, baseline);
                let failed_of_baseline = failed(failures, condition, baseline);
                for arm in &self.arms {
                    let of_arm = by_seed(outcomes, measure, condition, &arm.name);
                    let failed_of_arm = failed(failures, condition, &arm.name);
                    let is_played = of_arm.len() + failed_of_arm > 0;
                    let is_baseline_played = of_baseline.len() + failed_of_baseline > 0;
                    if arm.name == *baseline || !is_played || !is_baseline_played {
                        continue;
                    }
                    let (n, difference) = compare(measure, &of_arm, &of_baseline);
                    family.push(Contrast {
                        measure: measure.name.clone(),
                        condition: condition.to_owned(),
                        arm: arm.name.clone(),
                        baseline: baseline.clone(),
                        n,
                        excluded: Excluded::of(of_arm.values().copied(), failed_of_arm),
                        excluded_baseline: Excluded::of(
                            of_baseline.values().copied(),
                            failed_of_baseline,
                        ),
                        difference,
                        p_holm: None,
                        comparisons: 0,
                    });
                }
            }

            correct(&mut family);
            contrasts.append(&mut family);
        }
        contrasts
    }
}

/// The least p value that contrasts of one measure can have after their correction: the one with most pairs, where all pairs
/// differ in one direction.
#[must_use]
pub fn least_p_holm(contrasts: &[&Contrast]) -> f64 {
    let tested = contrasts.iter().filter(|one| one.p_holm.is_some());
    let least = tested.map(|one| least_p(one.n) * one.comparisons as f64);
    least.fold(1.0, f64::min)
}

/// Compares the runs of two arms that have the same seeds and a number; returns how many pairs they are, too.
fn compare(
    measure: &Measure,
    arm: &BTreeMap<u64, &Measured>,
    baseline: &BTreeMap<u64, &Measured>,
) -> (usize, ArmDifference) {
    if measure.is_time() {
        let pairs = paired(arm, baseline, time_of);
        (pairs.len(), ArmDifference::of_times(&pairs))
    } else {
        let pairs = paired(arm, baseline, Measured::value);
        (pairs.len(), ArmDifference::of_numbers(&pairs))
    }
}

/// The numbers of the runs with the same seeds, where both have one.
fn paired<T>(
    arm: &BTreeMap<u64, &Measured>,
    baseline: &BTreeMap<u64, &Measured>,
    number: impl Fn(&Measured) -> Option<T>,
) -> Vec<(T, T)> {
    let mut pairs = Vec::new();
    for (seed, run) in arm {
        let other = baseline.get(seed).copied().and_then(&number);
        pairs.extend(number(run).zip(other));
    }
    pairs
}

/// An estimate of a difference of times none of which is longer than this.
fn within(mut estimate: Estimate, until_s: f64) -> Estimate {
    if let Interval::Ends { low, high } = &mut estimate.interval {
        *low = low.max(-until_s);
        *high = high.min(until_s);
    }
    estimate
}

/// Corrects the p values of a family of contrasts: of those that have one.
fn correct(family: &mut [Contrast]) {
    let p_values: Vec<f64> = family
        .iter()
        .filter_map(|contrast| contrast.difference.p())
        .collect();
    let mut corrected = holm(&p_values).into_iter();
    for contrast in family {
        contrast.comparisons = p_values.len();
        if contrast.difference.p().is_some() {
            contrast.p_holm = corrected.next();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::estimate::Estimated;
    use super::*;

    /// Runs of the shipped experiment under two conditions with eight seeds, in which an arm is so much better than the
    /// baseline, and deadlocks in every second run, while the baseline never does.
    fn outcomes(experiment: &Experiment, better: &BTreeMap<&str, f64>) -> Vec<UnitOutcome> {
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
                    outcomes.push(UnitOutcome {
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
        let contrasts = experiment.contrast(&outcomes(&experiment, &better), &[]);

        // Each of the four other arms under each condition, in two measures.
        let compared = experiment
            .measures
            .iter()
            .filter(|measure| measure.contrast);
        assert_eq!(contrasts.len(), 4 * 2 * compared.count());
        let rules = find(&contrasts, "served", "rules");
        assert_eq!((rules.n, rules.condition.as_str()), (8, "0"));
        let ArmDifference::Number {
            mean,
            dominance,
            test,
        } = &rules.difference
        else {
            panic!("{rules:?}");
        };
        assert_eq!((mean.value, *dominance), (9.0, 1.0));
        // t of 7 degrees of freedom, 2.365, and the deviation of 2, 4, …, 16.
        let (low, high) = mean.bounds().unwrap();
        let half_width = 2.3646 * 24.0_f64.sqrt() / 8.0_f64.sqrt();
        assert!((low - (9.0 - half_width)).abs() < 1e-3, "{mean:?}");
        assert!((high - (9.0 + half_width)).abs() < 1e-3, "{mean:?}");

        // Eight equal signs: 2 of 256. Four of the eight tests of the family have this p value.
        assert_eq!(test.p, 2.0 / 256.0);
        assert_eq!(
            (rules.p_holm, rules.comparisons),
            (Some(8.0 * 2.0 / 256.0), 8)
        );
        let neither = find(&contrasts, "served", "neither");
        assert_eq!(
            (neither.difference.p(), neither.p_holm),
            (Some(1.0), Some(1.0))
        );
        let ArmDifference::Number { mean, .. } = &neither.difference else {
            panic!("{neither:?}");
        };
        assert_eq!((mean.value, mean.interval), (0.0, Interval::AllEqual));
    }

    #[test]
    fn times_are_compared_in_pairs() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let outcomes = outcomes(&experiment, &BTreeMap::new());
        let contrasts = experiment.contrast(&outcomes, &[]);
        let rules = find(&contrasts, "deadlock", "rules");
        let ArmDifference::Time {
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
        // Of 16 assignments of the signs of the four pairs that differ, two are as far.
        assert_eq!(test.p, 2.0 / 16.0);
        assert_eq!(share.n, 8);
        let (low, high) = share.bounds().unwrap();
        assert!(low > 0.0 && high < 0.9, "{share:?}");

        let cells = experiment.estimate(&outcomes, &[]);
        assert_eq!(cells.len(), 5 * 2 * experiment.measures.len());
        let mut cells = cells.iter();
        let cell = cells.find(|cell| cell.measure == "deadlock" && cell.arm == "rules");
        let Estimated::Time { survival, share } = &cell.unwrap().estimate else {
            panic!("{cell:?}");
        };
        assert_eq!((share.value, share.n), (0.5, 8));
        assert_eq!((survival.n, survival.events), (8, 4));
        assert_eq!(survival.median_s, Some(60.0));
    }

    #[test]
    fn only_seeds_of_both_arms_count() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let mut outcomes = outcomes(&experiment, &BTreeMap::new());
        outcomes.retain(|run| run.arm != "timer" && (run.arm != "rules" || run.seed < 3));
        let contrasts = experiment.contrast(&outcomes, &[]);
        assert!(contrasts.iter().all(|contrast| contrast.arm != "timer"));

        let rules = find(&contrasts, "served", "rules");
        assert_eq!(rules.n, 2);
        assert_eq!(rules.difference, ArmDifference::NoPair);
        assert_eq!(rules.p_holm, None);
        let yoked = find(&contrasts, "served", "yoked");
        assert_eq!(yoked.comparisons, 4, "{yoked:?}");
    }

    /// Runs of one condition, in which both arms measured these, by seed.
    fn measured(
        experiment: &Experiment,
        arm: &[Measured],
        baseline: &[Measured],
    ) -> Vec<UnitOutcome> {
        let mut all = outcomes(experiment, &BTreeMap::new());
        all.retain(|run| run.condition == "0" && ["rules", "emotions"].contains(&&*run.arm));
        for run in &mut all {
            let of = if run.arm == "rules" { arm } else { baseline };
            let measured = of[run.seed as usize - 1].clone();
            for one in run.measures.values_mut() {
                *one = measured.clone();
            }
        }
        all
    }

    #[test]
    fn runs_that_were_never_at_risk_are_in_no_number() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let at = |time_s| Measured::Reached { time_s };
        let not = Measured::NotAtRisk;
        // Every run at risk has the event at once.
        let arm = [0.0; 8].map(at);
        let mut baseline = arm.clone();
        for one in &mut baseline[..5] {
            *one = not.clone();
        }
        let outcomes = measured(&experiment, &arm, &baseline);

        let contrasts = experiment.contrast(&outcomes, &[]);
        let rules = find(&contrasts, "deadlock", "rules");
        assert_eq!((rules.n, rules.excluded.not_at_risk), (3, 0));
        assert_eq!(rules.excluded_baseline.not_at_risk, 5);
        assert_eq!(rules.difference.p(), Some(1.0));

        let cells = experiment.estimate(&outcomes, &[]);
        let mut cells = cells.iter();
        let cell = cells.find(|cell| cell.measure == "deadlock" && cell.arm == "emotions");
        let cell = cell.unwrap();
        let Estimated::Time { survival, share } = &cell.estimate else {
            panic!("{cell:?}");
        };
        assert_eq!((survival.n, survival.events, share.value), (3, 3, 1.0));
        assert_eq!(survival.median_s, Some(0.0));
        assert_eq!(cell.excluded.to_string(), "5 not at risk");
    }

    #[test]
    fn numbers_that_runs_do_not_have_are_counted_by_arm() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let value = |value| Measured::Value { value };
        let missing = Measured::Missing {
            reason: "none".to_owned(),
        };
        let open = Measured::Unfinished { at_least: 3.0 };
        let arm = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0].map(value);
        let mut baseline = [0.0; 8].map(value);
        baseline[0] = Measured::NoPair;
        baseline[1] = open;
        baseline[2] = missing;
        let outcomes = measured(&experiment, &arm, &baseline);

        let contrasts = experiment.contrast(&outcomes, &[]);
        let rules = find(&contrasts, "served", "rules");
        assert_eq!((rules.n, rules.excluded.is_none()), (5, true));
        let excluded = rules.excluded_baseline.to_string();
        assert_eq!(excluded, "1 no pair, 1 unfinished, 1 missing");
        assert_eq!(rules.difference.p(), Some(2.0 / 32.0));
        let ArmDifference::Number { mean, .. } = &rules.difference else {
            panic!("{rules:?}");
        };
        assert_eq!(mean.value, 6.0);

        // One failed: it is beside the numbers of its arm, and an arm all of whose runs failed has a row.
        let failure = |unit: usize, arm: &str| FailedUnit {
            unit,
            condition: outcomes[0].condition.clone(),
            arm: arm.to_owned(),
            seed: 9,
            reason: "it fell".to_owned(),
        };
        let failures = [failure(1_000, "rules"), failure(1_001, "timer")];
        let played: Vec<UnitOutcome> = outcomes
            .iter()
            .filter(|one| one.arm != "timer")
            .cloned()
            .collect();
        let contrasts = experiment.contrast(&played, &failures);
        let rules = find(&contrasts, "served", "rules");
        assert_eq!(
            (rules.n, rules.excluded.to_string().as_str()),
            (5, "1 failed")
        );
        let timer = find(&contrasts, "served", "timer");
        assert_eq!(
            (timer.n, timer.excluded.to_string().as_str()),
            (0, "1 failed")
        );
        let cells = experiment.estimate(&played, &failures);
        let mut cells = cells.iter();
        let cell = cells
            .find(|cell| cell.measure == "served" && cell.arm == "timer")
            .unwrap();
        assert_eq!((cell.estimate.n(), cell.excluded.failed), (0, 1));

        // Nobody has it.
        let none = measured(&experiment, &arm, &[const { Measured::NoPair }; 8]);
        let contrasts = experiment.contrast(&none, &[]);
        let rules = find(&contrasts, "served", "rules");
        assert_eq!((&rules.difference, rules.n), (&ArmDifference::NoPair, 0));
        assert_eq!((rules.p_holm, rules.comparisons), (None, 0));
        let cells = experiment.estimate(&none, &[]);
        let cell = cells.iter().find(|cell| cell.arm == "emotions").unwrap();
        let json = serde_json::to_value(cell).unwrap();
        assert_eq!(json["mean"]["value"], serde_json::Value::Null);
        assert_eq!(json["mean"]["interval"], "too_few");
        assert_eq!(json["excluded"]["no_pair"], 8);
    }

    #[test]
    fn the_least_p_value_depends_on_pairs_and_comparisons() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let better = BTreeMap::from([("rules", 2.0)]);
        let contrasts = experiment.contrast(&outcomes(&experiment, &better), &[]);
        let served: Vec<&Contrast> = contrasts
            .iter()
            .filter(|one| one.measure == "served")
            .collect();
        assert_eq!(least_p_holm(&served), 8.0 * 2.0 / 256.0);
        assert_eq!(served[0].p_holm, Some(least_p_holm(&served)));
        assert_eq!(least_p_holm(&[]), 1.0);
    }

    #[test]
    fn no_difference_of_times_is_longer_than_the_times() {
        let at = |time_s| Measured::Reached { time_s };
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let arm = [80.0, 80.0, 80.0, 0.0, 0.0, 0.0, 0.0, 0.0].map(at);
        let outcomes = measured(&experiment, &arm[..], &[0.0; 8].map(at));
        let outcomes: Vec<UnitOutcome> = outcomes.into_iter().filter(|run| run.seed < 5).collect();
        let contrasts = experiment.contrast(&outcomes, &[]);
        let ArmDifference::Time {
            restricted_mean_s,
            until_s,
            ..
        } = &find(&contrasts, "deadlock", "rules").difference
        else {
            panic!("{contrasts:?}");
        };
        assert_eq!((restricted_mean_s.value, *until_s), (60.0, 80.0));
        assert_eq!(restricted_mean_s.bounds().unwrap().1, 80.0);
    }

    #[test]
    fn numbers_without_a_finite_mean_have_no_test() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let value = |value| Measured::Value { value };
        let outcomes = measured(&experiment, &[1.7e308; 8].map(value), &[0.0; 8].map(value));
        let contrasts = experiment.contrast(&outcomes, &[]);
        let rules = find(&contrasts, "served", "rules");
        assert_eq!(rules.difference, ArmDifference::NotFinite);
        assert_eq!((rules.p_holm, rules.comparisons), (None, 0));
    }

    #[test]
    fn the_json_of_a_contrast_is_flat() {
        let experiment = Experiment::find(Path::new("deadlock")).unwrap();
        let better = BTreeMap::from([("rules", 2.0)]);
        let contrasts = experiment.contrast(&outcomes(&experiment, &better), &[]);
        let json = serde_json::to_value(find(&contrasts, "served", "rules")).unwrap();
        assert_eq!(json["kind"], "number");
        assert_eq!(json["baseline"], "emotions");
        assert_eq!(json["mean"]["value"], 9.0);
        assert_eq!(json["mean"]["interval"], "ends");
        assert!(json["mean"]["low"].is_f64());
        assert_eq!(json["test"]["is_exact"], true);
        let json = serde_json::to_value(find(&contrasts, "served", "neither")).unwrap();
        assert_eq!(json["mean"]["interval"], "all_equal");
    }
}
