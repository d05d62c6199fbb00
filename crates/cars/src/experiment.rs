//! `cars experiment`: experiments that ship with the project, repeated over seeds, as tables with confidence intervals.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use protocol::{Event, RunName};
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
    /// Cut the two robots off from each other for a while, commands and queries, and see which team works on and recovers.
    Partition(PartitionArgs),
}

/// What all experiments have in common.
#[derive(Debug, Args)]
struct Common {
    /// Scenario with a Butler and a Leguin.
    #[arg(
        long,
        default_value = "configs/hors_doeuvres.toml",
        value_name = "FILE"
    )]
    scenario: PathBuf,
    /// Runs of each arm and condition, with the seeds 1, 2, 3 and so on.
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

/// `cars experiment deadlock`.
#[derive(Debug, Args)]
pub(crate) struct DeadlockArgs {
    /// Probabilities with which a command is lost.
    #[arg(long, value_delimiter = ',', default_value = "0,0.1,0.25,0.5,1", value_parser = probability)]
    loss: Vec<f64>,
    #[command(flatten)]
    common: Common,
}

/// `cars experiment partition`.
#[derive(Debug, Args)]
pub(crate) struct PartitionArgs {
    /// When the link is cut.
    #[arg(long, default_value = "120 s", value_name = "TIME")]
    from: Time,
    /// For how long.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0 s,60 s,120 s,240 s",
        value_name = "TIMES"
    )]
    lasting: Vec<Time>,
    #[command(flatten)]
    common: Common,
}

/// One row of an experiment: what is done to every team alike.
struct Condition {
    /// As the table names it.
    name: String,
    change: String,
    /// Simulated time of what is done, from and until, seconds; the whole run if it has no time.
    time_s: (f64, f64),
}

/// An experiment, ready to be played.
struct Plan<'a> {
    common: &'a Common,
    /// Head of the column with the conditions.
    varied: &'static str,
    /// What is done and what is not, in a sentence.
    explained: String,
    conditions: Vec<Condition>,
    /// Whether exchanges are told for the time of what is done and for the time after it.
    tells_times: bool,
}

impl DeadlockArgs {
    fn plan(&self) -> Plan<'_> {
        let mut losses = self.loss.clone();
        losses.sort_by(f64::total_cmp);
        let condition = |loss: f64| Condition {
            name: loss.to_string(),
            change: format!("network.commands={{ loss = {loss:?} }}"),
            time_s: (0.0, self.common.duration.0),
        };
        Plan {
            common: &self.common,
            varied: "loss",
            explained: "Every command between robots is lost with the probability given,\nindependently; queries and sensing always work.".to_owned(),
            conditions: losses.into_iter().map(condition).collect(),
            tells_times: false,
        }
    }
}

impl PartitionArgs {
    fn plan(&self) -> Plan<'_> {
        let from_s = self.from.0;
        let condition = |lasting: &Time| {
            let until_s = from_s + lasting.0;
            let cut = format!(
                "network.partition=[{{ groups = [[\"Butler\"], [\"Leguin\"]], from = \"{from_s} s\", until = \"{until_s} s\" }}]"
            );
            let change = if lasting.0 > 0.0 {
                cut
            } else {
                "network.partition=[]".to_owned()
            };
            Condition {
                name: format!("{} s", lasting.0),
                change,
                time_s: (from_s, until_s),
            }
        };
        Plan {
            common: &self.common,
            varied: "cut for",
            explained: format!(
                "From {from_s} s on, for the time given, no command and no query passes\nbetween Butler and Leguin; sensing is physical and goes on."
            ),
            conditions: self.lasting.iter().map(condition).collect(),
            tells_times: true,
        }
    }
}

fn probability(text: &str) -> Result<f64, String> {
    let value = text
        .parse()
        .ok()
        .filter(|value| (0.0..=1.0).contains(value));
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
        changes: &[
            "robot.Butler.params.affect=off",
            "robot.Leguin.params.affect=off",
        ],
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
    Arm {
        name: "both",
        what: "emotions, and the timer",
        changes: &["robot.Butler.params.resend=on"],
    },
];

/// What came of one run.
#[derive(Debug, Clone, Serialize)]
struct Outcome {
    condition: String,
    arm: &'static str,
    seed: u64,
    exchanges: f64,
    /// Exchanges that began while the condition lasted, and after it.
    during: f64,
    after: f64,
    empty_s: f64,
    messages: f64,
    digest: String,
}

/// What came of all runs of an arm under one condition.
#[derive(Debug, Serialize)]
struct Cell {
    condition: String,
    arm: &'static str,
    exchanges: Estimate,
    during: Estimate,
    after: Estimate,
    empty_s: Estimate,
    messages: Estimate,
}

/// Plays an experiment.
pub(crate) fn experiment(args: &ExperimentArgs) -> miette::Result<ExitCode> {
    let plan = match &args.experiment {
        Experiment::Deadlock(args) => args.plan(),
        Experiment::Partition(args) => args.plan(),
    };
    let outcomes = plan.measure()?;
    let cells = plan.estimate(&outcomes);
    if plan.common.json {
        let all = serde_json::json!({ "compared": plan.compared(), "runs": outcomes, "estimates": cells });
        println!("{}", serde_json::to_string_pretty(&all).into_diagnostic()?);
    } else {
        print!("{}", plan.render(&cells));
    }
    Ok(ExitCode::SUCCESS)
}

/// One run to be played.
type Unit<'a> = (&'a Condition, &'static Arm, u64);

impl Plan<'_> {
    /// Every run of the experiment, in a fixed order whatever the number of jobs.
    fn measure(&self) -> miette::Result<Vec<Outcome>> {
        let mut units: Vec<Unit<'_>> = Vec::new();
        for condition in &self.conditions {
            for arm in &ARMS {
                units.extend((1..=self.common.seeds).map(|seed| (condition, arm, seed)));
            }
        }
        // A mistake in the scenario is told once, before anything starts.
        units.first().map(|unit| self.load(unit)).transpose()?;
        let bar = ProgressBar::new(units.len() as u64);
        bar.set_style(
            ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {eta} left")
                .into_diagnostic()?,
        );
        let available = || std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = self
            .common
            .jobs
            .map_or_else(available, |jobs| jobs as usize);
        let next = AtomicUsize::new(0);
        let work = || {
            let mut done = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(unit) = units.get(index) else {
                    return done;
                };
                done.push((index, self.one(unit)));
                bar.inc(1);
            }
        };
        let mut done = std::thread::scope(|scope| {
            let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
            let joined = workers
                .into_iter()
                .map(|worker| worker.join().map_err(|_| broken()));
            joined.collect::<miette::Result<Vec<_>>>()
        })?;
        bar.finish_and_clear();
        let mut outcomes: Vec<_> = done.drain(..).flatten().collect();
        outcomes.sort_by_key(|(index, _)| *index);
        outcomes.into_iter().map(|(_, outcome)| outcome).collect()
    }

    fn load(&self, (condition, arm, seed): &Unit<'_>) -> miette::Result<Scenario> {
        let own = arm
            .changes
            .iter()
            .copied()
            .chain([condition.change.as_str(), "record.frames=false"]);
        let mut set = self.common.set.clone();
        for change in own {
            set.push(
                change
                    .parse()
                    .map_err(|reason| miette!("{change}: {reason}"))?,
            );
        }
        let changes = Changes {
            seed: Some(*seed),
            duration_s: Some(self.common.duration.0),
            set,
        };
        Ok(Scenario::load(&self.common.scenario, &changes)?)
    }

    fn one(&self, unit: &Unit<'_>) -> miette::Result<Outcome> {
        let (condition, arm, seed) = unit;
        let run = RunName::new("experiment").into_diagnostic()?;
        let (mut summary, mut begun_s) = (None, Vec::new());
        let simulation = play(self.load(unit)?, &run, |simulation, record| {
            let summary = summary.get_or_insert_with(|| Summary::begin(&run, simulation));
            record
                .lines()
                .for_each(|line| summary.count(simulation, &line));
            let begins = |event: &&Event| matches!(event, Event::Behavior { robot, to, .. } if robot.as_str() == "Butler" && to == "EXCHANGE");
            begun_s.extend(
                record
                    .events
                    .iter()
                    .filter(begins)
                    .map(|_| simulation.time_s(record.tick)),
            );
            Ok(())
        })?;
        let mut summary = summary.ok_or_else(|| miette!("the run has not begun"))?;
        summary.finish(&simulation);
        let (from_s, until_s) = condition.time_s;
        let count = |is_meant: &dyn Fn(f64) -> bool| {
            begun_s.iter().filter(|begun_s| is_meant(**begun_s)).count() as f64
        };
        Ok(Outcome {
            condition: condition.name.clone(),
            arm: arm.name,
            seed: *seed,
            exchanges: self.of_butler(&summary, "exchanges")?,
            during: count(&|begun_s| (from_s..until_s).contains(&begun_s)),
            after: count(&|begun_s| begun_s >= until_s),
            empty_s: self.of_butler(&summary, "empty_s")?,
            messages: summary
                .robots
                .values()
                .flat_map(|robot| robot.sent.values())
                .sum::<u64>() as f64,
            digest: summary.digest.clone(),
        })
    }

    /// A number that Butler published last.
    fn of_butler(&self, summary: &Summary, variable: &str) -> miette::Result<f64> {
        let robot = summary
            .robots
            .iter()
            .find(|(name, _)| name.as_str() == "Butler");
        let value = robot.and_then(|(_, robot)| robot.state_variables.get(variable)?.as_f64());
        value.ok_or_else(|| {
            let file = self.common.scenario.display();
            miette!(
                "{file}: it needs a robot called Butler that publishes {variable:?} as a number"
            )
        })
    }

    fn estimate(&self, outcomes: &[Outcome]) -> Vec<Cell> {
        let mut cells = Vec::new();
        for condition in self.conditions.iter().map(|condition| &condition.name) {
            for arm in ARMS.iter().map(|arm| arm.name) {
                let runs: Vec<&Outcome> = outcomes
                    .iter()
                    .filter(|run| run.condition == *condition && run.arm == arm)
                    .collect();
                let of = |value: fn(&Outcome) -> f64| {
                    Estimate::of(&runs.iter().map(|run| value(run)).collect::<Vec<_>>())
                };
                cells.push(Cell {
                    condition: condition.clone(),
                    arm,
                    exchanges: of(|run| run.exchanges),
                    during: of(|run| run.during),
                    after: of(|run| run.after),
                    empty_s: of(|run| run.empty_s),
                    messages: of(|run| run.messages),
                });
            }
        }
        cells
    }

    /// What is compared with what, in words.
    fn compared(&self) -> String {
        let Common {
            scenario,
            seeds,
            duration,
            ..
        } = self.common;
        let mut text = format!(
            "{}: {seeds} runs of {} s for each line, seeds 1 to {seeds}. Runs with the same seed begin alike\nand have the same chance, whatever the arm. {}\nMean and 95 % confidence interval over the seeds.\n\n",
            scenario.display(),
            duration.0,
            self.explained,
        );
        for arm in &ARMS {
            text += &format!("  {:<13} {}\n", arm.name, arm.what);
        }
        text
    }

    fn render(&self, cells: &[Cell]) -> String {
        let mut table = Builder::default();
        let mut head = vec![self.varied, "arm", "exchanges", "tray empty, s", "messages"];
        if self.tells_times {
            head.splice(3..3, ["of them during", "after"]);
        }
        table.push_record(head);
        let mut above = None;
        for cell in cells {
            let is_new = above.replace(&cell.condition) != Some(&cell.condition);
            let mut row = vec![
                if is_new {
                    cell.condition.clone()
                } else {
                    String::new()
                },
                cell.arm.to_owned(),
            ];
            let times = self.tells_times.then_some([cell.during, cell.after]);
            let values = [cell.exchanges]
                .into_iter()
                .chain(times.into_iter().flatten());
            row.extend(
                values
                    .chain([cell.empty_s, cell.messages])
                    .map(|estimate| estimate.to_string()),
            );
            table.push_record(row);
        }
        let mut table = table.build();
        table
            .with(Style::rounded())
            .modify(Columns::new(2..), Alignment::right());
        format!("{}\n{table}\n", self.compared())
    }
}

fn broken() -> miette::Report {
    miette!("a run ended in a panic; its message stands above")
}
