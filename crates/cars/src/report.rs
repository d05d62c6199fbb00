//! `cars report`: writes a report for people as one HTML file, and its figures for papers.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use experiments::PLAN;
use export::draft::{Draft, unwritable};
use lab::folder::find;
use record::RunFolder;
use record::names::LATEST;
use reports::{Page, WIDTHS_MM, of_experiment, of_runs};
use terminal::OutputError;

use crate::errors::{Result, refusal};
use crate::output;

/// `cars report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Names or folders of runs, or of one experiment; without one the latest run.
    #[arg(value_name = "RUN|EXPERIMENT", default_value = LATEST)]
    subjects: Vec<PathBuf>,
    /// File of the report, HTML; without it, and without --figures, the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Folder for each figure as SVG and PDF, its data as CSV and a Vega-Lite specification. It is made, or empty.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Replace figures of an earlier report in the folder.
    #[arg(long, requires = "figures")]
    replace: bool,
    /// Width of figures, from 86 to 400; those with long axes have at least 180. Default: 88 or 180, by the figure.
    #[arg(long, value_name = "MM", requires = "figures")]
    width_mm: Option<f64>,
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

    if let Some(folder) = &args.figures {
        write_figures(&page, folder, args)?;
    }
    if args.figures.is_none() || args.output.is_some() {
        output::write(args.output.as_deref(), &page.finish())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the figures of a page into a folder, and prints what they are. All files are complete before the first of them gets its name.
fn write_figures(page: &Page, folder: &Path, args: &ReportArgs) -> Result<()> {
    if let Some(mm) = args.width_mm
        && !WIDTHS_MM.contains(&mm)
    {
        return Err(refusal!(
            "--width-mm {mm}: a figure is from {} to {} mm wide",
            WIDTHS_MM.start(),
            WIDTHS_MM.end()
        ));
    }
    let figures = page.print_figures(args.width_mm);
    let mut files = Vec::new();
    for (name, figure) in &figures {
        let is_one = figure.pictures.len() == 1;
        for (index, picture) in figure.pictures.iter().enumerate() {
            let name = match is_one {
                true => name.clone(),
                false => format!("{name}-{}", index + 1),
            };
            files.push((format!("{name}.svg"), picture.svg.as_bytes()));
            files.push((format!("{name}.pdf"), &picture.pdf));
        }
        files.push((format!("{name}.csv"), figure.csv.as_bytes()));
        files.push((format!("{name}.vl.json"), figure.spec.as_bytes()));
    }

    let is_new = !folder.exists();
    if is_new {
        std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    }
    let written = write_files(folder, &files, args.replace);
    if written.is_err() && is_new {
        // Nothing but drafts was in it, which are removed; if it cannot be removed, the error to report is the first one.
        let _empty = std::fs::remove_dir(folder);
    }
    written?;

    for (name, figure) in &figures {
        let count = figure.pictures.len();
        let pictures = if count == 1 {
            String::new()
        } else {
            format!(", {count} pictures")
        };
        let mm = figure.width_mm;
        let wider = match args.width_mm {
            Some(wanted) if wanted < mm => ": narrower, its letters would be too small",
            _ => "",
        };
        let path = folder.join(name);
        OutputError::unless_closed(terminal::print_line(format_args!(
            "{}: {mm} mm{pictures}{wider}",
            path.display()
        )))?;
    }
    Ok(())
}

fn write_files(folder: &Path, files: &[(String, &[u8])], replaces: bool) -> Result<()> {
    let mut entries = std::fs::read_dir(folder).map_err(|error| unwritable(folder, &error))?;
    if !replaces && entries.next().is_some() {
        return Err(refusal!(
            help = "name another folder, or replace the figures in it with --replace",
            "{} is not empty",
            folder.display()
        ));
    }

    let mut drafts = Vec::new();
    for (name, bytes) in files {
        let path = folder.join(name);
        output::check_no_record(&path)?;
        let mut draft = Draft::create(&path)?;
        draft
            .write_all(bytes)
            .map_err(|error| unwritable(&path, &error))?;
        drafts.push(draft);
    }
    for draft in drafts {
        draft.publish()?;
    }
    Ok(())
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
