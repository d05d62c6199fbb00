//! `cars man`: writes the manual pages of all programs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;
use export::draft::{Draft, unwritable};
use robot::RobotArgs;

/// The programs of the robots.
const ROBOTS: [(&str, &str); 3] = [
    ("cars-butler", "Runs Butler, the waiter"),
    ("cars-leguin", "Runs Leguin, who refills"),
    ("cars-vonda", "Runs Vonda, who refills as Leguin does"),
];

/// `cars man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// The folder, for example `~/.local/share/man/man1`; it is made if it is not there.
    folder: PathBuf,
}

/// Writes a page for each program, and for each subcommand of `cars`, whose command line is given.
pub(crate) fn man(args: &ManArgs, cars: Command) -> miette::Result<ExitCode> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    for program in programs(cars) {
        let mut program = program.disable_help_subcommand(true);
        program.build();
        write_pages(&program, folder)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the page of a command and those of its subcommands.
fn write_pages(command: &Command, folder: &Path) -> miette::Result<()> {
    for subcommand in command.get_subcommands() {
        if !subcommand.is_hide_set() {
            write_pages(subcommand, folder)?;
        }
    }

    let page = Man::new(command.clone());
    let path = folder.join(page.get_filename());
    let mut draft = Draft::create(&path)?;
    page.render(&mut draft)
        .map_err(|error| unwritable(&path, &error))?;
    draft.publish()?;
    Ok(())
}

/// The command lines of all programs.
fn programs(cars: Command) -> Vec<Command> {
    let mut programs = vec![cars, simulator::program::command(), console::command()];
    for (name, about) in ROBOTS {
        programs.push(RobotArgs::command().name(name).about(about));
    }
    programs
}
