//! `cars export`: writes a run as files for other programs.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use export::{ExportError, emotionml, ros, shiviz, tables, trace, trajectories};
use lab::LabError;
use lab::folder::{find, recorded_epoch, recorded_epochs, recording, run_name};
use protocol::{Epoch, RobotName, Tick};
use record::names::LATEST;
use record::{EpochFiles, RunFolder};
use terminal::OutputError;

use crate::errors::{Result, refusal};
use crate::output::{Destination, cannot_write, check_no_record};

/// `cars export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    #[command(flatten)]
    format: ExportFormat,
    /// Folder of the tables, which is made if it does not exist; file of any other format, without it the standard output.
    #[arg(long, short, value_name = "PATH", required_if_eq("csv", "true"))]
    output: Option<PathBuf>,
    /// Export this epoch only. Without it, tables and ShiViz have all epochs, any other format the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// First tick of a trace; without it that of the epoch.
    #[arg(long, value_name = "TICK", requires = "trace")]
    from: Option<Tick>,
    /// Last tick of a trace; without it that of the epoch.
    #[arg(long, value_name = "TICK", requires = "trace")]
    to: Option<Tick>,
    /// Export the emotions of this robot only.
    #[arg(long, value_name = "NAME", requires = "emotionml")]
    robot: Option<RobotName>,
    /// Use the nearest terms of W3C's vocabularies instead of the robots' own names of emotions and action tendencies.
    #[arg(long, requires = "emotionml")]
    standard: bool,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// The format.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct ExportFormat {
    /// Tables of events, states and variables as CSV.
    #[arg(long)]
    csv: bool,
    /// The order that commands impose on what robots did, as a log for ShiViz.
    #[arg(long)]
    shiviz: bool,
    /// Where the wall-clock time went, as a trace that Perfetto and Chromium read.
    #[arg(long)]
    trace: bool,
    /// The emotions of the robots as EmotionML 1.0.
    #[arg(long)]
    emotionml: bool,
    /// Where guests and robots were, `id frame x/m y/m z/m` as PedPy and JuPedSim read it.
    #[arg(long)]
    trajectories: bool,
    /// A bag of ROS 2, a file of MCAP, with clock, transforms, odometry, guests, emotions and commands.
    #[arg(long)]
    ros: bool,
}

/// Exports a run.
pub(crate) fn export(args: &ExportArgs) -> Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    if let (true, Some(into)) = (args.format.csv, &args.output) {
        return write_tables(&args.epochs(&folder)?, into);
    }

    let path = args.output.as_deref();
    let mut output = Destination::create(path)?;
    let written = args.write(&folder, &mut output);
    let failure = written
        .as_ref()
        .err()
        .and_then(|error| error.downcast_ref());
    if let Some(ExportError::Write(error)) = failure {
        // The reader has closed its end of the pipe, as `head` does.
        if error.kind() == ErrorKind::BrokenPipe {
            return Ok(ExitCode::SUCCESS);
        }
        return Err(cannot_write(path, error));
    }
    let notes = written?;
    output.finish()?;
    // The output may be on its way to another program, so the notes go to the standard error.
    for note in notes {
        terminal::note(format_args!("note: {note}"));
    }
    Ok(ExitCode::SUCCESS)
}

fn write_tables(epochs: &[EpochFiles], into: &Path) -> Result<ExitCode> {
    // A log may be called what a table is called.
    for name in tables::FILES {
        check_no_record(&into.join(name))?;
    }
    let written = tables::write(epochs, into)?;
    for note in written.notes {
        terminal::note(format_args!("note: {note}"));
    }
    for file in written.files {
        OutputError::unless_closed(terminal::print_line(file.display()))?;
    }
    if !written.damage.is_empty() {
        return Err(refusal!(
            help = "everything else was exported",
            "{}",
            written.damage.join("\n")
        ));
    }
    Ok(ExitCode::SUCCESS)
}

impl ExportArgs {
    /// Writes any format but the tables. Returns what it leaves out, a sentence each.
    fn write(&self, folder: &RunFolder, out: &mut Destination) -> Result<Vec<String>> {
        if self.format.shiviz {
            shiviz::write(&self.epochs(folder)?, out)?;
            return Ok(Vec::new());
        }

        let files = recorded_epoch(folder, self.epoch)?;
        if self.format.trace {
            return Ok(trace::write(&recording(&files)?, self.from, self.to, out)?);
        }
        if self.format.trajectories {
            trajectories::write(recording(&files)?, out)?;
            return Ok(Vec::new());
        }
        if self.format.ros {
            ros::write(recording(&files)?, out)?;
            return Ok(Vec::new());
        }
        let run = run_name(folder);
        let robot = self.robot.as_ref();
        Ok(emotionml::write(&files, &run, robot, self.standard, out)?)
    }

    fn epochs(&self, folder: &RunFolder) -> Result<Vec<EpochFiles>, LabError> {
        match self.epoch {
            Some(_) => Ok(vec![recorded_epoch(folder, self.epoch)?]),
            None => recorded_epochs(folder),
        }
    }
}
