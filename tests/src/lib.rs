//! What the whole-system tests stand on: the real programs, their folders, their processes.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::missing_panics_doc,
    reason = "a test that cannot set up its subject fails"
)]

pub mod conformance;
pub mod hall;
pub mod network;
pub mod processes;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use processes::Running;

/// Longest that anything here may take before it counts as hung.
pub const PATIENCE: Duration = Duration::from_secs(90);

/// Root of the project.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ is in the project")
        .to_owned()
}

/// Cargo without the variables that it sets for a test's own package: build scripts that read them would run again, and
/// half of the tree would be compiled again.
#[must_use]
pub fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    for (name, _) in std::env::vars_os() {
        let is_of_package = name.to_str().is_some_and(|name| {
            name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_")
        });
        if is_of_package {
            cargo.env_remove(name);
        }
    }

    cargo
}

/// The folder of the project's programs, built in the profile of this test; examples are in `examples` there.
#[must_use]
pub fn programs() -> &'static Path {
    static PROGRAMS: OnceLock<PathBuf> = OnceLock::new();

    PROGRAMS.get_or_init(|| {
        // The test itself is `target/{profile}/deps/…`.
        let own = std::env::current_exe().unwrap();
        let folder = own.parent().and_then(Path::parent).unwrap().to_owned();
        let mut build = cargo();
        // With the features that `cargo test --workspace` gives dependencies, or these would be compiled again: those of
        // all packages, and, because examples may use them, of what tests depend on. The tests themselves are not built.
        build
            .current_dir(root())
            .args(["build", "--workspace", "--bins", "--examples", "--quiet"]);
        if folder.ends_with("release") {
            build.arg("--release");
        }
        assert!(
            build.status().unwrap().success(),
            "the programs do not build"
        );
        folder
    })
}

/// A place of its own for the runs of one test, and the means to execute them.
pub struct Lab {
    folder: tempfile::TempDir,
}

impl Default for Lab {
    fn default() -> Self {
        Self::new()
    }
}

impl Lab {
    /// An empty lab.
    #[must_use]
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// Where its runs are kept.
    #[must_use]
    pub fn out(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file into the lab.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let file = self.folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        file
    }

    /// The `cars` program in this lab, from the project's root.
    #[must_use]
    pub fn cars(&self, args: &[&str]) -> Command {
        let mut command = Command::new(programs().join("cars"));
        command
            .current_dir(root())
            .args(args)
            .args(["--out".as_ref(), self.out().as_os_str()]);
        command
            .stdin(Stdio::null())
            .env_remove("CARS_RUN")
            .env_remove("CARS_CONNECT");

        command
    }

    /// Runs `cars` to its end and returns what it printed; it must succeed.
    pub fn ok(&self, args: &[&str]) -> String {
        let output = self.cars(args).output().unwrap();
        let (out, err) = (
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr),
        );
        assert!(
            output.status.success(),
            "cars {args:?}: {}\n{out}\n{err}",
            output.status
        );

        out.into_owned()
    }

    /// Runs `cars` to its end and returns its exit status and all that it printed; it must fail.
    pub fn fails(&self, args: &[&str]) -> (i32, String) {
        let output = self.cars(args).output().unwrap();
        let text = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(!output.status.success(), "cars {args:?} succeeded:\n{text}");
        (output.status.code().unwrap_or(-1), text)
    }

    /// Runs `cars` with exactly these arguments and returns its exit status and all that it printed.
    pub fn cars_without_out(&self, args: &[&str]) -> (i32, String) {
        let output = Command::new(programs().join("cars"))
            .current_dir(root())
            .args(args)
            .output()
            .unwrap();
        let text = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );

        (output.status.code().unwrap_or(-1), text)
    }

    /// Starts `cars` and leaves it running. `run` is the name of the run, which finds its processes again.
    pub fn start(&self, run: &str, args: &[&str]) -> Running {
        let mut command = self.cars(args);
        command.args(["--run", run]);
        Running::start(command, run, self.folder.path().join(run))
    }

    /// A file of a run.
    #[must_use]
    pub fn file(&self, run: &str, name: &str) -> PathBuf {
        self.out().join(run).join(name)
    }

    /// The events of a run, byte for byte.
    #[must_use]
    pub fn bytes(&self, run: &str) -> Vec<u8> {
        let file = self.file(run, "events.jsonl");
        std::fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
    }

    /// The events of a run.
    #[must_use]
    pub fn events(&self, run: &str) -> Vec<serde_json::Value> {
        let text = String::from_utf8(self.bytes(run)).unwrap();
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    /// The summary of a run.
    #[must_use]
    pub fn summary(&self, run: &str) -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(self.file(run, "summary.json")).unwrap()).unwrap()
    }
}

/// Asserts that two runs are the same, and shows the first event that differs if not.
pub fn assert_same(a: (&str, &[u8]), b: (&str, &[u8])) {
    if a.1 == b.1 {
        return;
    }

    let lines = |bytes: &[u8]| {
        String::from_utf8_lossy(bytes)
            .lines()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let (left, right) = (lines(a.1), lines(b.1));
    let at = left
        .iter()
        .zip(&right)
        .position(|(l, r)| l != r)
        .unwrap_or(left.len().min(right.len()));

    panic!(
        "{} and {} differ from line {} on:\n  {}\n  {}",
        a.0,
        b.0,
        at + 1,
        left.get(at).map_or("(end)", String::as_str),
        right.get(at).map_or("(end)", String::as_str)
    );
}

/// Runs checks side by side, each in a thread of its own, and fails with the names of those that failed. For checks that
/// mostly wait: the test harness runs no more tests at a time than the machine has processors.
pub fn side_by_side(checks: &[(&str, &(dyn Fn() + Sync))]) {
    let mut failed = Vec::new();
    std::thread::scope(|scope| {
        let mut running = Vec::new();
        for (name, check) in checks {
            let thread = std::thread::Builder::new().name((*name).to_owned());
            running.push((name, thread.spawn_scoped(scope, check).unwrap()));
        }
        for (name, check) in running {
            if check.join().is_err() {
                failed.push(*name);
            }
        }
    });

    assert!(failed.is_empty(), "{failed:?} failed; see above");
}

/// Waits until `ready` gives something, and fails if it never does.
pub fn eventually<T>(what: &str, mut ready: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = ready() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}
