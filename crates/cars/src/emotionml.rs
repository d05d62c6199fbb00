//! `cars emotionml`: what the robots of a run felt, as EmotionML 1.0 (W3C Recommendation, 22 May 2014), for the tools of
//! people who study emotions.
//!
//! One `<emotion>` is one episode: the longest span of ticks in which a robot is in one emotion state. An `<emotion>` has
//! one set for each kind of descriptor, so that a name of this project and a name of W3C's vocabularies cannot both be
//! categories of it, and a second `<emotion>` with the same times would count every episode twice. So there are two views
//! of a run, with the same episodes under the same ids: the default speaks in the robots' own words, which the document
//! declares, each with what is nearest to it; `--standard` speaks in W3C's vocabularies alone.
//!
//! The run is read tick by tick and written episode by episode. What stays in memory is the episodes in progress: two
//! numbers a tick of each.

mod document;
mod episode;
mod source;
mod terms;

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use miette::miette;
use protocol::RobotName;
use simulator::RunFolder;

use crate::common::LATEST;
use document::Document;
use episode::Episodes;
use source::{Moment, Source};

/// `cars emotionml`.
#[derive(Debug, Args)]
pub(crate) struct EmotionmlArgs {
    /// A run by its name, or the folder of a run; without it the run that was started last.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// Only what this robot felt.
    #[arg(long, value_name = "NAME")]
    robot: Option<RobotName>,
    /// Name emotions and action tendencies by what is nearest in W3C's vocabularies, instead of the robots' own names.
    #[arg(long)]
    standard: bool,
    /// Where to write the document; without it to the terminal.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Exports the emotions of a run.
pub(crate) fn emotionml(args: &EmotionmlArgs) -> miette::Result<ExitCode> {
    let folder = find(args)?;
    let mut source = Source::open(&folder)?;
    let first = source
        .next()?
        .ok_or_else(|| miette!("{} holds no tick yet", source.path().display()))?;
    check_robot(args.robot.as_ref(), &first)?;
    match export(args, source, first) {
        // Whoever reads the document has seen enough of it.
        Err(Failure::Write(error)) if error.kind() == ErrorKind::BrokenPipe => {
            Ok(ExitCode::SUCCESS)
        }
        Err(Failure::Write(error)) => Err(miette!("the document cannot be written: {error}")),
        Err(Failure::Read(report)) => Err(report),
        Ok(()) => Ok(ExitCode::SUCCESS),
    }
}

/// Why a document stays incomplete; it then lacks its end, so that nobody takes it for the whole.
enum Failure {
    Read(miette::Report),
    Write(std::io::Error),
}

impl From<miette::Report> for Failure {
    fn from(report: miette::Report) -> Self {
        Self::Read(report)
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Write(error)
    }
}

fn export(args: &EmotionmlArgs, mut source: Source, first: Moment) -> Result<(), Failure> {
    let mut out = open_output(args.output.as_deref(), source.path())?;
    let roster = first
        .robots
        .iter()
        .map(|robot| robot.name.clone())
        .collect();
    let mut document = Document::begin(&mut out, source.facts().clone(), roster, args.standard)?;
    let mut episodes = Episodes::default();
    let mut moment = Some(first);
    while let Some(Moment { tick, robots }) = moment {
        let is_meant = |name: &RobotName| args.robot.as_ref().is_none_or(|only| only == name);
        for seen in robots.into_iter().filter(|seen| is_meant(&seen.name)) {
            if let Some(ended) = episodes.see(tick, seen) {
                document.emotion(&ended)?;
            }
        }
        moment = source.next()?;
    }
    for ended in episodes.end() {
        document.emotion(&ended)?;
    }
    document.end()?;
    Ok(out.flush()?)
}

/// The folder of the run: under `--out` by its name, or where it is said to be.
fn find(args: &EmotionmlArgs) -> miette::Result<RunFolder> {
    let folder = [args.out.join(&args.run), args.run.clone()]
        .into_iter()
        .find(|path| path.is_dir());
    folder.map(RunFolder::at).ok_or_else(|| {
        let (run, out) = (args.run.display(), args.out.display());
        if args.run == Path::new(LATEST) {
            return miette!(
                help = "name one, or start one with `cars run`",
                "no run is known in {out}"
            );
        }
        miette!(
            help = "give a run's name, with --out where its folder is elsewhere, or its folder",
            "there is no run {run}, neither in {out} nor as a folder"
        )
    })
}

fn check_robot(only: Option<&RobotName>, first: &Moment) -> miette::Result<()> {
    let names: Vec<&str> = first
        .robots
        .iter()
        .map(|robot| robot.name.as_str())
        .collect();
    match only {
        Some(only) if !names.contains(&only.as_str()) => Err(miette!(
            "no robot of this run is called {only}; there are {}",
            names.join(", ")
        )),
        _ => Ok(()),
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
            "{} is what is to be exported; choose another --output",
            output.display()
        ));
    }
    let file = File::create(output)
        .map_err(|error| miette!("cannot write {}: {error}", output.display()))?;
    Ok(Box::new(BufWriter::new(file)))
}

/// Says something that the document cannot say; the document itself may be on its way to another program.
fn note(text: &str) {
    eprintln!("note: {text}");
}
