//! `cars check`: reads scenario and launch files as a run does, and runs nothing.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use config::{Changes, FileError};
use launch::{LaunchFile, is_launch_file};
use simulator::Scenario;
use terminal::OutputError;

/// `cars check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Scenario and launch files.
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

/// Checks every file, also after an error.
pub(crate) fn check(args: &CheckArgs) -> miette::Result<ExitCode> {
    let mut are_all_good = true;
    for path in &args.files {
        match describe(path) {
            Ok(text) => {
                let line = format!("ok {}: {text}", path.display());
                // The exit status is that of all files also where a reader has seen enough of them.
                OutputError::unless_closed(terminal::print_line(line))?;
            }
            Err(error) => {
                are_all_good = false;
                terminal::note(format_args!("{:?}", miette::Report::new(error)));
            }
        }
    }

    if are_all_good {
        Ok(ExitCode::SUCCESS)
    } else {
        Ok(ExitCode::FAILURE)
    }
}

/// The content of a file in one line.
fn describe(path: &Path) -> Result<String, FileError> {
    let changes = Changes::default();
    if !is_launch_file(path)? {
        let scenario = Scenario::load(path, &changes)?;
        return Ok(content(&scenario));
    }

    let file = LaunchFile::load(path)?;
    let scenario = file.load_scenario(&changes)?;
    file.check_robots(&scenario)?;

    let processes = count(file.processes.len(), "process", "processes");
    Ok(format!("{processes}, {}", content(&scenario)))
}

fn content(scenario: &Scenario) -> String {
    let robots = count(scenario.robots.len(), "robot", "robots");
    let guests = count(scenario.guests.count, "guest", "guests");
    format!("{robots}, {guests}, {} ticks", scenario.ticks)
}

fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}
