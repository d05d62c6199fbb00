//! `cars init`: writes the files that come with the programs to a folder, to be edited.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use config::{FileError, shipped};
use experiments::shell;
use terminal::OutputError;

use crate::errors::{Result, refusal};

/// `cars init`.
#[derive(Debug, Args)]
pub(crate) struct InitArgs {
    /// The folder; it is made if it is not there. No file in it is replaced.
    folder: PathBuf,
}

/// Writes all files, or none if one is there with another text.
pub(crate) fn init(args: &InitArgs) -> Result<ExitCode> {
    let folder = &args.folder;
    let mut missing = Vec::new();
    for (name, text) in shipped::files() {
        let path = folder.join(name);
        match fs::read(&path) {
            Ok(found) if found == text.as_bytes() => {}
            Ok(_) => {
                return Err(refusal!(
                    help = "give another folder, or remove the file",
                    "{} has been changed; nothing was written",
                    path.display()
                ));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => missing.push((path, text)),
            Err(error) => return Err(FileError::unreadable(&path, &error).into()),
        }
    }

    for (path, text) in &missing {
        write_new(path, text)
            .map_err(|error| refusal!("cannot write {}: {error}", path.display()))?;
    }

    let count = missing.len();
    let launch = folder.join("launch/hors_doeuvres.toml");
    let line = format!(
        "{count} files written; edit them, and type `cars launch {}`",
        shell::path(&launch)
    );
    OutputError::unless_closed(terminal::print_line(line))?;
    Ok(ExitCode::SUCCESS)
}

fn write_new(path: &Path, text: &str) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = File::create_new(path)?;
    file.write_all(text.as_bytes()).inspect_err(|_| {
        // A part of it would be taken for a file that was changed.
        let _remains = fs::remove_file(path);
    })
}
