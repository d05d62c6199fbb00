//! Plays the forks of a run on all cores, keeps their outcomes in a file, and answers a question with them.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use environment::medium::{ForcedVerdict, NetworkVerdict};
use experiments::{ProgramVersion, parallel};
use export::draft;
use lab::LabError;
use lab::branch::{Branch, Trunk};
use lab::run::RobotMaker;
use protocol::{Event, RunName, Tick};
use record::{EpochFiles, RunFolder};
use scenario::{ChanceKind, Scenario};
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

use super::answer::{FailedForks, WhyAnswer};
use super::budget::WhyBudget;
use super::candidates;
use super::plan::{Counterfactual, ForkOutcome, ForkPlan};
use super::question::AskedRun;
use super::search::{Forks, SearchedRun, search};

/// Most copies of the run at ticks of it that are kept.
const MAX_RUNGS: usize = 64;
/// Most characters of a file's name that come from the question.
const MAX_NAME: usize = 60;
/// Most characters that are kept of why a robot failed.
const MAX_REASON: usize = 300;

/// How a question is answered.
pub struct WhyOptions<'a> {
    /// What is asked: the name of an expectation or of a measure, a condition, the path of a number of the summary; `None` for the
    /// expectation that failed first.
    pub what: Option<String>,
    /// How much is spent; `None` for as much as the answer needs.
    pub budget: Option<WhyBudget>,
    /// Number of forks at the same time; the answer does not depend on it.
    pub jobs: usize,
    /// Makes the robots.
    pub make: RobotMaker,
    /// Ends it; what was played is kept.
    pub stop: &'a AtomicBool,
}

/// How far an answer is.
#[derive(Debug, Clone, Copy)]
pub struct WhyProgress {
    /// Forks that are known, of those that were asked for so far.
    pub forks: u64,
    /// The tick at which the present ones begin.
    pub tick: Tick,
}

/// Answers a question about a recorded run, and writes the answer into the folder of the run. What was played before for the same
/// question is not played again.
///
/// # Errors
/// If the run has nothing of that kind, it cannot be executed again or branch in this process, a file cannot be written, or the
/// caller ends it.
pub fn why(
    folder: &RunFolder,
    run: &RunName,
    files: &EpochFiles,
    options: &WhyOptions<'_>,
    progress: &mut (dyn FnMut(WhyProgress) + Send),
) -> Result<(WhyAnswer, PathBuf), LabError> {
    let begun = Instant::now();
    let recorded = Scenario::load(&files.scenario, &config::Changes::default())?;
    let asked = AskedRun::read(options.what.as_deref(), &recorded, files)?;
    let make = options.make.clone();
    let mut trunk = Trunk::open(files, asked.scenario.clone(), make, asked.sums_up())?;
    let mut rungs = BTreeMap::from([(0, trunk.snapshot()?)]);

    // To its end, as it is, or, if it was stopped, as it would have gone on. Tick by tick, so that the caller can end it.
    while trunk.tick() < trunk.last() {
        if options.stop.load(Ordering::Relaxed) {
            return Err(LabError::Interrupted);
        }
        trunk.go_to(trunk.tick() + 1)?;
    }
    // Before the run becomes a branch, which cannot be executed from its record any more.
    let whole = trunk.snapshot()?;
    let digest = trunk.simulation().digest();
    let is_share = asked.question.is_share();
    let outcome = asked.outcome(&mut trunk.into_branch()?);
    let outcome = outcome.map_err(|error| match error {
        LabError::Robot(error) => LabError::refused(format!(
            "the run has no outcome, because a robot ends it: {error}"
        ))
        .with_help("mend the robot, and ask about a run that goes to its end"),
        error => error,
    })?;
    rungs.insert(whole.last(), whole);

    // The file is that of the question; the key in it tells whether what it has holds for this run and this program.
    let name = file_name(&asked.question);
    let key = key(&asked, &digest)?;
    let place = folder.make_why()?;
    let (outcomes, kept) = OutcomeFile::open(&place, &name, &key)?;
    let mut sampler = Sampler {
        asked: &asked,
        options,
        rungs,
        outcomes,
        kept,
        budget: options.budget.map(|budget| (budget, begun)),
        used: 0,
        failed: None,
        progress,
    };
    let trunk = sampler.rungs[&0].snapshot()?;
    let searched = SearchedRun {
        last: trunk.last(),
        recorded: outcome,
        is_share,
        kinds: candidates::kinds(&asked.scenario),
        planned: candidates::planned(&trunk, &asked.scenario),
        candidates: &|tick| candidates::candidates(&trunk, tick),
        events: &|tick| candidates::events(&trunk, tick),
    };
    let found = search(&searched, &mut sampler)?;

    let mut answer = WhyAnswer {
        version: ProgramVersion::this().to_string(),
        run: run.clone(),
        digest,
        question: asked.question.clone(),
        is_share,
        recorded: outcome,
        tick_s: asked.scenario.tick_s,
        last: trunk.last(),
        curve: found.curve,
        jumps: found.jumps,
        kinds: found.kinds,
        planned: found.planned,
        least_jump: found.least_jump,
        forks: sampler.used,
        failed: sampler.failed,
        is_complete: found.is_complete,
        sentence: String::new(),
    };
    answer.sentence = answer.in_words();
    let path = place.join(format!("{name}.json"));
    let json = serde_json::to_string_pretty(&answer).map_err(LabError::failed)?;
    draft::write(&path, format!("{json}\n"))?;
    Ok((answer, path))
}

fn unwritable(path: &Path, error: &std::io::Error) -> LabError {
    LabError::File(draft::unwritable(path, error))
}

/// The name of a question's files: its words.
fn file_name(question: &super::question::Question) -> String {
    let words = question.words();
    let mut name = String::new();
    for character in words.chars() {
        if character.is_ascii_alphanumeric() {
            name.push(character.to_ascii_lowercase());
        } else if !name.is_empty() && !name.ends_with('-') {
            name.push('-');
        }
    }
    // All of it is ASCII, so it can be cut anywhere.
    name.truncate(MAX_NAME);
    let name = name.trim_end_matches('-');

    // Different questions may have the same letters.
    let digest = xxh3_128(words.as_bytes()) as u32;
    format!("{name}-{digest:08x}")
}

/// What outcomes of forks depend on.
fn key(asked: &AskedRun, digest: &str) -> Result<String, LabError> {
    let question = serde_json::to_string(&asked.question).map_err(LabError::failed)?;
    let program = ProgramVersion::this();
    let scenario = asked.scenario.to_toml()?;
    let text = format!("{program}\n{question}\n{digest}\n{scenario}");
    Ok(format!("{:032x}", xxh3_128(text.as_bytes())))
}

/// Outcomes of forks, by their plans and numbers.
type Outcomes = BTreeMap<ForkPlan, BTreeMap<u64, ForkOutcome>>;

/// The file of outcomes: a line with the key of the question, and one for each fork.
struct OutcomeFile {
    path: PathBuf,
    file: File,
}

#[derive(Serialize, Deserialize)]
struct PlayedFork {
    #[serde(flatten)]
    plan: ForkPlan,
    number: u64,
    outcome: Option<f64>,
    /// Why a robot failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    failed: Option<String>,
}

impl OutcomeFile {
    /// Opens the file of a question, and reads what was played for it before. A file of another version is begun anew.
    fn open(folder: &Path, name: &str, key: &str) -> Result<(Outcomes, Self), LabError> {
        let path = folder.join(format!("{name}.jsonl"));
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let head = format!("{{\"key\":\"{key}\"}}\n");

        let mut outcomes = Outcomes::new();
        let mut whole = head.clone();
        if let Some(lines) = text.strip_prefix(&head) {
            // A process that was killed leaves a line without an end.
            for line in lines
                .split_inclusive('\n')
                .filter(|line| line.ends_with('\n'))
            {
                let Ok(kept) = serde_json::from_str::<PlayedFork>(line) else {
                    break;
                };
                whole += line;
                let of_plan = outcomes.entry(kept.plan).or_default();
                let outcome = match kept.failed {
                    Some(because) => ForkOutcome::Failed(because.into()),
                    None => kept.outcome.into(),
                };
                of_plan.insert(kept.number, outcome);
            }
        }
        // Cuts off a line without an end: the next one would be appended to it, and neither could be read.
        if whole != text {
            std::fs::write(&path, &whole).map_err(|error| unwritable(&path, &error))?;
        }
        let file = OpenOptions::new().append(true).open(&path);
        let file = file.map_err(|error| unwritable(&path, &error))?;
        Ok((outcomes, Self { path, file }))
    }

    fn add(&mut self, plan: &ForkPlan, number: u64, outcome: &ForkOutcome) -> Result<(), LabError> {
        let failed = match outcome {
            ForkOutcome::Failed(because) => Some(because.to_string()),
            ForkOutcome::Number(_) | ForkOutcome::Nothing => None,
        };

        let kept = PlayedFork {
            plan: plan.clone(),
            number,
            outcome: outcome.number(),
            failed,
        };
        let line = serde_json::to_string(&kept).map_err(LabError::failed)?;
        // In one piece: a process that is killed leaves at most the last line without its end.
        let written = self.file.write_all(format!("{line}\n").as_bytes());
        written.map_err(|error| unwritable(&self.path, &error))
    }
}

/// Plays the forks of a run.
struct Sampler<'a> {
    asked: &'a AskedRun,
    options: &'a WhyOptions<'a>,
    /// Copies of the run after some ticks, or, if it cannot be copied, after tick 0.
    rungs: BTreeMap<Tick, Trunk>,
    outcomes: Outcomes,
    kept: OutcomeFile,
    /// How much is spent, and since when.
    budget: Option<(WhyBudget, Instant)>,
    /// Forks that were asked for, whether they were played now or before.
    used: u64,
    /// Those of them in which a robot failed.
    failed: Option<FailedForks>,
    progress: &'a mut (dyn FnMut(WhyProgress) + Send),
}

impl Forks for Sampler<'_> {
    fn play(&mut self, plan: &ForkPlan, numbers: Range<u64>) -> Result<Vec<ForkOutcome>, LabError> {
        let known = self.outcomes.entry(plan.clone()).or_default();
        let missing: Vec<u64> = numbers
            .clone()
            .filter(|number| !known.contains_key(number))
            .collect();
        // Also those that were played before: with a budget in forks the answer does not depend on what was kept.
        self.used += numbers.end - numbers.start;
        if !missing.is_empty() {
            self.play_all(plan, &missing)?;
        }

        let known = &self.outcomes[plan];
        let mut outcomes = Vec::new();
        for number in numbers {
            let outcome = known.get(&number).cloned();
            let outcome = outcome.unwrap_or(ForkOutcome::Nothing);
            if let ForkOutcome::Failed(because) = &outcome {
                let failed = self.failed.get_or_insert_with(|| FailedForks {
                    forks: 0,
                    first: plan.clone(),
                    number,
                    because: because.to_string(),
                });
                failed.forks += 1;
            }
            outcomes.push(outcome);
        }
        Ok(outcomes)
    }

    fn has_budget(&self) -> bool {
        match self.budget {
            None => true,
            Some((WhyBudget::Forks(forks), _)) => self.used < forks,
            Some((WhyBudget::Time(time), begun)) => begun.elapsed() < time,
        }
    }
}

impl Sampler<'_> {
    /// Plays forks that were not played yet, and keeps the outcome of each as soon as it is known.
    fn play_all(&mut self, plan: &ForkPlan, numbers: &[u64]) -> Result<(), LabError> {
        let tick = plan.shared();
        let base = Mutex::new(self.rung(tick)?);
        let known = self.outcomes.entry(plan.clone()).or_default();
        let keeping = Mutex::new((known, &mut self.kept, &mut *self.progress));
        let has_failed = AtomicBool::new(false);
        let (asked, forks) = (self.asked, self.used);

        let WhyOptions { jobs, stop, .. } = self.options;
        let played = parallel::all(numbers, *jobs, stop, |&number| {
            // After the first error no further fork is begun; those under way are still kept.
            if has_failed.load(Ordering::Relaxed) {
                return Ok(());
            }
            // Only the copy is made under the lock. Where robots cannot be copied it is after tick 0, and comes to the tick here.
            let copy = locked(&base).snapshot();
            let outcome = copy.and_then(|mut trunk| {
                trunk.go_to(tick)?;
                fork(asked, trunk.into_branch()?, plan, number)
            });

            // In the order in which forks end: the file has the number of each, and outcomes are read by their numbers.
            let (known, kept, progress) = &mut *locked(&keeping);
            progress(WhyProgress { forks, tick });
            let is_kept = outcome.and_then(|outcome| {
                kept.add(plan, number, &outcome)?;
                known.insert(number, outcome);
                Ok(())
            });
            has_failed.fetch_or(is_kept.is_err(), Ordering::Relaxed);
            is_kept
        });

        for is_kept in played.into_iter().flatten() {
            is_kept?;
        }
        if stop.load(Ordering::Relaxed) {
            return Err(LabError::Interrupted);
        }
        Ok(())
    }

    /// The run after a tick.
    fn rung(&mut self, tick: Tick) -> Result<Trunk, LabError> {
        let before = self.rungs.range(..=tick).next_back();
        let (_, rung) = before.ok_or_else(|| LabError::failed("a run begins with tick 0"))?;
        let mut trunk = rung.snapshot()?;

        // Without room for further copies only time is lost: the run is played from an earlier one each time.
        if trunk.tick() < tick {
            trunk.go_to(tick)?;
            if self.rungs.len() < MAX_RUNGS {
                self.rungs.insert(tick, trunk.snapshot()?);
            }
        }
        Ok(trunk)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Plays a fork; returns what came of it.
fn fork(
    asked: &AskedRun,
    mut branch: Branch,
    plan: &ForkPlan,
    number: u64,
) -> Result<ForkOutcome, LabError> {
    let played = begin(&mut branch, plan, number + 1).and_then(|is_fork| {
        if is_fork {
            asked.outcome(&mut branch)
        } else {
            Ok(None)
        }
    });

    // A robot that fails is an outcome of its own; that the fork cannot be played at all ends the answer.
    match played {
        Ok(outcome) => Ok(outcome.into()),
        Err(LabError::Robot(error)) => {
            let reason: String = error.to_string().chars().take(MAX_REASON).collect();
            let tick = branch.tick() + 1;
            Ok(ForkOutcome::Failed(Arc::from(format!(
                "in tick {tick} {reason}"
            ))))
        }
        Err(error) => Err(error),
    }
}

/// Begins a fork as its plan says. Returns whether it is one: what the plan is about may not come about by chance.
fn begin(branch: &mut Branch, plan: &ForkPlan, seed: u64) -> Result<bool, LabError> {
    match plan {
        ForkPlan::After { .. } => branch.reseed(seed, &[]),
        ForkPlan::KindAfter { kind, .. } => branch.reseed(seed, std::slice::from_ref(kind)),
        // In this tick only the one kind is drawn anew, and after it all of chance, as in forks after the tick.
        ForkPlan::KindAt { kind, .. } => {
            branch.reseed(seed, std::slice::from_ref(kind));
            branch.step()?;
            branch.reseed(seed, &[]);
        }
        ForkPlan::Without { event, .. } => {
            leave_out(branch, event, seed)?;
            let record = branch.step()?;
            let events = record.iter().flat_map(|record| record.events.iter());
            // That guests are drawn anew does not make sure that none is in the way.
            for happened in events {
                if let (Event::Blocked { robot, .. }, Counterfactual::WayIsFree { robot: free }) =
                    (happened, event)
                    && robot == free
                {
                    return Ok(false);
                }
            }
            branch.reseed(seed, &[]);
        }
    }
    Ok(true)
}

/// Has an event not happen in the next tick.
fn leave_out(branch: &mut Branch, event: &Counterfactual, seed: u64) -> Result<(), LabError> {
    let tick = branch.tick() + 1;
    let forced = |from: &protocol::RobotName, to: &protocol::RobotName, verdict| ForcedVerdict {
        from: from.clone(),
        to: to.clone(),
        verdict,
    };

    let scenario = branch.simulation().scenario();
    match event {
        Counterfactual::Arrives { from, to, seq } => {
            branch.force(forced(from, to, NetworkVerdict::Arrives(*seq)));
        }
        Counterfactual::IsLost { from, to, seq } => {
            branch.force(forced(from, to, NetworkVerdict::IsLost(*seq)));
        }
        Counterfactual::IsAnswered { from, to } => {
            branch.force(forced(from, to, NetworkVerdict::IsAnswered));
        }
        Counterfactual::WayIsFree { .. } => branch.reseed(seed, &[ChanceKind::Guests]),
        // The branch repeats nothing that was done by hand after the ticks that it shares with the run.
        Counterfactual::NothingByHand => {}
        Counterfactual::NoPartition { index } => {
            let set = scenario.words_without_partition(*index, tick);
            branch.set(&[set.map_err(LabError::refused)?])?;
        }
        Counterfactual::NoFault { index } => {
            let set = scenario.words_without_fault(*index, tick);
            branch.set(&[set.map_err(LabError::refused)?])?;
        }
    }
    Ok(())
}
