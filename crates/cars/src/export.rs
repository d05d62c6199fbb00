//! `cars export`: exports a run for other programs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use lab::export::sheet::Format;
use lab::export::{Wanted, export as export_epochs};
use lab::folder::{find, recorded_epoch, recorded_epochs};
use miette::miette;
use protocol::Epoch;
use terminal::OutputError;

/// `cars export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Name of the run, or its folder.
    run: PathBuf,
    #[command(flatten)]
    formats: Formats,
    /// Folder of the files, which is made if it does not exist. Files of an earlier export are replaced.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Export this epoch only.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// The formats, of which there may be several.
#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
struct Formats {
    /// Tables of events, states and variables as CSV.
    #[arg(long)]
    csv: bool,
    /// The same tables as Parquet.
    #[arg(long)]
    parquet: bool,
    /// The order that commands impose on what robots did, as a log for ShiViz.
    #[arg(long)]
    shiviz: bool,
}

/// Exports a run.
pub(crate) fn export(args: &ExportArgs) -> miette::Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let epochs = match args.epoch {
        Some(_) => vec![recorded_epoch(&folder, args.epoch)?],
        None => recorded_epochs(&folder)?,
    };
    let mut tables = Vec::new();
    if args.formats.csv {
        tables.push(Format::Csv);
    }
    if args.formats.parquet {
        tables.push(Format::Parquet);
    }
    let wanted = Wanted {
        tables,
        has_shiviz: args.formats.shiviz,
    };

    let exported = export_epochs(&epochs, &args.output, &wanted)?;
    for note in exported.notes {
        terminal::note(format_args!("note: {note}"));
    }
    for file in exported.files {
        OutputError::unless_closed(terminal::print_line(file.display()))?;
    }
    if !exported.damage.is_empty() {
        return Err(miette!(
            help = "everything else was exported",
            "{}",
            exported.damage.join("\n")
        ));
    }
    Ok(ExitCode::SUCCESS)
}
