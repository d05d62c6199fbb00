//! `cars experiment`: runs the shipped experiments over many seeds and prints tables with confidence intervals.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use config::Override;
use config::units::Time;
use indicatif::{ProgressBar, ProgressStyle};
use lab::experiment::{Cell, Experiment, Options, Value};
use lab::statistics::MIN_SAMPLE;
use miette::{IntoDiagnostic, miette};
use tabled::builder::Builder;
use tabled::settings::object::Columns;
use tabled::settings::{Alignment, Style};

/// `cars experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    experiment: Shipped,
}

#[derive(Debug, Subcommand)]
enum Shipped {
    /// Lose commands and compare teams without emotions, with a timer, with emotions, and with both.
    ///
    /// The problem of Murphy, Lisetti et al. 2002: two robots that depend on each other deadlock when one message is
    /// lost, unless a timer or an emotion makes them act.
    Deadlock(DeadlockArgs),
    /// Block commands and queries between the two robots for a time and compare how the teams work on and recover.
    Partition(PartitionArgs),
}

/// Options of all experiments.
#[derive(Debug, Args)]
struct Common {
    /// Scenario with a Butler and a Leguin.
    #[arg(
        long,
        default_value = "configs/hors_doeuvres.toml",
        value_name = "FILE"
    )]
    scenario: PathBuf,
    /// Number of runs of each arm and condition, with the seeds 1, 2, 3 and so on.
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u64).range(MIN_SAMPLE..=100_000))]
    seeds: u64,
    /// Simulated time of each run.
    #[arg(long, default_value = "600 s", value_name = "TIME")]
    duration: Time,
    /// Number of runs at the same time; without it the number of processors. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// A change of the scenario in every arm, for example `guests.count=50`.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Print JSON: every run and every estimate.
    #[arg(long)]
    json: bool,
}

/// `cars experiment deadlock`.
#[derive(Debug, Args)]
pub(crate) struct DeadlockArgs {
    /// Probabilities of losing a command.
    #[arg(long, value_delimiter = ',', default_value = "0,0.1,0.25,0.5,1", value_parser = probability)]
    loss: Vec<f64>,
    #[command(flatten)]
    common: Common,
}

/// `cars experiment partition`.
#[derive(Debug, Args)]
pub(crate) struct PartitionArgs {
    /// Beginning of the partition.
    #[arg(long, default_value = "120 s", value_name = "TIME")]
    from: Time,
    /// Durations of the partition.
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

fn probability(text: &str) -> Result<f64, String> {
    let value = text
        .parse()
        .ok()
        .filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| format!("{text:?} is not a probability, a number from 0 to 1"))
}

/// Runs an experiment and prints its estimates.
pub(crate) fn experiment(args: ExperimentArgs) -> miette::Result<ExitCode> {
    let (experiment, common) = match args.experiment {
        Shipped::Deadlock(args) => args.experiment()?,
        Shipped::Partition(args) => args.experiment()?,
    };
    let is_json = common.json;
    let options = common.options();

    let style =
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {eta} left").into_diagnostic()?;
    let bar = ProgressBar::new(experiment.runs(&options)).with_style(style);
    let outcomes = experiment.play(&options, &|| bar.inc(1))?;
    bar.finish_and_clear();

    let cells = experiment.estimate(&outcomes);
    let compared = experiment.compared(&options);
    if is_json {
        let all = serde_json::json!({ "compared": compared, "runs": outcomes, "estimates": cells });
        let all = serde_json::to_string_pretty(&all).into_diagnostic()?;
        terminal::data(format_args!("{all}\n"))?;
    } else {
        let table = render(&experiment, &cells);
        terminal::print(format_args!("{compared}\n{table}\n"))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// An experiment that ships with the project.
fn shipped(name: &str, common: &Common) -> miette::Result<Experiment> {
    let experiment = Experiment::shipped(name)?;
    let mut experiment =
        experiment.ok_or_else(|| miette!("no experiment {name} ships with the project"))?;
    experiment.duration_s = common.duration.0;
    Ok(experiment)
}

impl DeadlockArgs {
    fn experiment(self) -> miette::Result<(Experiment, Common)> {
        let mut losses = self.loss;
        losses.sort_by(f64::total_cmp);
        let mut experiment = shipped("deadlock", &self.common)?;
        experiment.factor.values = losses.into_iter().map(Value::Number).collect();
        Ok((experiment, self.common))
    }
}

impl PartitionArgs {
    fn experiment(self) -> miette::Result<(Experiment, Common)> {
        let mut experiment = shipped("partition", &self.common)?;
        experiment.factor.begins_s = Some(self.from.0);
        experiment.factor.values = Vec::new();
        for lasting in self.lasting {
            experiment.factor.values.push(Value::Time(lasting.0));
        }
        Ok((experiment, self.common))
    }
}

impl Common {
    fn options(self) -> Options {
        let jobs = match self.jobs {
            Some(jobs) => jobs as usize,
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        Options {
            scenario: self.scenario,
            seeds: self.seeds,
            jobs,
            set: self.set,
        }
    }
}

/// The estimates as a table with one line for each arm under each condition.
fn render(experiment: &Experiment, cells: &[Cell]) -> tabled::Table {
    let mut table = Builder::default();
    let columns = experiment.measures.iter();
    let columns = columns.filter_map(|measure| measure.column.clone());
    let mut head = vec![experiment.factor.name.clone(), "arm".to_owned()];
    head.extend(columns);
    table.push_record(head);
    let mut above = None;
    for cell in cells {
        // A condition is named in its first line only.
        let is_new = above.replace(&cell.condition) != Some(&cell.condition);
        let condition = if is_new { cell.condition.as_str() } else { "" };
        let mut row = vec![condition.to_owned(), cell.arm.clone()];
        for measure in &experiment.measures {
            if measure.column.is_some() {
                row.push(cell.measures[&measure.name].to_string());
            }
        }
        table.push_record(row);
    }

    let mut table = table.build();
    table
        .with(Style::rounded())
        .modify(Columns::new(2..), Alignment::right());
    table
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: ExperimentArgs,
    }

    #[test]
    fn the_defaults_of_the_command_line_are_those_of_the_files() {
        for name in ["deadlock", "partition"] {
            let line = Line::try_parse_from(["experiment", name]).unwrap();
            let (played, common) = match line.args.experiment {
                Shipped::Deadlock(args) => args.experiment().unwrap(),
                Shipped::Partition(args) => args.experiment().unwrap(),
            };
            let file = Experiment::shipped(name).unwrap().unwrap();
            assert_eq!(played.factor.values, file.factor.values, "{name}");
            assert_eq!(played.factor.begins_s, file.factor.begins_s, "{name}");
            assert_eq!(played.duration_s, file.duration_s, "{name}");
            assert_eq!(common.seeds, file.seeds, "{name}");
        }
    }
}
