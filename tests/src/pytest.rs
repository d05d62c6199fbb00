//! Tests in Python.

use std::cmp::Reverse;
use std::fs::File;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use crate::{Lab, is_within, objections};

/// How many processes test at a time. They mostly wait.
const AT_A_TIME: usize = 2;
/// Longest that the tests of one process may take.
const PATIENCE: Duration = Duration::from_secs(900);

/// Which tests are run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// Those without the mark `thorough`.
    Usual,
    /// Those with it.
    Thorough,
}

impl Choice {
    fn marks(self) -> &'static str {
        match self {
            Self::Usual => "not thorough",
            Self::Thorough => "thorough",
        }
    }
}

/// Tests the files `test_*.py` of a folder by several processes at a time. `python` is the start of the command line: a Python that
/// finds what the tests import.
///
/// # Panics
/// If a test fails, with what pytest printed.
pub fn pytest(folder: &Path, choice: Choice, python: impl Fn() -> Command + Sync) {
    let lab = Lab::new();
    let groups = groups(files_of(folder, choice), choice);
    let pytest = || {
        let mut python = python();
        python.args(["-m", "pytest", "-m", choice.marks()]);
        python
    };
    let failed = objections(&groups, AT_A_TIME, |files| {
        let printed = test(lab.out(), files, pytest())?;
        test_again(lab.out(), &printed, pytest).then_some(printed)
    });
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// The files of a folder in which there are such tests.
fn files_of(folder: &Path, choice: Choice) -> Vec<PathBuf> {
    let mut tests = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy();
        let is_test = name.starts_with("test_") && name.ends_with(".py");
        if is_test && has_tests(&path, choice) {
            tests.push(path);
        }
    }

    assert!(!tests.is_empty(), "no tests in {}", folder.display());
    // The longest first, so that no long one is left when all others are done.
    tests.sort_by_key(|path| Reverse(path.metadata().unwrap().len()));
    tests
}

/// The files that one process tests together. Usual tests are short: what they import would take as long in a process for each file.
fn groups(files: Vec<PathBuf>, choice: Choice) -> Vec<Vec<PathBuf>> {
    let count = match choice {
        Choice::Usual => AT_A_TIME.min(files.len()),
        Choice::Thorough => files.len(),
    };
    let mut groups = vec![Vec::new(); count];
    for (index, file) in files.into_iter().enumerate() {
        groups[index % count].push(file);
    }
    groups
}

fn has_tests(file: &Path, choice: Choice) -> bool {
    let text = std::fs::read_to_string(file).unwrap();
    match choice {
        Choice::Usual => !text.contains("\npytestmark = pytest.mark.thorough\n"),
        Choice::Thorough => text.contains("pytest.mark.thorough"),
    }
}

/// In CI, runs the tests once more that have failed, and names those that pass then in the file of the variable `CARS_FLAKY`.
/// Returns whether the failure stands.
fn test_again(out: &Path, printed: &str, pytest: impl Fn() -> Command) -> bool {
    let Some(flaky) = std::env::var_os("CARS_FLAKY") else {
        return true;
    };
    let mut failed = Vec::new();
    for line in printed.lines() {
        let test = line.strip_prefix("FAILED ").or(line.strip_prefix("ERROR "));
        failed.extend(test.and_then(|test| test.split(" - ").next()));
    }
    if failed.is_empty() {
        return true;
    }

    let mut names = String::new();
    for id in failed {
        if test(out, &[PathBuf::from(id)], pytest()).is_some() {
            return true;
        }
        names.push_str(id);
        names.push('\n');
    }
    let mut file = File::options()
        .create(true)
        .append(true)
        .open(flaky)
        .unwrap();
    file.write_all(names.as_bytes()).unwrap();
    false
}

/// Tests files, or single tests of them, in a process group of its own, so that nothing that they start outlives it. Returns what
/// pytest printed and how it ended, if a test fails.
fn test(out: &Path, files: &[PathBuf], mut python: Command) -> Option<String> {
    let name = files[0].file_stem().unwrap().to_string_lossy();
    let printed = out.join(format!("{name}.txt"));
    let output = File::create(&printed).unwrap();
    let mut pytest = python
        .args(["-v", "-ra", "--tb=short"])
        .args(["-p", "no:cacheprovider", "--basetemp"])
        .arg(out.join(&*name))
        .args(files)
        .stdin(Stdio::null())
        .stdout(output.try_clone().unwrap())
        .stderr(output)
        .process_group(0)
        .spawn()
        .unwrap();
    let group = Pid::from_raw(i32::try_from(pytest.id()).unwrap());

    let is_done = is_within(PATIENCE, || pytest.try_wait().unwrap().is_some());
    if !is_done {
        killpg(group, Signal::SIGKILL).unwrap();
    }
    let status = pytest.wait().unwrap();
    if status.success() {
        return None;
    }

    let text = std::fs::read_to_string(&printed).unwrap();
    let how = if is_done { "ended" } else { "was killed" };
    Some(format!(
        "{text}\npytest {how}, {status}; it may take {PATIENCE:?}"
    ))
}
