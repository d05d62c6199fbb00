//! `cars man`: writes the manual pages of all programs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command, CommandFactory};
use miette::miette;
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
    let failed = |error: std::io::Error| miette!("cannot write {}: {error}", folder.display());

    std::fs::create_dir_all(folder).map_err(failed)?;
    for program in programs(cars) {
        clap_mangen::generate_to(program, folder).map_err(failed)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The command lines of all programs.
fn programs(cars: Command) -> Vec<Command> {
    let mut programs = vec![cars, simulator::program::command(), console::command()];
    for (name, about) in ROBOTS {
        programs.push(RobotArgs::command().name(name).about(about));
    }
    programs
}
