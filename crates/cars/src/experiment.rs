//! `cars experiment`: plays experiments over many seeds, in a folder that is resumed after any interruption, and prints tables
//! with confidence intervals.

pub(crate) mod launcher;
mod replay;
mod tables;

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use clap::{Args, Subcommand};
use config::Override;
use config::units::Time;
use experiments::engine::{self, EngineOptions, OUT, Queue, WORKER};
use experiments::shell;
use experiments::{Experiment, Plan, Provenance, Request, Results, Robots, Store};
use indicatif::{ProgressBar, ProgressStyle};
use launch::scenario_file;
use protocol::messages::Verdict;
use protocol::random::MAX_SEED;

use self::launcher::{ProcessArgs, processes_of};
use crate::errors::{Result, refusal};
use crate::named;
use crate::submit::EngineArgs;

/// Most runs at the same time.
const MAX_JOBS: u64 = 1024;
/// Fewest seeds of an option; an interval needs two.
const MIN_SEEDS: u64 = 2;
/// Most seeds of an option.
const MAX_SEEDS: u64 = 100_000;
/// So many units take their time at the end, too.
const MANY: usize = 20_000;
/// Units that are named where there are more of them.
const NAMED: usize = 10;

/// `cars experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    what: ExperimentCommand,
}

#[derive(Debug, Subcommand)]
enum ExperimentCommand {
    /// Play an experiment, or go on with it where it was interrupted: what has been played is not played again.
    Run(ExperimentRunArgs),
    /// Have the units played by Slurm, Kubernetes or GNU parallel, on machines that all see the folder of the experiment.
    ///
    /// An experiment is planned as by `cars experiment run`; the folder of one that has been planned may be given instead.
    Submit(SubmitArgs),
    /// Play certain units of an experiment that has been planned, as the jobs of a cluster do.
    Unit(UnitArgs),
    /// Write the tables and the estimates of the units that have been played.
    Merge(MergeArgs),
    /// Show how many units have been played, have failed, and are missing.
    Status(StatusArgs),
    /// Play one unit once more and record it as a run.
    Replay(replay::ReplayUnitArgs),
}

/// What is planned.
#[derive(Debug, Args)]
struct PlanArgs {
    /// An experiment file, or the name of one that comes with the programs, such as `deadlock`.
    file: PathBuf,
    /// Folder of the results; without it `runs/experiments/NAME`.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Scenario or launch file; without it, that of the experiment's file.
    #[arg(long, value_name = "FILE", value_parser = named::run())]
    scenario: Option<PathBuf>,
    /// Number of runs of each arm and condition, with the seeds 1, 2, 3 and so on, or a range of seeds such as `65..=128`;
    /// without it, the seeds of the experiment's file.
    #[arg(long, value_name = "N|A..=B", value_parser = parse_seeds)]
    seeds: Option<RangeInclusive<u64>>,
    /// Simulated time of each run; without it, that of the experiment's file.
    #[arg(long, value_name = "TIME")]
    duration: Option<Time>,
    /// A change of the scenario in every arm, for example `guests.count=50`. It must not be one that an arm or a condition
    /// makes.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Launch every run as real processes, so that robots in any language take part. The results are the same.
    #[arg(long)]
    processes: bool,
}

/// `cars experiment run`.
#[derive(Debug, Args)]
struct ExperimentRunArgs {
    #[command(flatten)]
    plan: PlanArgs,
    /// Write the plan and play nothing: the units are played by `cars experiment unit`.
    #[arg(long, conflicts_with_all = ["jobs", "json", "retry_failed"])]
    plan_only: bool,
    #[command(flatten)]
    workers: Workers,
    /// Print JSON: every run, every estimate and every difference.
    #[arg(long)]
    json: bool,
}

/// `cars experiment submit`.
#[derive(Debug, Args)]
struct SubmitArgs {
    #[command(flatten)]
    plan: PlanArgs,
    #[command(flatten)]
    engine: EngineArgs,
}

/// `cars experiment unit`.
#[derive(Debug, Args)]
struct UnitArgs {
    /// Folder of the experiment.
    folder: PathBuf,
    /// Number of a unit, from 0, or a range such as `100..=199`, which may end after the last unit.
    #[arg(value_name = "N|A..=B", value_parser = parse_units)]
    units: RangeInclusive<usize>,
    #[command(flatten)]
    workers: Workers,
}

/// How units are played.
#[derive(Debug, Args)]
struct Workers {
    /// Number of runs at the same time; without it the number of processors. The results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_JOBS))]
    jobs: Option<u64>,
    /// Play units that failed once more.
    #[arg(long)]
    retry_failed: bool,
    #[command(flatten)]
    processes: ProcessArgs,
}

/// `cars experiment merge`.
#[derive(Debug, Args)]
struct MergeArgs {
    /// Folder of the experiment.
    folder: PathBuf,
    /// Print JSON: every run, every estimate and every difference.
    #[arg(long)]
    json: bool,
}

/// `cars experiment status`.
#[derive(Debug, Args)]
struct StatusArgs {
    /// Folder of the experiment.
    folder: PathBuf,
}

fn parse_seeds(text: &str) -> Result<RangeInclusive<u64>, String> {
    let count = text.parse().ok().map(|count: u64| 1..=count);
    let range = count.or_else(|| parse_range(text));
    let range = range.filter(|range| {
        let count = range.end().saturating_add(1) - range.start();
        (MIN_SEEDS..=MAX_SEEDS).contains(&count) && *range.end() <= MAX_SEED
    });
    range.ok_or_else(|| {
        format!(
            "{text:?} is not a number of seeds from {MIN_SEEDS} to {MAX_SEEDS}, nor a range of so many, such as \"65..=128\""
        )
    })
}

fn parse_units(text: &str) -> Result<RangeInclusive<usize>, String> {
    let one = text.parse().ok().map(|unit: usize| unit..=unit);
    let range = one.or_else(|| parse_range(text));
    range.ok_or_else(|| {
        format!("{text:?} is not the number of a unit, nor a range such as \"100..=199\"")
    })
}

/// A range with its end, which is not before its begin.
fn parse_range<T: FromStr + PartialOrd>(text: &str) -> Option<RangeInclusive<T>> {
    let (first, last) = text.split_once("..=")?;
    let first = first.parse().ok()?;
    let last = last.parse().ok()?;
    (first <= last).then_some(first..=last)
}

/// Plays experiments and shows their results.
pub(crate) fn experiment(args: ExperimentArgs) -> Result<ExitCode> {
    match args.what {
        ExperimentCommand::Run(args) => run(&args),
        ExperimentCommand::Submit(args) => submit(&args),
        ExperimentCommand::Unit(args) => play_units(&args),
        ExperimentCommand::Merge(args) => {
            let results = Results::load(&args.folder)?;
            conclude(&results, &args.folder, args.json)
        }
        ExperimentCommand::Status(args) => status(&args.folder),
        ExperimentCommand::Replay(args) => replay::replay(args),
    }
}

fn run(args: &ExperimentRunArgs) -> Result<ExitCode> {
    if args.plan.processes {
        // Before the first session, and before any thread.
        bus::runtime::use_one_thread();
    }
    let (plan, folder) = args.plan.save()?;
    if args.plan_only {
        let units = plan.units();
        terminal::note(format_args!("{units} units in {}", folder.display()));
        return Ok(ExitCode::SUCCESS);
    }

    let store = play(&plan, &folder, &args.workers, 0..plan.units())?;
    if !plan.is_in(&folder)? {
        return Err(refusal!(
            help = "`cars experiment merge` writes the results of the plan that is there now",
            "another process has written another plan to {}",
            folder.display()
        ));
    }
    conclude(&Results::of(plan, &store), &folder, args.json)
}

fn submit(args: &SubmitArgs) -> Result<ExitCode> {
    let (plan, folder) = if args.plan.file.is_dir() {
        args.plan.check_folder()?;
        (Plan::load(&args.plan.file)?, args.plan.file.clone())
    } else {
        args.plan.save()?
    };
    plan.check_program()?;
    args.engine.submit(&plan, &folder)?;
    Ok(ExitCode::SUCCESS)
}

fn play_units(args: &UnitArgs) -> Result<ExitCode> {
    let plan = Plan::load(&args.folder)?;
    if *plan.robots() != Robots::InProcess {
        bus::runtime::use_one_thread();
    }
    plan.check_program()?;
    plan.check()?;
    let first = *args.units.start();
    let end = plan.units().min(args.units.end().saturating_add(1));
    if first >= end {
        return Err(refusal!(
            "there is no unit {first}: the experiment in {} has the units 0 to {}",
            args.folder.display(),
            plan.units() - 1
        ));
    }

    let store = play(&plan, &args.folder, &args.workers, first..end)?;
    let mut results = Results::of(plan, &store);
    results
        .failures
        .retain(|failure| (first..end).contains(&failure.unit));
    name_failures(&results, &args.folder);
    Ok(ExitCode::from(u8::from(!results.failures.is_empty())))
}

/// Shows how far an experiment has come.
fn status(folder: &Path) -> Result<ExitCode> {
    let results = Results::load(folder)?;
    terminal::print_line(format_args!(
        "{} units: {} played, {} failed, {} missing",
        results.plan.units(),
        results.outcomes.len(),
        results.failures.len(),
        results.missing.len()
    ))?;
    name_defects(&results);
    name_failures(&results, folder);
    Ok(ExitCode::SUCCESS)
}

impl PlanArgs {
    /// Plans the experiment and writes the plan into its folder.
    fn save(&self) -> Result<(Plan, PathBuf)> {
        let request = self.request()?;
        let folder = match &self.out {
            Some(out) => out.clone(),
            None => Path::new(OUT).join(&request.name),
        };

        let plan = Plan::new(&request)?;
        plan.check()?;
        plan.check_begins()?;

        for (one, other) in plan.equal_arms() {
            terminal::note(equal_arms(one, other));
        }
        for change in plan.changes_since(&folder) {
            terminal::note(change);
        }

        plan.save(&folder)?;
        Ok((plan, folder))
    }

    /// Checks that nothing is to be changed in a folder that has been planned.
    fn check_folder(&self) -> Result<()> {
        let is_changed = self.out.is_some()
            || self.scenario.is_some()
            || self.seeds.is_some()
            || self.duration.is_some()
            || !self.set.is_empty()
            || self.processes;
        if is_changed {
            return Err(refusal!(
                help = "give the experiment's file with these options, and its folder as --out",
                "{}: the experiment in this folder has been planned; options do not change it",
                self.file.display()
            ));
        }

        Ok(())
    }

    fn request(&self) -> Result<Request> {
        let mut experiment = Experiment::find(&self.file)?;
        if let Some(duration) = self.duration {
            experiment.duration_s = duration.0;
            experiment.duration_span = None;
        }
        if let Some(seeds) = &self.seeds {
            experiment.seeds = seeds.clone().collect();
        }
        if let Some(scenario) = &self.scenario {
            experiment.scenario.clone_from(scenario);
        }

        let robots = if self.processes {
            processes_of(&experiment.scenario)?
        } else {
            Robots::InProcess
        };
        experiment.scenario = scenario_file(&experiment.scenario)?;
        let name = self.file.file_stem().unwrap_or_default();
        Ok(Request {
            name: name.to_string_lossy().into_owned(),
            experiment,
            set: self.set.clone(),
            robots,
            own: None,
        })
    }
}

/// That two arms play the same runs, for people.
pub(crate) fn equal_arms(one: &str, other: &str) -> String {
    format!(
        "the arms \"{one}\" and \"{other}\" play the same runs under every condition: there is no difference between them"
    )
}

/// Plays those of these units that have not been played.
fn play(plan: &Plan, folder: &Path, workers: &Workers, units: Range<usize>) -> Result<Store> {
    let jobs = match workers.jobs {
        Some(jobs) => jobs as usize,
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let options = EngineOptions {
        units,
        jobs,
        retries_failed: workers.retry_failed,
    };
    let mut store = Store::open(folder)?;
    let mut queue = Queue::of(plan, &store, &options);
    for damage in store.damages_of(plan, queue.units()) {
        terminal::note(damage);
    }
    let count = options.units.len();
    let open = queue.units().len();
    terminal::note(format_args!(
        "{count} units: {} are there, {open} to play",
        count - open
    ));

    let launches = workers.processes.launches()?;
    be_quiet_about_units();
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {eta} left")?;
    let bar = ProgressBar::new(open as u64).with_style(style);
    let done = || bar.inc(1);
    engine::play(
        plan, folder, &mut store, &mut queue, &options, &launches, &done,
    )?;
    bar.finish_and_clear();
    for remark in launches.remarks() {
        terminal::note(remark);
    }
    Ok(store)
}

/// Prints no message where a unit panics: it becomes the reason of its failure.
fn be_quiet_about_units() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(WORKER) {
            print(panic);
        }
    }));
}

/// Writes the results into their folder and prints them. The exit status is 1 if a unit is missing, failed, or gave different
/// runs; otherwise it is that of the worst verdict about what the experiment file expects.
fn conclude(results: &Results, folder: &Path, is_json: bool) -> Result<ExitCode> {
    let played = results.outcomes.len();
    if played >= MANY {
        terminal::note(format_args!(
            "{played} units: tables and estimates are made, which takes a while"
        ));
    }
    results.write(folder)?;
    Provenance::here().write(folder)?;
    if is_json {
        tables::print_json(results)?;
    } else {
        tables::print(results)?;
    }

    name_defects(results);
    name_failures(results, folder);
    let place = shell::path(folder);
    let verdict = name_verdicts(results, &place);
    terminal::note(format_args!(
        "results in {place}; `cars experiment replay {place} N` records the unit N as a run"
    ));
    let is_whole = results.missing.is_empty() && results.failures.is_empty();
    if !is_whole || !results.conflicts.is_empty() {
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::from(verdict.exit_status()))
}

/// Names the expectations of the experiment that runs have not met, and returns the worst verdict.
fn name_verdicts(results: &Results, place: &str) -> Verdict {
    let mut worst = Verdict::Unreached;
    for judged in results.judged() {
        let verdict = judged.verdict();
        worst = worst.max(verdict);
        let unreached = judged.unreached.len();
        if unreached > 0 {
            let expectation = judged.expectation;
            let runs = judged.judged;
            terminal::note(match runs - unreached {
                0 => format!("never reached: {expectation}: in none of {runs} runs"),
                reached => format!("reached: {expectation}: in {reached} of {runs} runs"),
            });
        }

        let units = match verdict {
            Verdict::Pass | Verdict::Unreached => continue,
            Verdict::NotAsked => &judged.not_asked,
            Verdict::Undecided => &judged.undecided,
            Verdict::Fail => &judged.failed,
        };
        terminal::note(format_args!(
            "{verdict}: {}: in {} of {} runs, the first is {}",
            judged.expectation,
            units.len(),
            results.outcomes.len(),
            results.plan.unit(units[0]).describe()
        ));
        if verdict == Verdict::Fail && *results.plan.robots() == Robots::InProcess {
            let run = format!("{}-{}", results.plan.name(), units[0]);
            let expectation = shell::word(judged.expectation);
            terminal::note(format_args!(
                "  cars experiment replay {place} {} --run {run}\n  cars why {run} {expectation}",
                units[0]
            ));
        }
    }

    worst
}

/// Names what of the results is missing or cannot be trusted.
fn name_defects(results: &Results) {
    for damage in &results.damages {
        terminal::note(damage);
    }

    if !results.missing.is_empty() {
        terminal::note(format_args!(
            "{} of {} units are missing, the first is {}",
            results.missing.len(),
            results.plan.units(),
            results.missing[0]
        ));
    }

    for sentence in &results.never_occurred {
        terminal::note(sentence);
    }

    for unit in results.conflicts.iter().take(NAMED) {
        let unit = results.plan.unit(*unit).describe();
        terminal::note(format_args!(
            "{unit} was played several times and gave different runs: a robot is not reproducible"
        ));
    }
}

/// Names the units that failed, with their reasons.
fn name_failures(results: &Results, folder: &Path) {
    let failures = &results.failures;
    if failures.is_empty() {
        return;
    }

    terminal::note(format_args!(
        "{} of {} units failed; --retry-failed plays them once more",
        failures.len(),
        results.plan.units()
    ));
    for failure in failures.iter().take(NAMED) {
        let unit = results.plan.unit(failure.unit).describe();
        terminal::note(format_args!("  {unit}: {}", failure.reason));
    }
    if failures.len() > NAMED {
        let place = folder.join("runs.csv");
        terminal::note(format_args!("  and others, see {}", place.display()));
    }
}
