//! `cars report`: writes a report for people as one HTML file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use experiments::PLAN;
use lab::folder::find;
use record::RunFolder;
use record::names::LATEST;
use reports::{of_experiment, of_runs};

use crate::errors::{Result, refusal};
use crate::output;

/// `cars report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Names or folders of runs, or of one experiment; without one the latest run.
    #[arg(value_name = "RUN|EXPERIMENT", default_value = LATEST)]
    subjects: Vec<PathBuf>,
    /// File of the report, HTML; without it the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Writes a report.
pub(crate) fn report(args: &ReportArgs) -> Result<ExitCode> {
    let mut folders = Vec::new();
    let page = match &args.subjects[..] {
        [subject] if let Some(experiment) = find_experiment(&args.out, subject) => {
            of_experiment(&experiment)?
        }
        subjects => {
            for subject in subjects {
                folders.push(find_run(&args.out, subject)?);
            }
            of_runs(&folders)?
        }
    };

    output::write(args.output.as_deref(), &page.finish())?;
    Ok(ExitCode::SUCCESS)
}

/// Finds the folder of an experiment by its path, or by its name under `out`.
fn find_experiment(out: &Path, subject: &Path) -> Option<PathBuf> {
    let candidates = [subject.to_owned(), out.join("experiments").join(subject)];
    candidates.into_iter().find(|path| path.join(PLAN).exists())
}

fn find_run(out: &Path, subject: &Path) -> Result<RunFolder> {
    if find_experiment(out, subject).is_some() {
        return Err(refusal!(
            help = "report it by itself",
            "{} is the folder of an experiment, and a report shows runs or one experiment",
            subject.display()
        ));
    }

    if subject.is_file() {
        return Err(refusal!(
            help = "play it first, with `cars run` or `cars experiment run`, and report the folder that it leaves",
            "{} is a file, and not the folder of a run or an experiment",
            subject.display()
        ));
    }

    Ok(find(out, subject)?)
}
