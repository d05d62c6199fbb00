//! `cars trace`: exports where the wall-clock time of a run went.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use lab::folder::{find, recorded_epoch};
use lab::trace::{Trace, TraceError};
use protocol::{Epoch, Tick};
use record::names::LATEST;

use crate::output::{Output, cannot_write};

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

    let path = args.output.as_deref();
    let mut output = Output::create(path)?;
    let notes = match trace.write(&mut output) {
        // The reader has closed its end of the pipe, as `head` does.
        Err(TraceError::Write(error)) if error.kind() == ErrorKind::BrokenPipe => Vec::new(),
        Err(TraceError::Write(error)) => return Err(cannot_write(path, &error)),
        written => {
            let notes = written?;
            output.finish()?;
            notes
        }
    };
    for note in notes {
        terminal::note(format_args!("note: {note}"));
    }
    Ok(ExitCode::SUCCESS)
}
