//! Opens the page in a browser. Its address contains the token, and every user of a machine can read the arguments of all
//! processes: the browser gets the path of a file that only its owner can read and that leads to the address.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempPath};

use crate::app::App;

/// How long a browser may take to read the file.
const READ_TIMEOUT: Duration = Duration::from_secs(60);

/// Opens `url` with the program in `BROWSER`, or else with the system's opener. Failures are printed: the user can open the
/// printed address instead. The file is removed when a browser has entered, after [`READ_TIMEOUT`], or when the console
/// ends.
pub(crate) fn open(url: &str, app: Arc<App>) {
    let file = match write_file(url) {
        Ok(file) => file,
        Err(error) => {
            terminal::note(format_args!(
                "a file for the browser cannot be written ({error}): open the address above yourself"
            ));
            return;
        }
    };

    if start_browser(&file) {
        tokio::spawn(remove_when_read(file, app));
    }
}

/// Writes a page that leads to `url`; its permissions are 0600. A browser in a sandbox may see other files than this
/// process in the folder for temporary files, so the current folder comes first.
fn write_file(url: &str) -> std::io::Result<TempPath> {
    let mut file = create(&std::env::current_dir()?).or_else(|_| create(&std::env::temp_dir()))?;
    writeln!(
        file,
        "<!doctype html><title>CARS</title><meta http-equiv=\"refresh\" content=\"0;url={url}\">"
    )?;

    Ok(file.into_temp_path())
}

fn create(folder: &Path) -> std::io::Result<NamedTempFile> {
    Builder::new()
        .prefix("cars-console-")
        .suffix(".html")
        .tempfile_in(folder)
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

/// The file is removed on drop, also where the runtime drops the task.
async fn remove_when_read(file: TempPath, app: Arc<App>) {
    let _given_up = tokio::time::timeout(READ_TIMEOUT, app.entered()).await;
    drop(file);
}
