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
    /// Ten runs of each case, not 50.
    #[arg(long)]
    quick: bool,
    /// The measured speeds by density that the model has to keep to.
    #[arg(long, value_name = "DATA", default_value = "weidmann")]
    against: DataArg,
    /// Only the cases with this text in their titles.
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
    /// The seed of all runs.
    #[arg(long, value_name = "N", default_value_t = 1)]
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
        Some(PossibleValue::new(match self.0 {
            SpeedData::Corridor => "corridor",
            SpeedData::Open => "open",
            SpeedData::Weidmann => "weidmann",
        }))
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
    let mut options = CheckOptions {
        threads,
        seed: args.seed,
        against: args.against.0,
        only: args.only.clone(),
        ..CheckOptions::default()
    };
    if args.quick {
        options.runs = QUICK_RUNS;
    }

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
            args.only
        ));
    }

    terminal::print_line(text(&rows))?;
    if rows.iter().all(|row| row.is_passed) {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

/// A table for each case, and the verdict.
fn text(rows: &[CheckedRow]) -> String {
    let mut text = String::new();
    for case in rows.chunk_by(|one, other| one.case == other.case) {
        let title = case[0].case;
        let runs = case[0].runs;
        let head = ["", "mean", "95 %", "published", "off by", "result"];
        let table = terminal::table(head, case.iter().map(cells), 1, 1);
        text += &format!("{title}, {runs} runs\n{table}\n\n");
    }

    let failed = rows.iter().filter(|row| !row.is_passed).count();
    let judged = rows.iter().filter(|row| row.requirement.is_some()).count();
    if failed == 0 {
        text + &format!("passed: all {judged} rows that are judged")
    } else {
        text + &format!("failed: {failed} of {judged} rows that are judged")
    }
}

fn cells(row: &CheckedRow) -> [String; 6] {
    let (low, high) = row.interval;
    let published = row.published.map(|published| format!("{published:.2}"));
    let off_by = row
        .published
        .map(|published| format!("{:+.2}", row.mean - published));
    let result = match (row.requirement, row.is_passed) {
        (None, _) => "",
        (_, true) => "ok",
        (_, false) => "FAIL",
    };
    [
        row.measure.clone(),
        format!("{:.2}", row.mean),
        format!("{low:.2} to {high:.2}"),
        published.unwrap_or_default(),
        off_by.unwrap_or_default(),
        result.to_owned(),
    ]
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
        let mut rows = KnownModel::CollisionFree.check(&options, &|_, _| {});
        assert!(text(&rows).ends_with("passed: all 3 rows that are judged"));
        rows[1].is_passed = false;
        let text = text(&rows);
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
