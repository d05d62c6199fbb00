//! `cars crowd`: models of walking, compared with what was measured with people.

use std::process::ExitCode;
use std::thread::available_parallelism;

use clap::builder::PossibleValue;
use clap::{Args, Subcommand, ValueEnum};
use crowd::checks::{CheckOptions, CheckedRow, KnownModel, SpeedData};
use indicatif::{ProgressBar, ProgressStyle};

use crate::errors::{Result, refusal};

/// Runs of a case with `--quick`, one of each population.
const QUICK_RUNS: usize = 10;

/// `cars crowd`.
#[derive(Debug, Subcommand)]
pub(crate) enum CrowdCommand {
    /// Play the cases of RiMEA and experiments with people with a model of walking, and compare.
    ///
    /// The exit status is 0 if the model passes all cases, and 1 if it fails one.
    Check(CrowdCheckArgs),
}

/// `cars crowd check`.
#[derive(Debug, Args)]
pub(crate) struct CrowdCheckArgs {
    /// The model.
    model: ModelArg,
    /// Ten runs of each case, one of each population.
    #[arg(long, conflicts_with = "runs")]
    quick: bool,
    /// Number of runs of each case. IMO MSC.1/Circ.1238 asks for 50.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    runs: u64,
    /// The measured speeds by density by which the model is judged. The table shows all three.
    #[arg(long, value_name = "DATA", default_value = "weidmann")]
    against: DataArg,
    /// Only the cases with this text in their titles.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// The seed of all runs. The parameters of `collision-free` were chosen with seed 1.
    #[arg(long, value_name = "N", default_value_t = 2)]
    seed: u64,
    /// Number of runs at the same time; without it the number of processors. The table does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
}

/// The name of a model.
#[derive(Debug, Clone, Copy)]
struct ModelArg(KnownModel);

impl ValueEnum for ModelArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [ModelArg; KnownModel::ALL.len()] = [
            ModelArg(KnownModel::CollisionFree),
            ModelArg(KnownModel::SocialForce),
        ];
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()))
    }
}

/// The name of a set of data.
#[derive(Debug, Clone, Copy)]
struct DataArg(SpeedData);

impl ValueEnum for DataArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [DataArg; SpeedData::ALL.len()] = [
            DataArg(SpeedData::Corridor),
            DataArg(SpeedData::Open),
            DataArg(SpeedData::Weidmann),
        ];
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self.0 {
            SpeedData::Corridor => PossibleValue::new("corridor")
                .help("Zhang 2012: a corridor of 1.8 m that leads back into itself"),
            SpeedData::Open => {
                PossibleValue::new("open").help("Zhang 2012: in one direction, with open ends")
            }
            SpeedData::Weidmann => {
                PossibleValue::new("weidmann").help("Weidmann 1993: a line over 25 authors")
            }
        })
    }
}

/// Runs a subcommand of `cars crowd`.
pub(crate) fn crowd(command: &CrowdCommand) -> Result<ExitCode> {
    match command {
        CrowdCommand::Check(args) => check(args),
    }
}

fn check(args: &CrowdCheckArgs) -> Result<ExitCode> {
    let threads = match args.jobs {
        Some(jobs) => jobs as usize,
        None => available_parallelism().map_or(1, usize::from),
    };
    let runs = if args.quick {
        QUICK_RUNS
    } else {
        args.runs as usize
    };
    let only = args.only.clone().unwrap_or_default();
    let options = CheckOptions {
        runs,
        threads,
        seed: args.seed,
        against: args.against.0,
        only: only.clone(),
        ..CheckOptions::default()
    };

    let style = ProgressStyle::with_template("{bar:30} {pos} of {len} runs, {elapsed}")?;
    let bar = ProgressBar::new(0).with_style(style);
    let rows = args.model.0.check(&options, &|over, all| {
        bar.set_length(all as u64);
        bar.set_position(over as u64);
    });
    bar.finish_and_clear();
    if rows.is_empty() {
        return Err(refusal!(
            help = "leave --only out to see all titles",
            "no case has {:?} in its title",
            only
        ));
    }

    terminal::print_line(text(args.model.0, args.against.0, &rows))?;
    if rows.iter().all(|row| row.is_passed) {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

/// Tables for each case, and the verdict.
fn text(model: KnownModel, against: SpeedData, rows: &[CheckedRow]) -> String {
    let mut text = String::new();
    for case in rows.chunk_by(|one, other| one.case == other.case) {
        text += &format!("{}, {} runs\n", case[0].case, case[0].runs);
        let (speeds, others): (Vec<_>, Vec<_>) =
            case.iter().partition(|row| row.measured_mps.is_some());
        if !speeds.is_empty() {
            text += &speed_table(model, against, &speeds);
        }
        let head = ["", "mean", "95 %", "published", "off by", "result"];
        let table = terminal::table(head, others.into_iter().map(cells), 1, 1);
        text += &format!("{table}\n\n");
    }

    let failed = rows.iter().filter(|row| !row.is_passed).count();
    let judged = rows.iter().filter(|row| row.requirement.is_some()).count();
    if failed == 0 {
        text + &format!("passed: all {judged} rows that are judged")
    } else {
        text + &format!("failed: {failed} of {judged} rows that are judged")
    }
}

/// Speeds by density beside the sets of data.
fn speed_table(model: KnownModel, against: SpeedData, rows: &[&CheckedRow]) -> String {
    let [corridor, open, weidmann] = SpeedData::ALL.map(SpeedData::name);
    let head = ["per m²", "mean", "95 %", corridor, open, weidmann, "result"];
    let table = terminal::table(head, rows.iter().map(|row| speed_cells(row)), 1, 1);
    let calibrated = match model.calibrated_to() {
        Some(data) => format!("calibrated to {}", data.name()),
        None => "not calibrated to any of them".to_owned(),
    };
    format!(
        "Speed by density, m/s, and how far the mean is from three sets of data.\n\
         {} is {calibrated}, and judged by {}.\n{table}\n",
        model.name(),
        against.name()
    )
}

fn speed_cells(row: &CheckedRow) -> [String; 7] {
    let density = row.measure.trim_start_matches("speed at ");
    let beside = |measured_mps: f64| format!("{measured_mps:.2} {:+.2}", row.mean - measured_mps);
    let [corridor, open, weidmann] = row.measured_mps.unwrap_or_default().map(beside);
    [
        density.trim_end_matches("/m², m/s").to_owned(),
        number(row.mean),
        interval(row),
        corridor,
        open,
        weidmann,
        result(row).to_owned(),
    ]
}

fn cells(row: &CheckedRow) -> [String; 6] {
    let published = row.published.map(|published| format!("{published:.2}"));
    let off_by = row
        .published
        .map(|published| format!("{:+.2}", row.mean - published));
    [
        row.measure.clone(),
        number(row.mean),
        interval(row),
        published.unwrap_or_default(),
        off_by.unwrap_or_default(),
        result(row).to_owned(),
    ]
}

fn interval(row: &CheckedRow) -> String {
    let (low, high) = row.interval;
    format!("{} to {}", number(low), number(high))
}

fn number(value: f64) -> String {
    let decimals = if value.abs() < 100.0 { 2 } else { 1 };
    let text = format!("{value:.decimals$}");
    if text == "-0.00" {
        "0.00".to_owned()
    } else {
        text
    }
}

fn result(row: &CheckedRow) -> &'static str {
    match (row.requirement, row.is_passed) {
        (None, _) => "",
        (_, true) => "ok",
        (_, false) => "FAIL",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_fails_is_marked_and_counted() {
        let options = CheckOptions {
            runs: 1,
            only: "RiMEA 1,".to_owned(),
            ..CheckOptions::default()
        };
        let model = KnownModel::CollisionFree;
        let mut rows = model.check(&options, &|_, _| {});
        let passed = text(model, SpeedData::Weidmann, &rows);
        assert!(passed.ends_with("passed: all 3 rows that are judged"));
        rows[1].is_passed = false;
        let text = text(model, SpeedData::Weidmann, &rows);
        assert!(text.contains("FAIL"), "{text}");
        assert!(
            text.ends_with("failed: 1 of 3 rows that are judged"),
            "{text}"
        );
        assert!(
            text.lines().all(|line| line.chars().count() <= 80),
            "{text}"
        );
    }
}
