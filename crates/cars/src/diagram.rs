//! `cars diagram`: draws the space-time diagram of a run.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use lab::folder::{find, recorded_epoch, recorded_epochs};
use lab::moment::Moment;
use protocol::Epoch;
use record::names::LATEST;
use reports::decisions;
use reports::diagram::{DiagramOptions, Window, draw};

use crate::errors::Result;
use crate::output;

/// `cars diagram`.
#[derive(Debug, Args)]
pub(crate) struct DiagramArgs {
    /// Name or folder of a run; without it the latest run.
    #[arg(default_value = LATEST)]
    run: PathBuf,
    /// First moment to draw: a tick such as 240, or a time such as "120 s". Default: the beginning.
    #[arg(long, value_name = "TICK|TIME")]
    from: Option<Moment>,
    /// Last moment to draw. Default: the end.
    #[arg(long, value_name = "TICK|TIME")]
    to: Option<Moment>,
    /// Draw lost queries, too.
    #[arg(long)]
    queries: bool,
    /// Draw time in which nothing happens to scale, too. In a wide window it is a narrow gap otherwise.
    #[arg(long)]
    whole: bool,
    /// The epoch; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// File of the picture, SVG; without it the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Draws a run.
pub(crate) fn diagram(args: &DiagramArgs) -> Result<ExitCode> {
    let folder = find(&args.out, &args.run)?;
    let files = recorded_epoch(&folder, args.epoch)?;
    let mut title = folder.title();
    if recorded_epochs(&folder)?.len() > 1 {
        title += &format!(", epoch {}", files.epoch);
    }
    let decided = decisions(&folder, &files)?;
    let options = DiagramOptions {
        title,
        decisions: decided.all,
        queries: args.queries,
        is_whole: args.whole,
        ..DiagramOptions::default()
    };
    let window = Window {
        from: args.from,
        to: args.to,
    };

    let drawn = draw(&files, window, options)?;
    output::write(args.output.as_deref(), &drawn.svg)?;
    // The picture may be on its way to another program, so the notes go to the standard error.
    for note in drawn.notes.into_iter().chain(decided.notes) {
        terminal::note(format_args!("note: {note}"));
    }
    Ok(ExitCode::SUCCESS)
}
