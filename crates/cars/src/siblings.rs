//! The programs beside `cars`, in a checkout.

use std::env;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::errors::Result;

/// A build that lasts longer than this is announced. One that finds nothing to do takes about 0.3 s.
const SILENT: Duration = Duration::from_secs(1);
/// How often the build is polled for its end.
const POLL: Duration = Duration::from_millis(10);

/// Builds the programs that come with `cars` if this process was started by `cargo run`, which builds `cars` alone.
///
/// # Errors
/// If they do not build.
pub(crate) fn build() -> Result<()> {
    let Some(mut build) = build_command() else {
        return Ok(());
    };

    let begun = Instant::now();
    let mut child = build.spawn()?;
    while child.try_wait()?.is_none() && begun.elapsed() < SILENT {
        std::thread::sleep(POLL);
    }
    if child.try_wait()?.is_none() {
        terminal::note("building the programs beside `cars` first");
    }

    let status = child.wait()?;
    if !status.success() {
        return Err("the programs beside `cars` do not build".into());
    }
    Ok(())
}

/// The build of the same packages in the same profile and folder as `cargo run` has just made, of all their programs.
fn build_command() -> Option<Command> {
    let cargo = env::var_os("CARGO")?;
    let manifest = env::var_os("CARGO_MANIFEST_DIR")?;
    let is_of_cars = env::var_os("CARGO_PKG_NAME")? == env!("CARGO_PKG_NAME");
    // Tests of this package have the same variables, and this one.
    if !is_of_cars || env::var_os("CARGO_BIN_EXE_cars").is_some() {
        return None;
    }

    let program = env::current_exe().ok()?;
    let folder = program.parent()?;
    let profile = match folder.file_name()?.to_str()? {
        "debug" => "dev",
        profile => profile,
    };
    // In the current folder, as `cargo run`: its settings of cargo are the same.
    let mut build = Command::new(cargo);
    build
        .args(["build", "--quiet", "--profile", profile, "--target-dir"])
        .arg(folder.parent()?)
        .arg("--manifest-path")
        .arg(Path::new(&manifest).join("../../Cargo.toml"));

    // Build scripts that read what cargo sets for the package that it runs would run again.
    for (name, _) in env::vars_os() {
        let name = name.to_string_lossy().into_owned();
        if name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_") {
            build.env_remove(name);
        }
    }
    Some(build)
}
