//! `cars experiment`: plays experiments over many seeds and prints tables with confidence intervals.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use config::Override;
use config::units::Time;
use indicatif::{ProgressBar, ProgressStyle};
use lab::experiment::{
    Cell, Conditions, Contrast, Experiment, Factor, Kind, Measure, Options, Value,
};
use lab::statistics::MIN_SAMPLE;
use miette::{IntoDiagnostic, miette};
use tabled::builder::Builder;
use tabled::settings::object::Columns;
use tabled::settings::{Alignment, Style};

/// `cars experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    experiment: Which,
}

#[derive(Debug, Subcommand)]
enum Which {
    /// Compare emotions with rules, with a timer, with neither, and with emotions of another run, under failures of messages,
    /// of the refiller, and of the way between the robots.
    Affect(AffectArgs),
    /// Lose commands and compare teams with emotions, rules, a timer, or neither.
    ///
    /// The problem of Murphy, Lisetti et al. 2002: two robots that depend on each other deadlock when one message is
    /// lost, unless something makes them act.
    Deadlock(DeadlockArgs),
    /// Block commands and queries between the two robots for a time and compare how the teams work on and recover.
    Partition(PartitionArgs),
    /// Play an experiment file.
    Run(FileArgs),
}

/// Options of all experiments.
#[derive(Debug, Args)]
struct Common {
    /// Scenario; without it, that of the experiment's file.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Number of runs of each arm and condition, with the seeds 1, 2, 3 and so on; without it, that of the experiment's file.
    #[arg(long, value_parser = clap::value_parser!(u64).range(MIN_SAMPLE..=100_000))]
    seeds: Option<u64>,
    /// Simulated time of each run; without it, that of the experiment's file.
    #[arg(long, value_name = "TIME")]
    duration: Option<Time>,
    /// Number of runs at the same time; without it the number of processors. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// A change of the scenario in every arm, for example `guests.count=50`. It must not be one that an arm or a condition
    /// makes.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Print JSON: every run, every estimate and every difference.
    #[arg(long)]
    json: bool,
}

/// `cars experiment affect`.
#[derive(Debug, Args)]
pub(crate) struct AffectArgs {
    #[command(flatten)]
    common: Common,
}

/// `cars experiment run`.
#[derive(Debug, Args)]
pub(crate) struct FileArgs {
    /// Experiment file, such as those in `configs/experiments`.
    file: PathBuf,
    #[command(flatten)]
    common: Common,
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
    /// Durations of the partition, which ends within the run.
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
    let own_options = args.experiment.own_options();
    let (mut experiment, common) = args.experiment.load()?;
    let is_json = common.json;
    let options = common.options(&mut experiment);
    if let Err(error) = experiment.list_conditions() {
        return Err(miette!(help = format!("change {own_options}"), "{error}"));
    }

    let style =
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {eta} left").into_diagnostic()?;
    let bar = ProgressBar::new(experiment.runs(&options)?).with_style(style);
    let outcomes = experiment.play(&options, &|| bar.inc(1))?;
    bar.finish_and_clear();

    let cells = experiment.estimate(&outcomes)?;
    let contrasts = experiment.contrast(&outcomes);
    let compared = experiment.compared(&options)?;
    if is_json {
        let all = serde_json::json!({
            "compared": compared,
            "runs": outcomes,
            "estimates": cells,
            "contrasts": contrasts,
        });
        let all = serde_json::to_string_pretty(&all).into_diagnostic()?;
        terminal::data(format_args!("{all}\n"))?;
        return Ok(ExitCode::SUCCESS);
    }

    let table = render(&experiment, &cells);
    terminal::print(format_args!("{compared}\n{table}\n"))?;
    if let Some(contrast) = contrasts.first() {
        let baseline = &contrast.baseline;
        let table = render_contrasts(&experiment, &contrasts);
        terminal::print(format_args!(
            "\nDifference to \"{baseline}\", paired by seed: mean and 95 % confidence interval.\n\n{table}\n"
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl Which {
    /// The options that decide about the conditions, in words.
    fn own_options(&self) -> &'static str {
        match self {
            Self::Deadlock(_) => "--loss",
            Self::Partition(_) => "--from, --lasting or --duration",
            Self::Affect(_) | Self::Run(_) => "--duration",
        }
    }

    /// The experiment with the changes of its own options.
    fn load(self) -> miette::Result<(Experiment, Common)> {
        match self {
            Self::Affect(args) => Ok((shipped("affect")?, args.common)),
            Self::Deadlock(args) => args.experiment(),
            Self::Partition(args) => args.experiment(),
            Self::Run(args) => Ok((Experiment::load(&args.file)?, args.common)),
        }
    }
}

/// An experiment that ships with the project.
fn shipped(name: &str) -> miette::Result<Experiment> {
    let experiment = Experiment::shipped(name)?;
    experiment.ok_or_else(|| miette!("no experiment {name} ships with the project"))
}

/// The factor of a shipped experiment.
fn factor(experiment: &mut Experiment) -> miette::Result<&mut Factor> {
    match &mut experiment.conditions {
        Conditions::Factor(factor) => Ok(factor),
        Conditions::Named(_) => Err(miette!("the experiment has no factor")),
    }
}

impl DeadlockArgs {
    fn experiment(self) -> miette::Result<(Experiment, Common)> {
        let mut losses = self.loss;
        losses.sort_by(f64::total_cmp);
        let mut experiment = shipped("deadlock")?;
        factor(&mut experiment)?.values = losses.into_iter().map(Value::Number).collect();
        Ok((experiment, self.common))
    }
}

impl PartitionArgs {
    fn experiment(self) -> miette::Result<(Experiment, Common)> {
        let mut experiment = shipped("partition")?;
        let factor = factor(&mut experiment)?;
        factor.begins_s = Some(self.from.0);
        factor.values = Vec::new();
        for lasting in self.lasting {
            factor.values.push(Value::Time(lasting.0));
        }
        Ok((experiment, self.common))
    }
}

impl Common {
    /// The options of an experiment, whose duration they may change.
    fn options(self, experiment: &mut Experiment) -> Options {
        if let Some(duration) = self.duration {
            experiment.duration_s = duration.0;
        }
        let jobs = match self.jobs {
            Some(jobs) => jobs as usize,
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };

        Options {
            scenario: self.scenario.unwrap_or_else(|| experiment.scenario.clone()),
            seeds: self.seeds.unwrap_or(experiment.seeds),
            jobs,
            set: self.set,
        }
    }
}

/// The estimates as a table with one line for each arm under each condition.
fn render(experiment: &Experiment, cells: &[Cell]) -> tabled::Table {
    let mut head = vec![experiment.conditions.head().to_owned(), "arm".to_owned()];
    for measure in &experiment.measures {
        if let Some(column) = &measure.column {
            head.push(column.clone());
            if is_event(measure) {
                head.push("median time to it, s".to_owned());
            }
        }
    }

    let mut rows = Vec::new();
    for cell in cells {
        let mut row = vec![cell.condition.clone(), cell.arm.clone()];
        for measure in &experiment.measures {
            if measure.column.is_none() {
                continue;
            }
            match cell.times.get(&measure.name) {
                Some(times) => {
                    row.push(format!("{} of {}", times.events, times.n));
                    row.push(times.to_string());
                }
                None => row.push(cell.measures[&measure.name].to_string()),
            }
        }
        rows.push(row);
    }
    table(head, rows)
}

/// The differences to the baseline as a table; shares are in percentage points.
fn render_contrasts(experiment: &Experiment, contrasts: &[Contrast]) -> tabled::Table {
    let mut head = vec![experiment.conditions.head().to_owned(), "arm".to_owned()];
    for measure in &experiment.measures {
        if measure.contrast {
            let column = measure.column.as_ref().unwrap_or(&measure.name);
            let unit = if is_event(measure) {
                ", % of the runs"
            } else {
                ""
            };
            head.push(format!("{column}{unit}"));
        }
    }
    head.push("n".to_owned());

    let mut rows = Vec::new();
    for contrast in contrasts {
        let mut row = vec![contrast.condition.clone(), contrast.arm.clone()];
        let mut n = 0;
        for measure in &experiment.measures {
            let Some(difference) = contrast.differences.get(&measure.name) else {
                continue;
            };
            n = difference.n;
            let scale = if is_event(measure) { 100.0 } else { 1.0 };
            let mean = difference.mean * scale;
            let half_width = difference.half_width * scale;
            row.push(format!("{mean:+.1} \u{b1} {half_width:.1}"));
        }
        row.push(n.to_string());
        rows.push(row);
    }
    table(head, rows)
}

/// Whether a measure is an event that a run has or has not.
fn is_event(measure: &Measure) -> bool {
    matches!(measure.kind, Kind::Stalled(_))
}

/// A table whose first column names a condition in its first line only.
fn table(head: Vec<String>, rows: Vec<Vec<String>>) -> tabled::Table {
    let mut table = Builder::default();
    table.push_record(head);
    let mut above = String::new();
    for mut row in rows {
        if row[0] == above {
            row[0].clear();
        } else {
            above.clone_from(&row[0]);
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
        for name in ["affect", "deadlock", "partition"] {
            let line = Line::try_parse_from(["experiment", name]).unwrap();
            let (mut played, common) = line.args.experiment.load().unwrap();
            let options = common.options(&mut played);

            let file = Experiment::shipped(name).unwrap().unwrap();
            let duration_s = file.duration_s;
            assert_eq!(
                played.conditions.list(duration_s).unwrap(),
                file.conditions.list(duration_s).unwrap(),
                "{name}"
            );
            assert_eq!(played.duration_s, duration_s, "{name}");
            assert_eq!(options.seeds, file.seeds, "{name}");
            assert_eq!(options.scenario, file.scenario, "{name}");
        }
    }
}
