//! `cars experiment`: experiments that ship with the project, repeated over seeds, as tables with confidence intervals.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use protocol::RunName;
use serde::Serialize;
use simulator::Summary;
use simulator::scenario::{Changes, Override, Scenario};
use simulator::units::Time;
use tabled::builder::Builder;
use tabled::settings::object::Columns;
use tabled::settings::{Alignment, Style};

use crate::run::play;
use crate::statistics::{Estimate, MIN_SAMPLE};

/// `cars experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// Lose commands, and see which team stops working: without emotions, with a timer, with emotions, with both.
    ///
    /// The problem of Murphy, Lisetti et al. 2002: two robots that depend on each other deadlock when one message is
    /// lost, unless something makes them act.
    Deadlock(DeadlockArgs),
}

/// `cars experiment deadlock`.
#[derive(Debug, Args)]
pub(crate) struct DeadlockArgs {
    /// Scenario with a Butler and a Leguin.
    #[arg(long, default_value = "configs/hors_doeuvres.toml", value_name = "FILE")]
    scenario: PathBuf,
    /// Probabilities with which a command is lost.
    #[arg(long, value_delimiter = ',', default_value = "0,0.1,0.25,0.5,1", value_parser = probability)]
    loss: Vec<f64>,
    /// Runs of each arm and probability, with the seeds 1, 2, 3 and so on.
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u64).range(MIN_SAMPLE..=100_000))]
    seeds: u64,
    /// Simulated time of each run.
    #[arg(long, default_value = "600 s", value_name = "TIME")]
    duration: Time,
    /// Runs at the same time; without it as many as there are processors. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// A further change of the scenario, in every arm, for example `guests.count=50`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Print JSON: every run and every estimate.
    #[arg(long)]
    json: bool,
}

fn probability(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| format!("{text:?} is not a probability, a number from 0 to 1"))
}

/// A team under comparison: a name, what it is, and how the scenario is changed to make it.
struct Arm {
    name: &'static str,
    what: &'static str,
    changes: &'static [&'static str],
}

const ARMS: [Arm; 4] = [
    Arm {
        name: "affectless",
        what: "no emotions; Butler calls once when the same need presses, nothing is repeated",
        changes: &["robot.Butler.params.affect=off", "robot.Leguin.params.affect=off"],
    },
    Arm {
        name: "timer repeat",
        what: "no emotions; Butler repeats an unanswered command every 5 s",
        changes: &[
            "robot.Butler.params.affect=off",
            "robot.Leguin.params.affect=off",
            "robot.Butler.params.resend=on",
        ],
    },
    Arm {
        name: "affect only",
        what: "emotions escalate from refill to hurry to intercepting, and send Leguin home when she has waited too long; nothing is repeated",
        changes: &[],
    },
    Arm { name: "both", what: "emotions, and the timer", changes: &["robot.Butler.params.resend=on"] },
];

/// What came of one run.
#[derive(Debug, Clone, Serialize)]
struct Outcome {
    loss: f64,
    arm: &'static str,
    seed: u64,
    exchanges: f64,
    empty_s: f64,
    messages: f64,
    digest: String,
}

/// What came of all runs of an arm at one loss.
#[derive(Debug, Serialize)]
struct Cell {
    loss: f64,
    arm: &'static str,
    exchanges: Estimate,
    empty_s: Estimate,
    messages: Estimate,
}

/// Plays an experiment.
pub(crate) fn experiment(args: &ExperimentArgs) -> miette::Result<ExitCode> {
    let Experiment::Deadlock(args) = &args.experiment;
    let outcomes = measure(args)?;
    let cells = estimate(args, &outcomes);
    if args.json {
        let all = serde_json::json!({ "compared": compared(args), "runs": outcomes, "estimates": cells });
        println!("{}", serde_json::to_string_pretty(&all).into_diagnostic()?);
    } else {
        print!("{}", render(args, &cells));
    }
    Ok(ExitCode::SUCCESS)
}

/// Every run of the experiment, in a fixed order whatever the number of jobs.
fn measure(args: &DeadlockArgs) -> miette::Result<Vec<Outcome>> {
    let mut units = Vec::new();
    for loss in &args.loss {
        for arm in &ARMS {
            units.extend((1..=args.seeds).map(|seed| (*loss, arm, seed)));
        }
    }
    // A mistake in the scenario is told once, before anything starts.
    if let Some((loss, arm, seed)) = units.first() {
        load(args, *loss, arm, *seed)?;
    }
    let bar = ProgressBar::new(units.len() as u64);
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {eta} left").into_diagnostic()?;
    bar.set_style(style);
    let available = || std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.map_or_else(available, |jobs| jobs as usize);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((loss, arm, seed)) = units.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push(one(args, *loss, arm, *seed));
            bar.inc(1);
        }
        done
    };
    let done: Vec<miette::Result<Outcome>> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_else(|_| vec![Err(broken())])).collect()
    });
    bar.finish_and_clear();
    let mut outcomes = done.into_iter().collect::<miette::Result<Vec<_>>>()?;
    let place = |arm: &str| ARMS.iter().position(|other| other.name == arm);
    outcomes.sort_by(|a, b| {
        a.loss.total_cmp(&b.loss).then(place(a.arm).cmp(&place(b.arm))).then(a.seed.cmp(&b.seed))
    });
    Ok(outcomes)
}

fn broken() -> miette::Report {
    miette!("a run ended in a panic; its message stands above")
}

fn load(args: &DeadlockArgs, loss: f64, arm: &Arm, seed: u64) -> miette::Result<Scenario> {
    let own = arm.changes.iter().map(|change| (*change).to_owned());
    let own =
        own.chain([format!("network.commands={{ loss = {loss:?} }}"), "record.frames=false".to_owned()]);
    let mut set = args.set.clone();
    for change in own {
        set.push(change.parse().map_err(|reason| miette!("{change}: {reason}"))?);
    }
    let changes = Changes { seed: Some(seed), duration_s: Some(args.duration.0), set };
    Ok(Scenario::load(&args.scenario, &changes)?)
}

fn one(args: &DeadlockArgs, loss: f64, arm: &Arm, seed: u64) -> miette::Result<Outcome> {
    let scenario = load(args, loss, arm, seed)?;
    let run = RunName::new("deadlock").into_diagnostic()?;
    let mut summary = None;
    let simulation = play(scenario, &run, |simulation, record| {
        let summary = summary.get_or_insert_with(|| Summary::begin(&run, simulation));
        record.lines().for_each(|line| summary.count(simulation, &line));
        Ok(())
    })?;
    let mut summary = summary.ok_or_else(|| miette!("the run has not begun"))?;
    summary.finish(&simulation);
    let butler = |variable: &str| {
        let robot = summary.robots.iter().find(|(name, _)| name.as_str() == "Butler");
        let value = robot.and_then(|(_, robot)| robot.state_variables.get(variable)?.as_f64());
        value.ok_or_else(|| {
            let file = args.scenario.display();
            miette!("{file}: it needs a robot called Butler that publishes {variable:?} as a number")
        })
    };
    Ok(Outcome {
        loss,
        arm: arm.name,
        seed,
        exchanges: butler("exchanges")?,
        empty_s: butler("empty_s")?,
        messages: summary.robots.values().flat_map(|robot| robot.sent.values()).sum::<u64>() as f64,
        digest: summary.digest.clone(),
    })
}

fn estimate(args: &DeadlockArgs, outcomes: &[Outcome]) -> Vec<Cell> {
    let mut losses = args.loss.clone();
    losses.sort_by(f64::total_cmp);
    let mut cells = Vec::new();
    for loss in losses {
        for arm in &ARMS {
            let runs: Vec<&Outcome> =
                outcomes.iter().filter(|run| run.loss == loss && run.arm == arm.name).collect();
            let of = |value: fn(&Outcome) -> f64| {
                Estimate::of(&runs.iter().map(|run| value(run)).collect::<Vec<_>>())
            };
            let (exchanges, empty_s, messages) =
                (of(|run| run.exchanges), of(|run| run.empty_s), of(|run| run.messages));
            cells.push(Cell { loss, arm: arm.name, exchanges, empty_s, messages });
        }
    }
    cells
}

/// What is compared with what, in words.
fn compared(args: &DeadlockArgs) -> String {
    let mut text = format!(
        "{}: {} runs of {} s for each line, seeds 1 to {}. Runs with the same seed have the same guests at the start and\n\
         the same chance of their own, whatever the arm. Every command between robots is lost with the probability given,\n\
         independently; queries and sensing always work. Mean and 95 % confidence interval over the seeds.\n\n",
        args.scenario.display(),
        args.seeds,
        args.duration.0,
        args.seeds,
    );
    for arm in &ARMS {
        text += &format!("  {:<13} {}\n", arm.name, arm.what);
    }
    text
}

fn render(args: &DeadlockArgs, cells: &[Cell]) -> String {
    let mut table = Builder::default();
    table.push_record(["loss", "arm", "exchanges", "tray empty, s", "messages"]);
    let mut above = None;
    for cell in cells {
        let is_new = above.replace(cell.loss) != Some(cell.loss);
        table.push_record([
            if is_new { format!("{}", cell.loss) } else { String::new() },
            cell.arm.to_owned(),
            cell.exchanges.to_string(),
            cell.empty_s.to_string(),
            cell.messages.to_string(),
        ]);
    }
    let mut table = table.build();
    table.with(Style::rounded()).modify(Columns::new(2..), Alignment::right());
    format!("{}\n{table}\n", compared(args))
}
