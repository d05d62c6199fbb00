//! `cars trace`: exports where the wall-clock time of a run went.

use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use lab::export::draft::Draft;
use lab::folder::{find, recorded_epoch};
use lab::trace::{Trace, TraceError};
use miette::miette;
use protocol::{Epoch, Tick};
use simulator::EpochFiles;
use simulator::recorder::LATEST;

use crate::output::check_not_record;

/// `cars trace`.
#[derive(Debug, Args)]
pub(crate) struct TraceArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// File of the trace; without it the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The epoch; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// The first tick; without it that of the epoch.
    #[arg(long, value_name = "TICK")]
    from: Option<Tick>,
    /// The last tick; without it that of the epoch.
    #[arg(long, value_name = "TICK")]
    to: Option<Tick>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Exports the wall-clock times of a run.
pub(crate) fn trace(args: &TraceArgs) -> miette::Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let files = recorded_epoch(&folder, args.epoch)?;
    let trace = Trace::open(&files, args.from, args.to)?;

    let notes = match &args.output {
        Some(path) => write_file(&trace, &files, path)?,
        None => write_output(&trace)?,
    };
    for note in notes {
        terminal::note(format_args!("note: {note}"));
    }
    Ok(ExitCode::SUCCESS)
}

fn write_file(trace: &Trace, files: &EpochFiles, path: &Path) -> miette::Result<Vec<String>> {
    check_not_record(path, files)?;

    let mut draft = Draft::create(path)?;
    let notes = trace.write(&mut draft).map_err(|error| match error {
        TraceError::Write(error) => miette!("cannot write {}: {error}", path.display()),
        error @ TraceError::Read(_) => error.into(),
    })?;
    draft.publish()?;
    Ok(notes)
}

fn write_output(trace: &Trace) -> miette::Result<Vec<String>> {
    let mut out = BufWriter::new(std::io::stdout());
    match trace.write(&mut out) {
        // The reader has closed its end of the pipe, as `head` does.
        Err(TraceError::Write(error)) if error.kind() == ErrorKind::BrokenPipe => Ok(Vec::new()),
        written => Ok(written?),
    }
}
