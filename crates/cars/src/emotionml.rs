//! `cars emotionml`: exports the emotions of a run's robots as EmotionML 1.0.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use lab::emotionml::{Export, ExportError, View};
use lab::folder::find;
use miette::miette;
use protocol::RobotName;
use simulator::recorder::LATEST;

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
    let mut out = open_output(args.output.as_deref(), export.path())?;
    match export.write(&mut out, view) {
        Ok(notes) => {
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
        Err(ExportError::Write(error)) => Err(miette!("the document cannot be written: {error}")),
        Err(ExportError::Read(report)) => Err(report),
    }
}

fn open_output(output: Option<&Path>, source: &Path) -> miette::Result<Box<dyn Write>> {
    let Some(output) = output else {
        return Ok(Box::new(BufWriter::new(std::io::stdout())));
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

    let file = File::create(output)
        .map_err(|error| miette!("cannot write {}: {error}", output.display()))?;

    Ok(Box::new(BufWriter::new(file)))
}
