//! Hunts: plans of faults are drawn from a seed and played, until an expectation fails; the plan is then shrunk to a minimal
//! scenario file.
//!
//! Most plans go on from a state that an earlier one was the first to reach (`corpus`): a run in this process is copied there, any
//! other one is played up to there again.
//!
//! The result depends on the scenario, the seed and the number of plans only: plans are drawn in batches of a fixed size, each
//! from a stream of its own, and are guided by what the batches before have reached.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use config::FileError;
use experiments::parallel;
use lab::LabError;
use protocol::Tick;
use protocol::random::{Stream, stream, unit};
use protocol::time::time_s;
use serde::Serialize;

use super::case::FaultCase;
use super::cause::FailureSignature;
use super::corpus::Corpus;
use super::coverage::Coverage;
use super::draw::Ground;
use super::fault::{FaultClass, PlannedFault};
use super::file::{self, Heading};
use super::shrink::{Bounds, ScenarioParts, shrink};
use super::trial::{PlayedPlan, RUNS, Subject, Trial, TrialPlan, TrialResult};

/// Number of plans that are drawn at a time. What they reach guides the plans after them.
const BATCH: u64 = 16;
/// Share of the plans that go on from a state, once one is reached.
const GOING_ON: f64 = 2.0 / 3.0;
/// Most findings of a hunt. Further plans that fail are only counted.
const MAX_FINDINGS: usize = 20;

/// How long a hunt lasts.
#[derive(Debug, Clone, Copy)]
pub enum HuntBudget {
    /// This number of plans.
    Plans(u64),
    /// New plans are drawn for this time.
    Time(Duration),
}

/// Options of a hunt.
#[derive(Debug)]
pub struct HuntOptions<'a> {
    /// Seed of the plans.
    pub seed: u64,
    /// How long it lasts.
    pub budget: HuntBudget,
    /// Number of runs at the same time; the result does not depend on it.
    pub jobs: usize,
    /// Kinds of faults that are drawn.
    pub kinds: Vec<FaultClass>,
    /// Longest time of a fault that does not last for the whole run, simulated seconds.
    pub longest_s: f64,
    /// Expectations that are checked; empty for all.
    pub expect: BTreeSet<String>,
    /// Most runs to shrink a finding.
    pub shrink_runs: u64,
    /// Folder of the files of findings.
    pub out: PathBuf,
    /// Set to end the hunt with what it has found.
    pub stop: &'a AtomicBool,
}

/// What a hunt reports while it goes on.
#[derive(Debug)]
pub enum HuntProgress<'a> {
    /// A batch of plans was played: the number of plans so far, and of features.
    Played(u64, usize),
    /// An expectation has failed; its file is written, and its plan will be shrunk.
    Found(&'a Finding),
    /// The plan is shrunk.
    Shrunk(&'a Finding),
}

/// A failing expectation, and the plan under which it fails.
#[derive(Debug, Clone, Serialize)]
pub struct Finding {
    /// Name of the expectation.
    pub expectation: String,
    /// Why it fails in the run of the case.
    pub because: String,
    /// Simulated time at which that is certain, seconds.
    pub time_s: f64,
    /// Number of the plan, from 1.
    pub plan: u64,
    /// The faults of the plan as it was drawn.
    pub drawn: Vec<PlannedFault>,
    /// The case, shrunk as far as it is.
    pub case: FaultCase,
    /// What its faults do.
    pub cause: FailureSignature,
    /// Number of plans in whose runs the expectation fails and this cause occurs, too.
    pub plans: u64,
    /// The faults of the case in words.
    pub faults: Vec<String>,
    /// Number of runs that shrinking took.
    pub shrink_runs: u64,
    /// Whether nothing can be left out of the case.
    pub is_minimal: bool,
    /// Its scenario file.
    pub file: PathBuf,
}

impl Finding {
    /// The name under which its run is recorded: that of its file.
    #[must_use]
    pub fn run(&self) -> String {
        let stem = self.file.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// Whether `cars why` can be asked about it: whether a run goes to its end is no expectation of its scenario.
    #[must_use]
    pub fn can_be_explained(&self) -> bool {
        self.expectation != RUNS
    }
}

/// The result of a hunt.
#[derive(Debug, Serialize)]
pub struct HuntReport {
    /// The scenario.
    pub scenario: PathBuf,
    /// Seed of the plans.
    pub seed: u64,
    /// Number of plans that were played.
    pub plans: u64,
    /// Number of those that went on from a state that another one had reached.
    pub gone_on: u64,
    /// Number of plans that could not be set up, because bodies did not fit into the hall.
    pub not_set_up: u64,
    /// Number of ticks of all plans, without those of shrinking.
    pub ticks: Tick,
    /// Expectations that were checked.
    pub expectations: BTreeSet<String>,
    /// Those of them that were asked in no run: what they are expected after did not happen.
    pub never_asked: BTreeSet<String>,
    /// What some run should reach, with the number of plans in whose runs it was reached.
    pub goals: BTreeMap<String, u64>,
    /// What of it the run without faults reaches.
    pub reached_without_faults: BTreeSet<String>,
    /// What was found, one for each cause for which an expectation fails.
    pub findings: Vec<Finding>,
    /// Number of plans that failed and were not shrunk, because there were too many findings already.
    pub not_shrunk: u64,
    /// What happened in the runs.
    pub coverage: Coverage,
}

impl HuntReport {
    /// What some run should reach, and none has.
    pub fn never_reached(&self) -> impl Iterator<Item = &str> {
        let goals = self
            .goals
            .iter()
            .filter(|(goal, plans)| **plans == 0 && !self.reached_without_faults.contains(*goal));
        goals.map(|(name, _)| name.as_str())
    }
}

/// A hunt in progress.
struct Hunt<'a> {
    subject: &'a Subject,
    options: &'a HuntOptions<'a>,
    ground: Ground,
    /// Expectations that are checked.
    wanted: BTreeSet<String>,
    corpus: Corpus,
    report: HuntReport,
}

/// Hunts in a scenario.
///
/// # Errors
/// If the scenario fails without faults, nothing can be drawn for it, or a file cannot be written.
pub fn hunt(
    subject: &Subject,
    options: &HuntOptions<'_>,
    progress: &mut dyn FnMut(HuntProgress<'_>),
) -> Result<HuntReport, LabError> {
    let mut corpus = Corpus::default();
    let without = TrialPlan::default();
    let mut baseline = subject.play_plan(&without, &BTreeSet::new(), &|feature| {
        corpus.is_new(feature)
    })?;
    corpus.add(&without, &mut baseline);
    let baseline = baseline.result;
    let mut wanted = wanted(subject, &baseline, &options.expect)?;
    let mut goals = BTreeMap::new();
    let mut reached_without_faults = BTreeSet::new();
    for expectation in &subject.scenario.expectations {
        if expectation.is_goal() && wanted.remove(&expectation.name) {
            goals.insert(expectation.name.clone(), 0);
            if baseline.has_reached(&expectation.name) {
                reached_without_faults.insert(expectation.name.clone());
            }
        }
    }
    let ground = Ground::new(
        &subject.scenario,
        &baseline,
        &options.kinds,
        options.longest_s,
    );
    if ground.kinds().is_empty() {
        return Err(LabError::refused(format!(
            "{}: none of these kinds of faults can occur in this scenario",
            subject.file.display()
        ))
        .with_help("allow further kinds by --kinds"));
    }
    if options.out.is_symlink() {
        let place = options.out.display();
        return Err(LabError::refused(format!(
            "{place} is a link, and nothing is written through one"
        ))
        .with_help("name the folder to which it leads"));
    }
    std::fs::create_dir_all(&options.out).map_err(|error| {
        let place = options.out.display();
        FileError::new(format!("cannot make the folder {place}: {error}"))
    })?;

    let mut hunt = Hunt {
        subject,
        options,
        ground,
        report: HuntReport {
            scenario: subject.file.clone(),
            seed: options.seed,
            plans: 0,
            gone_on: 0,
            not_set_up: 0,
            ticks: 0,
            expectations: wanted.clone(),
            never_asked: wanted.clone(),
            goals,
            reached_without_faults,
            findings: Vec::new(),
            not_shrunk: 0,
            coverage: Coverage::default(),
        },
        wanted,
        corpus,
    };
    hunt.go(progress)?;
    Ok(hunt.report)
}

/// The expectations that a hunt checks. None of them fails without faults.
fn wanted(
    subject: &Subject,
    baseline: &TrialResult,
    expect: &BTreeSet<String>,
) -> Result<BTreeSet<String>, LabError> {
    let file = subject.file.display();
    let names: Vec<&str> = baseline.expectations.iter().map(String::as_str).collect();
    if let Some(unknown) = expect.difference(&baseline.expectations).next() {
        return Err(
            LabError::refused(format!("{file} has no expectation \"{unknown}\""))
                .with_help(format!("there are: {}", names.join("; "))),
        );
    }

    let wanted = if expect.is_empty() {
        baseline.expectations.clone()
    } else {
        expect.clone()
    };
    for (name, failure) in &baseline.failed {
        if wanted.contains(name) {
            let others: Vec<String> = wanted
                .iter()
                .filter(|other| !baseline.failed.contains_key(*other))
                .map(|other| format!("--expect {other:?}"))
                .collect();
            return Err(LabError::refused(format!(
                "{file} fails without any fault: \"{name}\", {}",
                failure.because
            ))
            .with_help(format!(
                "a hunt looks for faults under which a run fails that passes without them. Hunt for the others: {}",
                others.join(" ")
            )));
        }
    }
    Ok(wanted)
}

impl Hunt<'_> {
    fn go(&mut self, progress: &mut dyn FnMut(HuntProgress<'_>)) -> Result<(), LabError> {
        let begun = Instant::now();
        while !self.is_stopped() {
            let first = self.report.plans;
            let count = match self.options.budget {
                HuntBudget::Plans(plans) => (plans - first).min(BATCH),
                HuntBudget::Time(time) if begun.elapsed() < time => BATCH,
                HuntBudget::Time(_) => 0,
            };
            if count == 0 {
                return Ok(());
            }

            let plans = self.draw(first, count);
            let subject = self.subject;
            let wanted = &self.wanted;
            let corpus = &self.corpus;
            let played = parallel::all(&plans, self.options.jobs, self.options.stop, |plan| {
                subject.play_plan(plan, wanted, &|feature| corpus.is_new(feature))
            });
            let failures = self.note(first, plans, played);
            let features = self.report.coverage.features().count();
            progress(HuntProgress::Played(self.report.plans, features));
            for (plan, case, played) in failures {
                self.note_failures(plan, &case, &played, progress)?;
            }
        }
        Ok(())
    }

    fn is_stopped(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed)
    }

    /// The plans after the first ones.
    fn draw(&mut self, first: u64, count: u64) -> Vec<TrialPlan> {
        let mut plans = Vec::new();
        for plan in first + 1..=first + count {
            let mut chance = stream(self.options.seed, &format!("hunt/{plan}"));
            let going_on = unit(&mut chance) < GOING_ON;
            plans.push(
                going_on
                    .then(|| self.go_on(&mut chance))
                    .flatten()
                    .unwrap_or_else(|| TrialPlan {
                        case: FaultCase::of(self.ground.draw(&mut chance)),
                        ..TrialPlan::default()
                    }),
            );
        }
        plans
    }

    /// A plan that goes on from a state; `None` if there is none.
    fn go_on(&mut self, chance: &mut Stream) -> Option<TrialPlan> {
        let state = self.corpus.choose()?;
        if !self.ground.can_go_on(&state.faults) {
            return None;
        }
        let faults = self.ground.go_on(&state.faults, &state.onset, chance);
        Some(TrialPlan {
            case: FaultCase::of(faults),
            after: state.onset.after,
            saved: state.saved.clone(),
        })
    }

    /// Adds the runs of a batch to the report; returns those in which an expectation failed, with the numbers of the plans.
    fn note(
        &mut self,
        first: u64,
        plans: Vec<TrialPlan>,
        results: Vec<Option<Result<PlayedPlan, LabError>>>,
    ) -> Vec<(u64, FaultCase, TrialResult)> {
        let mut failures = Vec::new();
        for (index, (plan, result)) in plans.into_iter().zip(results).enumerate() {
            let Some(result) = result else {
                continue;
            };
            self.report.plans += 1;
            self.report.gone_on += u64::from(plan.after > 0);
            let Ok(mut played) = result else {
                self.report.not_set_up += 1;
                continue;
            };

            self.corpus.add(&plan, &mut played);
            let played = played.result;
            self.report.ticks += played.ticks - plan.after;
            let not_asked = &played.not_asked;
            self.report
                .never_asked
                .retain(|name| not_asked.contains(name));
            for (goal, plans) in &mut self.report.goals {
                *plans += u64::from(played.has_reached(goal));
            }
            self.report.coverage.add(played.features.keys());
            if !played.failed.is_empty() {
                failures.push((first + index as u64 + 1, plan.case, played));
            }
        }
        failures
    }

    /// Counts, or writes and shrinks, what failed in the run of a plan.
    fn note_failures(
        &mut self,
        plan: u64,
        case: &FaultCase,
        played: &TrialResult,
        progress: &mut dyn FnMut(HuntProgress<'_>),
    ) -> Result<(), LabError> {
        let signs = FailureSignature::of_plan(case, played);
        for name in played.failed.keys() {
            if !self.wanted.contains(name) {
                continue;
            }

            if let Some(known) = self.known(name, &signs) {
                known.plans += 1;
            } else if self.report.findings.len() >= MAX_FINDINGS {
                self.report.not_shrunk += 1;
            } else {
                self.find(name, plan, case, played, progress)?;
            }
        }

        Ok(())
    }

    /// The finding whose cause is among these signs.
    fn known(&mut self, name: &str, signs: &FailureSignature) -> Option<&mut Finding> {
        let mut findings = self.report.findings.iter_mut();
        findings.find(|known| known.expectation == name && known.cause.is_part_of(signs))
    }

    /// Writes what failed in the run of a plan, shrinks it, and writes it again.
    fn find(
        &mut self,
        name: &str,
        plan: u64,
        case: &FaultCase,
        played: &TrialResult,
        progress: &mut dyn FnMut(HuntProgress<'_>),
    ) -> Result<(), LabError> {
        let mut drawn = self.finding(name, plan, case, played);
        drawn.file = file::reserve(&drawn.file)?;
        self.write(&drawn, played, "It is not shrunk.")?;
        progress(HuntProgress::Found(&drawn));
        let world = ScenarioParts {
            roster: self.subject.scenario.roster(),
            guests: self.subject.scenario.guests.count,
        };
        let bounds = Bounds {
            runs: self.options.shrink_runs,
            jobs: self.options.jobs,
            stop: self.options.stop,
        };
        let case = case.clone();
        let played = played.clone();
        let shrunk = shrink(self.subject, name, case, played, &world, bounds);

        let mut finding = self.finding(name, plan, &shrunk.case, &shrunk.played);
        if let Some(known) = self.known(name, &finding.cause) {
            known.plans += 1;
            return std::fs::remove_file(&drawn.file).map_err(LabError::failed);
        }
        let named = std::mem::replace(&mut finding.file, drawn.file);
        finding.drawn = drawn.drawn;
        finding.shrink_runs = shrunk.runs;
        finding.is_minimal = shrunk.is_minimal;
        let runs = shrunk.runs;
        let sentence = if shrunk.is_minimal {
            format!("It was shrunk by {runs} runs: nothing can be left out.")
        } else {
            format!("It was shrunk by {runs} runs; more may make it smaller.")
        };
        self.write(&finding, &shrunk.played, &sentence)?;
        finding.file = file::keep_one(finding.file, &named)?;
        self.check_file(&finding)?;
        progress(HuntProgress::Shrunk(&finding));
        self.report.findings.push(finding);
        Ok(())
    }

    fn finding(&self, name: &str, plan: u64, case: &FaultCase, played: &TrialResult) -> Finding {
        let tick_s = self.subject.scenario.tick_s;
        let failure = &played.failed[name];
        let faults = case.faults.iter().map(|fault| fault.in_words(tick_s));
        let file = file::name(&self.subject.file, name, self.options.seed, plan);

        Finding {
            expectation: name.to_owned(),
            because: failure.because.clone(),
            time_s: time_s(failure.tick, tick_s),
            plan,
            drawn: case.faults.clone(),
            case: case.clone(),
            cause: FailureSignature::of_faults(case, played),
            plans: 1,
            faults: faults.collect(),
            shrink_runs: 0,
            is_minimal: false,
            file: self.options.out.join(file),
        }
    }

    fn write(&self, finding: &Finding, played: &TrialResult, shrunk: &str) -> Result<(), LabError> {
        let heading = Heading {
            expectation: &finding.expectation,
            seed: self.options.seed,
            plan: finding.plan,
            shrunk,
        };
        file::write(&finding.file, self.subject, &finding.case, played, heading)
    }

    /// Plays the file of a finding as written.
    fn check_file(&self, finding: &Finding) -> Result<(), LabError> {
        let name = &finding.expectation;
        let written = self.subject.of_file(&finding.file)?;
        let played = written.play(&FaultCase::default(), &BTreeSet::from([name.clone()]))?;
        if played.failed.contains_key(name) {
            return Ok(());
        }
        Err(LabError::failed(format!(
            "\"{name}\" fails under plan {}, and does not fail in the file {}: this is a defect of the hunt",
            finding.plan,
            finding.file.display()
        )))
    }
}
