//! Opens the page in a browser. Its address contains the token, and every user of a machine can read the arguments of all
//! processes: the browser gets the path of a file that only its owner can read and that leads to the address.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use protocol::messages::{Control, ControlAnswer, Phase};
use tempfile::{Builder, NamedTempFile};

use crate::app::{App, Mode};

/// How the names of these files begin and end.
const PREFIX: &str = "cars-console-";
const SUFFIX: &str = ".html";
/// How long a browser may take to read the file.
const READ_TIMEOUT: Duration = Duration::from_secs(60);

/// Opens `url` with the program in `BROWSER`, or else with the system's opener. Failures are printed: the user can open the
/// printed address instead. The file is removed when a browser has entered, after [`READ_TIMEOUT`], when the console
/// ends, or, if it was killed, when the next one opens a browser from the same folder. Returns whether a browser has been
/// started.
pub(crate) fn open(url: &str, app: Arc<App>) -> bool {
    let file = match write_file(url) {
        Ok(file) => file,
        Err(error) => {
            terminal::note(format_args!(
                "a file for the browser cannot be written ({error}): open the address above yourself"
            ));
            return false;
        }
    };

    let is_started = start_browser(file.path());
    if is_started {
        tokio::spawn(remove_when_read(file, app));
    }
    is_started
}

/// Writes a page that leads to `url`; its permissions are 0600. A browser in a sandbox may see other files than this
/// process in the folder for temporary files, so the current folder comes first.
fn write_file(url: &str) -> std::io::Result<NamedTempFile> {
    let folders = [std::env::current_dir()?, std::env::temp_dir()];
    for folder in &folders {
        remove_leftovers(folder);
    }

    let [current, temporary] = &folders;
    let mut file = create(current).or_else(|_| create(temporary))?;
    writeln!(
        file,
        "<!doctype html><title>CARS</title><meta http-equiv=\"refresh\" content=\"0;url={url}\">"
    )?;

    Ok(file)
}

/// Creates an empty file and locks it. The lock ends with the process, so that a file without one is a leftover.
fn create(folder: &Path) -> std::io::Result<NamedTempFile> {
    let file = Builder::new()
        .prefix(PREFIX)
        .suffix(SUFFIX)
        .tempfile_in(folder)?;
    if let Err(error) = file.as_file().lock() {
        tracing::debug!("a file for the browser cannot be locked: {error}");
    }
    Ok(file)
}

/// Removes the files that consoles left in a folder when they were killed: they have their tokens.
fn remove_leftovers(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_str().unwrap_or_default();
        let is_own = name.starts_with(PREFIX) && name.ends_with(SUFFIX);
        if is_own
            && is_leftover(&entry.path())
            && let Err(error) = std::fs::remove_file(entry.path())
        {
            tracing::debug!("{}: {error}", entry.path().display());
        }
    }
}

/// Whether no process has the file any more. An empty one has just been created and is not locked yet.
fn is_leftover(path: &Path) -> bool {
    let is_written = path
        .symlink_metadata()
        .is_ok_and(|file| file.is_file() && file.len() > 0);
    is_written && File::open(path).is_ok_and(|file| file.try_lock().is_ok())
}

/// Returns whether the browser, or the program that finds one, has been started.
fn start_browser(file: &Path) -> bool {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let program = std::env::var("BROWSER").unwrap_or_else(|_| opener.to_owned());

    let started = Command::new(&program)
        .arg(file)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();

    if let Err(error) = &started {
        terminal::note(format_args!(
            "{program} cannot be started ({error}): open the address above yourself"
        ));
    }
    started.is_ok()
}

/// Begins the run if no browser has come within `patience`: it has waited for one.
pub(crate) async fn begin_without_browser(patience: Duration, app: Arc<App>) {
    if tokio::time::timeout(patience, app.viewed()).await.is_ok() {
        return;
    }

    let because = match tokio::task::spawn_blocking(move || begin(&app)).await {
        Ok(Ok(false)) => return,
        Ok(Ok(true)) => {
            let waited_s = patience.as_secs_f64();
            return terminal::note(format_args!(
                "no browser has opened the page within {waited_s:.0} s: the run begins without one; open the address above yourself"
            ));
        }
        Ok(Err(reason)) => reason,
        Err(error) => error.to_string(),
    };
    terminal::note(format_args!(
        "no browser has opened the page, and the run does not begin: {because}"
    ));
}

/// Begins the run, unless it has begun already; returns whether it did.
fn begin(app: &App) -> Result<bool, String> {
    let Mode::Live(live) = &app.mode else {
        return Ok(false);
    };
    let waits = match live.control(&Control::Status)? {
        ControlAnswer::Done(status) => matches!(status.phase, Phase::Gathering | Phase::Ready),
        _ => false,
    };
    if !waits {
        return Ok(false);
    }

    match live.control(&Control::Start)? {
        ControlAnswer::Refused { explanation, .. } => Err(explanation),
        _ => Ok(true),
    }
}

/// The file is removed on drop, also where the runtime drops the task.
async fn remove_when_read(file: NamedTempFile, app: Arc<App>) {
    let _given_up = tokio::time::timeout(READ_TIMEOUT, app.entered()).await;
    drop(file);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_console_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let mut in_use = create(folder.path()).unwrap();
        writeln!(in_use, "token").unwrap();
        let new = create(folder.path()).unwrap();
        let left = folder.path().join("cars-console-aBcDeF.html");
        let other = folder.path().join("cars-console.html");
        std::fs::write(&left, "token").unwrap();
        std::fs::write(&other, "mine").unwrap();

        remove_leftovers(folder.path());
        assert!(!left.exists());
        for kept in [in_use.path(), new.path(), &other] {
            assert!(kept.exists(), "{}", kept.display());
        }
    }
}
