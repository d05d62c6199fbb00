//! The table at the end of a run.

use std::path::Path;

use lab::table::{HEAD, heading, held_up, rows, verdicts};
use record::Summary;
use tabled::builder::Builder;
use tabled::settings::Style;
use terminal::OutputError;

/// Prints the summary of a run.
///
/// # Errors
/// [`OutputError`] if the standard output cannot be written.
pub(crate) fn print(summary: &Summary, folder: &Path) -> Result<(), OutputError> {
    let mut table = Builder::default();
    table.push_record(HEAD);
    for row in rows(summary) {
        table.push_record(row);
    }

    let heading = heading(summary);
    let mut table = table.build();
    let table = table.with(Style::rounded());
    let mut text = format!("\n{heading}\n{table}");
    for line in verdicts(&summary.expectations) {
        text += &format!("\n{line}");
    }
    for line in held_up(summary) {
        text += &format!("\n{line}");
    }

    let folder = folder.display();
    terminal::print_line(format_args!("{text}\n\nrecord: {folder}"))
}
