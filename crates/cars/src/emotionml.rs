//! `cars emotionml`: exports the emotions of a run's robots as EmotionML 1.0.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use lab::emotionml::{Export, ExportError, View};
use lab::folder::find;
use miette::miette;
use protocol::RobotName;
use record::names::LATEST;

use crate::output::{Output, cannot_write};

/// `cars emotionml`.
#[derive(Debug, Args)]
pub(crate) struct EmotionmlArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// Export the emotions of this robot only.
    #[arg(long, value_name = "NAME")]
    robot: Option<RobotName>,
    /// Use the nearest terms of W3C's vocabularies instead of the robots' own names of emotions and action tendencies.
    #[arg(long)]
    standard: bool,
    /// File of the document; without it the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Exports the emotions of a run.
pub(crate) fn emotionml(args: EmotionmlArgs) -> miette::Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let view = if args.standard {
        View::Standard
    } else {
        View::Own
    };

    let export = Export::open(&folder, args.robot)?;
    let path = args.output.as_deref();
    check_not_source(path, export.path())?;
    let mut out = Output::create(path)?;
    match export.write(&mut out, view) {
        Ok(notes) => {
            out.finish()?;
            // The document may be on its way to another program, so the notes go to the standard error.
            for note in notes {
                terminal::note(format_args!("note: {note}"));
            }
            Ok(ExitCode::SUCCESS)
        }
        // The reader has closed its end of the pipe, as `head` does.
        Err(ExportError::Write(error)) if error.kind() == ErrorKind::BrokenPipe => {
            Ok(ExitCode::SUCCESS)
        }
        Err(ExportError::Write(error)) => Err(cannot_write(path, &error)),
        Err(ExportError::Read(report)) => Err(report),
    }
}

fn check_not_source(output: Option<&Path>, source: &Path) -> miette::Result<()> {
    let Some(output) = output else {
        return Ok(());
    };

    let is_source = output
        .canonicalize()
        .is_ok_and(|path| source.canonicalize().is_ok_and(|own| own == path));
    if is_source {
        return Err(miette!(
            "{} is the record of the run; choose another --output",
            output.display()
        ));
    }
    Ok(())
}
