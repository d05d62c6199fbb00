//! `cars man`: writes the manual pages of all programs.

use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};

use clap::{Args, Command};
use clap_mangen::Man;
use export::draft::{self, unwritable};
use launch::{SIBLINGS, find_sibling};
use terminal::MAN_PAGE;

use crate::errors::{Context, Result, refusal};
use crate::siblings;

/// `cars man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// The folder, for example `~/.local/share/man/man1`; it is made if it is not there.
    folder: PathBuf,
}

/// Writes a page for each subcommand of `cars`, whose command line is given, and for each program beside it that is there.
pub(crate) fn man(args: &ManArgs, cars: Command) -> Result<ExitCode> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;

    let mut cars = cars.disable_help_subcommand(true);
    cars.build();
    write_pages(&cars, folder)?;

    siblings::build()?;
    for (name, _) in SIBLINGS {
        if let Some(program) = find_sibling(name) {
            draft::write(&folder.join(format!("{name}.1")), page_of(&program)?)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The page that a program prints.
fn page_of(program: &Path) -> Result<Vec<u8>> {
    let output = std::process::Command::new(program)
        .arg(MAN_PAGE)
        .stderr(Stdio::inherit())
        .output()
        .context(program.display().to_string())?;
    let status = output.status;
    if !status.success() {
        return Err(refusal!("{}: {status}", program.display()));
    }
    Ok(output.stdout)
}

/// Writes the page of a command and those of its subcommands.
fn write_pages(command: &Command, folder: &Path) -> Result<()> {
    for subcommand in command.get_subcommands() {
        if !subcommand.is_hide_set() {
            write_pages(subcommand, folder)?;
        }
    }

    let page = Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text)?;
    draft::write(&folder.join(page.get_filename()), text)?;
    Ok(())
}
