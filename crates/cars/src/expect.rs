//! `cars expect`: judges a recorded run.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use config::{Changes, Source};
use lab::folder::{find, recorded_epoch};
use lab::judge::judge;
use protocol::Epoch;
use protocol::messages::Verdict;
use record::names::LATEST;
use scenario::Scenario;
use scenario::expectations;

use crate::errors::Result;
use crate::table::verdicts;

/// `cars expect`.
#[derive(Debug, Args)]
pub(crate) struct ExpectArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// A file with the expectations, any file with `[[expect]]`; without it those of the run's scenario.
    #[arg(long, value_name = "FILE")]
    expectations: Option<PathBuf>,
    /// The epoch; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Judges a recorded run. The exit status is that of the verdict.
pub(crate) fn expect(args: &ExpectArgs) -> Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let files = recorded_epoch(&folder, args.epoch)?;
    let scenario = Scenario::load(&files.scenario, &Changes::default())?;
    let expected = match &args.expectations {
        Some(file) => expectations(&Source::read(file)?, &scenario.setting())?,
        None => scenario.expectations.clone(),
    };
    if expected.is_empty() {
        terminal::note(
            "nothing is expected of the run; --expectations names a file that has [[expect]]",
        );
    }

    let judged = judge(&files, &scenario, &expected)?;
    for line in verdicts(&judged.expectations) {
        terminal::print_line(line)?;
    }
    if !judged.has_end {
        terminal::note(format_args!(
            "note: the record goes to tick {}, and has no end of the run",
            judged.tick
        ));
    }

    let worst = judged.expectations.values().map(|judged| judged.verdict);
    let verdict = worst.max().unwrap_or(Verdict::Pass);
    Ok(ExitCode::from(verdict.exit_status()))
}
