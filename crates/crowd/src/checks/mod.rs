//! Checks of a model of walking: the cases of RiMEA and experiments with people, played many times, and how far the model is from
//! what was published.
//!
//! As IMO MSC.1/Circ.1238 asks, cases are played 50 times with at least 10 populations, and of times the 95 % value counts. Other
//! rows are judged by their mean or by all runs. Each row has a bootstrap interval of its mean (2,000 resamples of populations, 95 %).

mod bootstrap;
mod cases;
mod published;
mod rows;
mod scene;

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::collision_free::CollisionFree;
use crate::model::WalkingModel;
use crate::social_force::SocialForce;

use bootstrap::mean_interval;
use rows::{CrowdCase, RowSpec, cases};
use scene::RunChance;

pub use published::{DENSITIES_PER_M2, GATE_FLOW_PER_S, SINGLE_FILE, SpeedData, weidmann_mps};
pub use rows::{Judged, Requirement};

/// A model that comes with this crate, with its default parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownModel {
    /// [`CollisionFree`], calibrated.
    CollisionFree,
    /// [`SocialForce`], as published.
    SocialForce,
}

impl KnownModel {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::CollisionFree, Self::SocialForce];

    /// The measured speeds to which its parameters are calibrated, if they are.
    #[must_use]
    pub fn calibrated_to(self) -> Option<SpeedData> {
        match self {
            Self::CollisionFree => Some(SpeedData::Weidmann),
            Self::SocialForce => None,
        }
    }

    /// Its name, as people type it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CollisionFree => "collision-free",
            Self::SocialForce => "social-force",
        }
    }

    /// Plays all cases with it, as [`check_with`].
    pub fn check(
        self,
        options: &CheckOptions,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Vec<CheckedRow> {
        match self {
            Self::CollisionFree => check_with(&CollisionFree::default(), options, progress),
            Self::SocialForce => check_with(&SocialForce::default(), options, progress),
        }
    }
}

/// How a model is checked.
#[derive(Clone, Debug)]
pub struct CheckOptions {
    /// Runs of each case.
    pub runs: usize,
    /// Number of populations, which take turns.
    pub populations: usize,
    /// Number of runs at the same time. No result depends on it.
    pub threads: usize,
    /// What chance is drawn from. Parameters of [`CollisionFree`] were chosen with seed 1.
    pub seed: u64,
    /// The speeds that the model has to keep to.
    pub against: SpeedData,
    /// Only cases with this text in their titles; all if it is empty.
    pub only: String,
}

impl Default for CheckOptions {
    /// As IMO MSC.1/Circ.1238 asks. \[D\]
    fn default() -> Self {
        Self {
            runs: 50,
            populations: 10,
            threads: 1,
            seed: 2,
            against: SpeedData::Weidmann,
            only: String::new(),
        }
    }
}

/// One number of a case, over all its runs.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedRow {
    /// The case.
    pub case: &'static str,
    /// What was measured, with its unit.
    pub measure: String,
    /// What was published, in the same unit.
    pub published: Option<f64>,
    /// Measured speeds at the density of the row, m/s, in the order of [`SpeedData::ALL`].
    pub measured_mps: Option<[f64; 3]>,
    /// Mean over runs.
    pub mean: f64,
    /// Bootstrap interval of the mean, 95 %: populations are resampled.
    pub interval: (f64, f64),
    /// The 95 % value: that of 95 % of the runs is at most as large.
    pub high: f64,
    /// Number of runs.
    pub runs: usize,
    /// What is asked of it.
    pub requirement: Option<Requirement>,
    /// Whether it is as asked; true where nothing is.
    pub is_passed: bool,
}

/// Plays all cases with a model.
pub fn check<M: WalkingModel + Clone>(model: &M, options: &CheckOptions) -> Vec<CheckedRow> {
    check_with(model, options, &|_, _| {})
}

/// As [`check`], and calls `progress` with the numbers of runs that are over and of all runs.
pub fn check_with<M: WalkingModel + Clone>(
    model: &M,
    options: &CheckOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Vec<CheckedRow> {
    let mut cases = cases::<M>(options.against);
    cases.retain(|case| case.title.contains(&options.only));
    let mut jobs = Vec::new();
    for case in 0..cases.len() {
        for run in 0..options.runs.max(1) {
            jobs.push((case, run));
        }
    }
    let values = play_all(model, options, &cases, &jobs, progress);

    let mut rows = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        let runs: Vec<&Vec<f64>> = jobs
            .iter()
            .zip(&values)
            .filter(|((of, _), _)| *of == index)
            .map(|(_, values)| values)
            .collect();
        for (column, spec) in case.rows.iter().enumerate() {
            let values: Vec<f64> = runs.iter().map(|values| values[column]).collect();
            rows.push(row(case.title, spec, &values, options));
        }
    }
    rows
}

/// Plays jobs by several threads; the values of each are at its index.
fn play_all<M: WalkingModel + Clone>(
    model: &M,
    options: &CheckOptions,
    cases: &[CrowdCase<M>],
    jobs: &[(usize, usize)],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Vec<Vec<f64>> {
    let next = AtomicUsize::new(0);
    let over = AtomicUsize::new(0);
    let work = || {
        let mut played = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some((case, run)) = jobs.get(index).copied() else {
                return played;
            };
            let mut chance = RunChance::new(options.seed, run, options.populations.max(1));
            played.push((index, (cases[case].play)(model, &mut chance)));
            progress(over.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
        }
    };
    let mut played = std::thread::scope(|scope| {
        let mut others = Vec::new();
        for _ in 1..options.threads.clamp(1, jobs.len().max(1)) {
            others.push(scope.spawn(work));
        }
        let mut played = work();
        for other in others {
            match other.join() {
                Ok(more) => played.extend(more),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        played
    });

    played.sort_unstable_by_key(|(index, _)| *index);
    played.into_iter().map(|(_, values)| values).collect()
}

fn row(case: &'static str, spec: &RowSpec, values: &[f64], options: &CheckOptions) -> CheckedRow {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len();
    let mean = sorted.iter().sum::<f64>() / count as f64;
    // The smallest value that at least 95 % of the runs do not exceed, and its counterpart.
    let rank = (count * 95).div_ceil(100).max(1) - 1;
    let high = sorted[rank];
    let low = sorted[count - 1 - rank];

    let is_passed = spec
        .requirement
        .is_none_or(|required| match required.judged {
            Judged::Mean => required.holds(mean),
            Judged::Most => required.holds(low) && required.holds(high),
            Judged::All => values.iter().all(|value| required.holds(*value)),
        });
    CheckedRow {
        case,
        measure: spec.measure.clone(),
        published: spec.published,
        measured_mps: spec.measured_mps,
        mean,
        interval: mean_interval(values, options.populations.max(1)),
        high,
        runs: count,
        requirement: spec.requirement,
        is_passed,
    }
}
