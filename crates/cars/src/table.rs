//! The table at the end of a run.

use std::path::Path;

use lab::table::{HEAD, heading, held_up, rows};
use simulator::Summary;
use tabled::builder::Builder;
use tabled::settings::Style;

/// Prints the summary of a run.
pub(crate) fn print(summary: &Summary, folder: &Path) {
    let mut table = Builder::default();
    table.push_record(HEAD);
    for row in rows(summary) {
        table.push_record(row);
    }

    println!("\n{}", heading(summary));
    print!("{}", table.build().with(Style::rounded()));
    for line in held_up(summary) {
        print!("\n{line}");
    }
    println!("\n\nrecord: {}", folder.display());
}
