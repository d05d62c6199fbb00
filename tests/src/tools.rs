//! Tools that tests need beside the toolchain.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Reports a skipped test directly on the standard error, because the test harness hides the output of passing tests.
pub fn skip(test: &str, reason: &str) {
    let _unseen = writeln!(std::io::stderr(), "\nSKIPPED {test}: {reason}\n");
}

/// Skips a test because a tool is missing. With the environment variable `CI` that is a failure.
pub fn lacks_tool(test: &str, what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{test}: {what}");
    skip(test, what);
}

/// Whether Python has these modules, separated by commas. Skips a test otherwise; `install` installs their packages.
#[must_use]
pub fn has_modules(test: &str, modules: &str, install: &str) -> bool {
    let import = format!("import {modules}");
    let imported = Command::new("python3").args(["-c", &import]).output();
    let is_there = imported.is_ok_and(|output| output.status.success());
    if !is_there {
        lacks_tool(test, &format!("`{install}`"));
    }

    is_there
}

/// Whether there is a Python for robots of a test. Skips the test otherwise.
#[must_use]
pub fn has_python(test: &str) -> bool {
    has_modules(test, "sys", "apt-get install python3")
}

/// Runs a script in Python with a text as its input, to its end.
///
/// # Panics
/// If there is no Python, or the script does not read all of its input.
#[must_use]
pub fn python(script: &Path, input: &str) -> Output {
    let mut python = Command::new("python3")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = python.stdin.take().unwrap();
    stdin.write_all(input.as_bytes()).unwrap();
    drop(stdin);

    python.wait_with_output().unwrap()
}
