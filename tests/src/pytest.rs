//! Tests in Python.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use crate::Lab;

/// How many files are tested at a time. They mostly wait.
const AT_A_TIME: usize = 2;
/// Longest that the tests of one file may take.
const PATIENCE: Duration = Duration::from_secs(540);

/// Tests the files `test_*.py` of a folder, each by a process of its own and several at a time. `python` is the start of the
/// command line: a Python that finds what the tests import.
///
/// # Panics
/// If a test fails, with what pytest printed about its file.
pub fn pytest(folder: &Path, python: impl Fn() -> Command + Sync) {
    let lab = Lab::new();
    let files = Mutex::new(files_of(folder));
    let failed = Mutex::new(Vec::new());

    std::thread::scope(|scope| {
        for _ in 0..AT_A_TIME {
            scope.spawn(|| {
                loop {
                    let Some(file) = files.lock().unwrap().pop() else {
                        return;
                    };
                    if let Err(text) = test(lab.out(), &file, python()) {
                        failed.lock().unwrap().push(text);
                    }
                }
            });
        }
    });

    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

fn files_of(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let files = entries.map(|entry| entry.unwrap().path());
    let tests: Vec<PathBuf> = files
        .filter(|path| {
            let name = path.file_name().unwrap().to_string_lossy();
            name.starts_with("test_") && name.ends_with(".py")
        })
        .collect();
    assert!(!tests.is_empty(), "no tests in {}", folder.display());
    tests
}

/// Tests one file, in a process group of its own, so that nothing that it starts outlives it.
fn test(out: &Path, file: &Path, mut python: Command) -> Result<(), String> {
    let name = file.file_stem().unwrap().to_string_lossy();
    let printed = out.join(format!("{name}.txt"));
    let output = File::create(&printed).unwrap();
    let mut pytest = python
        .args(["-m", "pytest", "-v", "-ra", "--tb=short"])
        .args(["-p", "no:cacheprovider", "--basetemp"])
        .arg(out.join(&*name))
        .arg(file)
        .stdin(Stdio::null())
        .stdout(output.try_clone().unwrap())
        .stderr(output)
        .process_group(0)
        .spawn()
        .unwrap();
    let group = Pid::from_raw(i32::try_from(pytest.id()).unwrap());

    let begun = Instant::now();
    let status = loop {
        if let Some(status) = pytest.try_wait().unwrap() {
            break Some(status);
        }
        if begun.elapsed() > PATIENCE {
            killpg(group, Signal::SIGKILL).unwrap();
            pytest.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(20));
    };

    let text = || std::fs::read_to_string(&printed).unwrap_or_default();
    match status {
        Some(status) if status.success() => Ok(()),
        Some(status) => Err(format!("{}\npytest: {status}", text())),
        None => Err(format!("{}\nnot done after {PATIENCE:?}", text())),
    }
}
