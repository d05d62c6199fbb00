//! `cars hunt`: draws fault plans until an expectation fails, and shrinks what it finds to a scenario file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use causes::WhyBudget;
use clap::Args;
use config::units::Time;
use config::{Changes, Override};
use experiments::shell;
use experiments::{ByClass, Robots};
use hunts::{
    CommandFate, Coverage, FaultClass, Feature, Finding, HuntBudget, HuntOptions, HuntProgress,
    HuntReport, HuntRobots, Link, Subject, hunt as go,
};
use indicatif::{ProgressBar, ProgressStyle};
use protocol::random::MAX_SEED;
use terminal::OutputError;

use crate::errors::{Result, render};
use crate::experiment::launcher::{ProcessArgs, processes_of};
use crate::named;

/// Time for which a hunt draws plans if neither a time nor a number of plans is given, seconds.
const DEFAULT_S: f64 = 60.0;
/// Most texts of the commands of a link with one fate that are printed.
const MAX_TEXTS: usize = 5;
/// The exit status of a hunt that has found nothing, where no plan has reached what some run should.
const NEVER_REACHED: u8 = 3;
/// Set by Ctrl-C: the hunt ends with what it has found.
static STOP: AtomicBool = AtomicBool::new(false);

/// `cars hunt`.
#[derive(Debug, Args)]
pub(crate) struct HuntArgs {
    /// A scenario file, or a launch file, whose scenario is hunted in. It needs `[[expect]]`.
    #[arg(value_parser = named::run())]
    file: PathBuf,
    /// Draw plans for this time of wall clock, for example "60 s", which is the default.
    #[arg(long = "for", value_name = "TIME", conflicts_with = "plans")]
    time: Option<Time>,
    /// Draw this number of plans. The same seed and number of plans give the same result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    plans: Option<u64>,
    /// Seed of the plans; the scenario keeps its own.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=MAX_SEED))]
    seed: u64,
    /// Number of runs at the same time; without it the number of processors. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// Kinds of faults that are drawn, for example `lose,crash`; without it all: lose, late, double, loss, burst, delay,
    /// duplication, partition, one-way, crash, hang, wall, crowd, reseed.
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    kinds: Vec<FaultClass>,
    /// Longest time of a fault, in simulated time. Walls and crowds are there for the whole run.
    #[arg(long, value_name = "TIME", default_value = "60 s", value_parser = parse_longest)]
    longest: Time,
    /// Name of an expectation to check; without it all are. Can be given several times.
    #[arg(long, value_name = "NAME")]
    expect: Vec<String>,
    /// Most runs to shrink a finding.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    shrink_runs: u64,
    /// A change of the scenario, for example `robot.Butler.params.policy=neither`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Where scenario files of findings are written.
    #[arg(long, short, default_value = "hunt", value_name = "DIR")]
    out: PathBuf,
    /// Launch every run as real processes, so that robots in any language take part. The results are the same.
    #[arg(long)]
    processes: bool,
    #[command(flatten)]
    process_use: ProcessArgs,
    /// Print JSON: findings and coverage.
    #[arg(long)]
    json: bool,
    /// Record the run of each finding, and run `cars why` on it: when it was decided, and by what.
    #[arg(long, conflicts_with_all = ["json", "processes"])]
    explain: bool,
    /// How much is spent on the explanation of each finding, as for `cars why`: most forks, such as 2000, or a time, such as "5 min";
    /// without it as many forks as the answer needs.
    #[arg(long, value_name = "FORKS|TIME", requires = "explain")]
    budget: Option<WhyBudget>,
}

/// Hunts; the exit status is 1 if something was found, 2 if the hunt cannot be made, and 3 if nothing was found and what some run
/// should reach was never reached.
pub(crate) fn hunt(args: &HuntArgs) -> ExitCode {
    match play(args) {
        Ok(report) if !report.findings.is_empty() => ExitCode::FAILURE,
        Ok(report) if report.never_reached().next().is_some() => ExitCode::from(NEVER_REACHED),
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::note(format_args!("Error: {}", render(error.as_ref())));
            ExitCode::from(2)
        }
    }
}

fn play(args: &HuntArgs) -> Result<HuntReport> {
    if args.processes {
        // Before the first session, and before any thread.
        bus::runtime::use_one_thread();
    }
    let file = launch::scenario_file(&args.file)?;
    let changes = Changes {
        set: args.set.clone(),
        ..Changes::default()
    };
    let launches = Arc::new(args.process_use.launches()?);
    let robots = match args.processes {
        false => HuntRobots::InProcess(ByClass::of_project()),
        true => {
            let launch = match processes_of(&args.file)? {
                Robots::Launched(launch) => Some(launch),
                Robots::InProcess | Robots::Programs => None,
            };
            HuntRobots::Processes(launches.clone(), launch)
        }
    };
    let subject = Subject::load_with(&file, &changes, robots)?;
    ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed))?;

    if subject.scenario.expectations.is_empty() {
        terminal::note(
            "The scenario expects nothing ([[expect]]): only robots that fail will be found.",
        );
    }
    let options = args.options();
    let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed}")?;
    let bar = ProgressBar::new_spinner().with_style(style);
    let begun = Instant::now();
    let report = go(&subject, &options, &mut |progress| match progress {
        HuntProgress::Played(plans, features) => {
            bar.set_message(format!("{plans} plans, {features} features"));
            bar.tick();
        }
        HuntProgress::Found(finding) => bar.suspend(|| {
            let elapsed_s = begun.elapsed().as_secs_f64();
            terminal::note(format_args!(
                "plan {} fails after {elapsed_s:.1} s: {}",
                finding.plan, finding.expectation
            ));
        }),
        HuntProgress::Shrunk(finding) => bar.suspend(|| {
            let elapsed_s = begun.elapsed().as_secs_f64();
            let runs = finding.shrink_runs;
            terminal::note(format_args!(
                "shrunk by {runs} runs after {elapsed_s:.1} s: {}",
                finding.file.display()
            ));
        }),
    })?;
    bar.finish_and_clear();
    for remark in launches.remarks() {
        terminal::note(remark);
    }

    let printed = if args.json {
        let json = serde_json::to_string_pretty(&report)?;
        terminal::data(format_args!("{json}\n"))
    } else {
        terminal::print(in_words(&report))
    };
    OutputError::unless_closed(printed)?;
    if args.explain {
        explain(&report.findings, args.budget)?;
    }
    Ok(report)
}

fn parse_longest(text: &str) -> Result<Time, String> {
    let time: Time = text.parse()?;
    if time.0 > 0.0 {
        Ok(time)
    } else {
        Err("a fault lasts for more than 0 s".to_owned())
    }
}

impl HuntArgs {
    fn options(&self) -> HuntOptions<'static> {
        let budget = match (self.plans, self.time) {
            (Some(plans), _) => HuntBudget::Plans(plans),
            (None, time) => {
                let time_s = time.map_or(DEFAULT_S, |time| time.0);
                HuntBudget::Time(Duration::try_from_secs_f64(time_s).unwrap_or(Duration::MAX))
            }
        };
        let jobs = match self.jobs {
            Some(jobs) => jobs as usize,
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        let kinds = if self.kinds.is_empty() {
            FaultClass::ALL.to_vec()
        } else {
            self.kinds.clone()
        };

        HuntOptions {
            seed: self.seed,
            budget,
            jobs,
            kinds,
            longest_s: self.longest.0,
            expect: self.expect.iter().cloned().collect::<BTreeSet<String>>(),
            shrink_runs: self.shrink_runs,
            out: self.out.clone(),
            stop: &STOP,
        }
    }
}

/// The report for people.
fn in_words(report: &HuntReport) -> String {
    let mut text = coverage_in_words(&report.coverage);
    let scenario = report.scenario.display();
    text += &format!(
        "\n{} plans of seed {} in {scenario}, {} ticks; {} of them went on from a state that an earlier one had reached.",
        report.plans, report.seed, report.ticks, report.gone_on
    );
    if report.not_set_up > 0 {
        text += &format!(" {} of them could not be set up.", report.not_set_up);
    }

    text += "\n";
    for expectation in &report.expectations {
        let mut findings = report.findings.iter();
        if report.plans > report.not_set_up && report.never_asked.contains(expectation) {
            text += &format!("never asked: {expectation}\n");
        } else if !findings.any(|finding| finding.expectation == *expectation) {
            text += &format!("not seen to fail: {expectation}\n");
        }
    }
    for (goal, plans) in &report.goals {
        let is_reached_without = report.reached_without_faults.contains(goal);
        text += &match (plans, is_reached_without) {
            (0, false) => format!("never reached: {goal}\n"),
            (0, true) => format!("reached without faults, and in no plan: {goal}\n"),
            (plans, _) => format!("reached in {plans} of {} plans: {goal}\n", report.plans),
        };
    }
    for finding in &report.findings {
        text += &finding_in_words(finding);
    }
    if report.not_shrunk > 0 {
        let not_shrunk = report.not_shrunk;
        text += &format!("{not_shrunk} further failures were not shrunk: there are too many\n");
    }
    text
}

fn finding_in_words(finding: &Finding) -> String {
    let mut text = format!("FAILS: {} ({})\n", finding.expectation, finding.because);
    for fault in &finding.faults {
        text += &format!("  {fault}\n");
    }
    text += &format!(
        "  found by plan {}, seen in {} plans\n",
        finding.plan, finding.plans
    );
    if !finding.is_minimal {
        text += "  not minimal: more --shrink-runs may make it smaller\n";
    }
    let run = finding.run();
    text += &format!("  cars run {} --run {run}\n", shell::path(&finding.file));
    if finding.can_be_explained() {
        let expectation = shell::word(&finding.expectation);
        text += &format!("  cars why {run} {expectation}\n");
    }
    text
}

/// Records the run of each finding, and asks when and by what it was decided. Ctrl-C ends it; `cars why` goes on where it was.
fn explain(findings: &[Finding], budget: Option<WhyBudget>) -> Result<()> {
    let program = std::env::current_exe()?;
    for finding in findings.iter().filter(|finding| finding.can_be_explained()) {
        if STOP.load(Ordering::Relaxed) {
            break;
        }
        let run = finding.run();
        // The verdict of the run is a failure; whether it was recorded is what `cars why` finds out.
        Command::new(&program)
            .arg("run")
            .arg(&finding.file)
            .args(["--run", &run, "--replace", "--quiet"])
            .stdout(Stdio::null())
            .status()?;

        terminal::note(format_args!("cars why {run} {}", finding.expectation));
        let mut why = Command::new(&program);
        why.args(["why", &run, &finding.expectation]);
        if let Some(budget) = budget {
            why.args(["--budget", &budget.to_string()]);
        }
        why.status()?;
    }
    Ok(())
}

fn coverage_in_words(coverage: &Coverage) -> String {
    let mut faults = Vec::new();
    let mut others = String::new();
    let texts = frequent_texts(coverage);
    for (feature, plans) in coverage.features() {
        let line = match feature {
            Feature::Fault { kind } => {
                faults.push(format!("{} {plans}", kind.name()));
                continue;
            }
            Feature::Message { link, text, fate } => {
                if !texts[&(link, fate)].contains(&text.as_str()) {
                    continue;
                }
                format!("{} -> {}: {text}: {fate}", link.from, link.to)
            }
            Feature::QueryLost { link } => format!("{} -> {}: query lost", link.from, link.to),
            Feature::Behavior { robot, from, to } => format!("{robot}: {from} -> {to}"),
            Feature::Emotion { robot, from, to } => format!("{robot} feels: {from} -> {to}"),
            // In the lines of the goals.
            Feature::Reached { .. } => continue,
        };
        others += &format!("{plans:>8}  {line}\n");
    }

    let mut left_out = 0;
    for (feature, _) in coverage.features() {
        if let Feature::Message { link, text, fate } = feature {
            left_out += usize::from(!texts[&(link, fate)].contains(&text.as_str()));
        }
    }
    if left_out > 0 {
        others += &format!("{left_out:>8}  further texts of commands and their fates\n");
    }

    format!(
        "plans  in which it occurred\n{others}\nkinds of faults, in plans: {}\n",
        faults.join(", ")
    )
}

/// The most frequent texts of the commands of each link that had the same fate: robots choose texts freely.
fn frequent_texts(coverage: &Coverage) -> BTreeMap<(&Link, &CommandFate), Vec<&str>> {
    let mut all: BTreeMap<(&Link, &CommandFate), Vec<(u64, &str)>> = BTreeMap::new();
    for (feature, plans) in coverage.features() {
        if let Feature::Message { link, text, fate } = feature {
            let texts = all.entry((link, fate)).or_default();
            texts.push((plans, text));
        }
    }

    let mut frequent = BTreeMap::new();
    for (message, mut texts) in all {
        texts.sort_by_key(|(plans, _)| std::cmp::Reverse(*plans));
        texts.truncate(MAX_TEXTS);
        frequent.insert(message, texts.into_iter().map(|(_, text)| text).collect());
    }
    frequent
}
