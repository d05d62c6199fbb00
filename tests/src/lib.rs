//! Support for whole-system tests: the real programs, their folders, their processes.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::missing_panics_doc,
    reason = "a test that cannot set up its subject fails"
)]

pub mod conformance;
pub mod hall;
pub mod network;
pub mod planted;
pub mod processes;
pub mod pytest;
pub mod python;
pub mod stalls;
pub mod tools;

use std::fs::File;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicU16, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use processes::Running;
use protocol::messages::End;
use record::Summary;
use recording::{RecordedTick, Recording};
use serde_json::Value;

/// Longest wait of a test.
pub const PATIENCE: Duration = Duration::from_secs(90);

/// Root of the project.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ is in the project")
        .to_owned()
}

/// Cargo without the variables that it sets for the package of a test: build scripts that read them would run again, and
/// half of the workspace would be compiled again.
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

/// The programs of the project.
pub const PROGRAMS: [&str; 8] = [
    "cars",
    "cars-sim",
    "cars-console",
    "cars-butler",
    "cars-leguin",
    "cars-vonda",
    "cars-bidder",
    "cars-scout",
];

/// The folder of the project's programs, built in the profile of this test; examples are in `examples` there.
#[must_use]
pub fn programs() -> &'static Path {
    static PROGRAMS: OnceLock<PathBuf> = OnceLock::new();

    PROGRAMS.get_or_init(|| {
        // The test itself is `target/{profile}/deps/…`.
        let own = std::env::current_exe().unwrap();
        let folder = own.parent().and_then(Path::parent).unwrap().to_owned();
        let mut build = cargo();
        // All packages and examples, so that dependencies have the same features as in `cargo test --workspace` and are
        // not compiled again.
        build.current_dir(root()).args([
            "build",
            "--workspace",
            "--lib",
            "--bins",
            "--examples",
            "--quiet",
        ]);
        build.args(["--profile", profile_of(&folder)]);
        assert!(
            build.status().unwrap().success(),
            "the programs do not build"
        );
        folder
    })
}

/// The profile of the programs in a folder.
#[must_use]
pub fn profile_of(programs: &Path) -> &'static str {
    if programs.ends_with("release") {
        "release"
    } else {
        "dev"
    }
}

/// A temporary folder for the runs of one test.
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

    /// The folder of its runs.
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

    /// The program `cars` with `--out` set to this lab, in the project's root.
    #[must_use]
    pub fn cars(&self, args: &[&str]) -> Command {
        let mut command = Command::new(programs().join("cars"));
        // Tests find files by the names of runs: a run that is played again has the name that it had.
        let is_new = !args.contains(&"--resume");
        let own: &[&str] = match args {
            ["run" | "launch" | "fork", ..] if is_new => &["--replace"],
            _ => &[],
        };
        command
            .current_dir(root())
            .args(args)
            .args(own)
            .args(["--out".as_ref(), self.out().as_os_str()]);
        processes::mark(&mut command)
            .stdin(Stdio::null())
            .env_remove("CARS_RUN")
            .env_remove("CARS_CONNECT");

        command
    }

    /// Runs `cars`, which must succeed, and returns its standard output. Where it plays a run, any verdict on the run is a
    /// success: it states what the robots did.
    pub fn ok(&self, args: &[&str]) -> String {
        let output = self.cars(args).output().unwrap();
        let status = output.status;
        let text = printed(&output);
        let plays = ["run", "launch", "fork"].contains(&args[0]);
        let has_succeeded = status.success() || (plays && self.is_verdict(status, args));
        assert!(has_succeeded, "cars {args:?}: {status}\n{text}");

        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Whether this is the exit status of the verdict on the run that `cars` has played with these arguments.
    fn is_verdict(&self, status: ExitStatus, args: &[&str]) -> bool {
        let mut after_run = args.iter().skip_while(|arg| **arg != "--run").skip(1);
        let run = after_run.next().unwrap_or(&"latest");
        has_played(status, &self.out().join(run))
    }

    /// Runs `cars`, which must fail, and returns its exit status and its output.
    pub fn fails(&self, args: &[&str]) -> (i32, String) {
        let output = self.cars(args).output().unwrap();
        let text = printed(&output);
        assert!(!output.status.success(), "cars {args:?} succeeded:\n{text}");
        (output.status.code().unwrap_or(-1), text)
    }

    /// Runs `cars` with exactly these arguments and returns its exit status and its output.
    pub fn cars_without_out(&self, args: &[&str]) -> (i32, String) {
        let output = Command::new(programs().join("cars"))
            .current_dir(root())
            .args(args)
            .output()
            .unwrap();
        (output.status.code().unwrap_or(-1), printed(&output))
    }

    /// Starts `cars` without waiting for its end. `run` is the name of the run, by which its processes are found.
    pub fn start(&self, run: &str, args: &[&str]) -> Running {
        let mut command = self.cars(args);
        command.args(["--run", run]);
        Running::start(command, run, self.folder.path().join(run))
    }

    /// A launch at full speed that has gathered its robots and waits for `start`.
    pub fn paused(&self, run: &str, file: &str, more: &[&str]) -> Running {
        let mut args = vec!["launch", file, "--paused", "--speed", "max"];
        args.extend(more);
        let launch = self.start(run, &args);
        self.until_ready(run);
        launch
    }

    /// Requests something of a run in progress; returns the status with which the simulator replies.
    pub fn ctl(&self, run: &str, args: &[&str]) -> Value {
        let mut all = vec!["ctl"];
        all.extend(args);
        all.extend(["--json", "--run", run]);
        serde_json::from_str(&self.ok(&all)).unwrap()
    }

    /// Waits until the robots of a run that begins paused have done tick 0.
    pub fn until_ready(&self, run: &str) {
        eventually("the run to be ready", || {
            let args = ["ctl", "status", "--json", "--run", run];
            let output = self.cars(&args).output().unwrap();
            let status: Value = serde_json::from_slice(&output.stdout).ok()?;
            (status["phase"] == "ready").then_some(())
        });
    }

    /// Requests something that the launcher of a run carries out, as soon as it observes the run: the simulator may be ready before.
    pub fn ctl_of_launcher(&self, run: &str, args: &[&str]) {
        eventually("the launcher to observe the run", || {
            let mut all = vec!["ctl"];
            all.extend(args);
            all.extend(["--run", run]);
            let output = self.cars(&all).output().unwrap();
            output.status.success().then_some(())
        });
    }

    /// Steps a run that is paused by so many ticks; returns the last one, which is complete.
    pub fn step(&self, run: &str, ticks: u64) -> u64 {
        let last = self.settled(run) + ticks;
        let reply = self.ctl(run, &["step", &ticks.to_string()]);
        assert_stepped(&reply, last);

        let reached = self.settled(run);
        assert_eq!(reached, last);
        reached
    }

    /// Waits until a run that is paused has no open tick and no steps to go; returns its tick.
    #[must_use]
    pub fn settled(&self, run: &str) -> u64 {
        eventually("the end of the last step", || {
            let status = self.ctl(run, &["status"]);
            let is_settled = !is_held(&status) && status["pending_steps"] == 0;
            is_settled.then(|| status["tick"].as_u64().unwrap())
        })
    }

    /// A file of a run.
    #[must_use]
    pub fn file(&self, run: &str, name: &str) -> PathBuf {
        self.out().join(run).join(name)
    }

    /// The bytes of a run's events.
    #[must_use]
    pub fn bytes(&self, run: &str) -> Vec<u8> {
        let file = self.file(run, "events.jsonl");
        std::fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
    }

    /// All ticks of a run's recording.
    pub fn recorded(&self, run: &str) -> Vec<RecordedTick> {
        let recording = Recording::open(&self.file(run, "run.mcap")).unwrap();
        recording.read(0, recording.len()).unwrap()
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

/// Asserts that the reply to `step` states the last tick. The reply comes earlier where the clock is held, for a robot that
/// the machine keeps waiting, for example; then it names the robot, and the steps are still carried out.
pub fn assert_stepped(reply: &Value, last: u64) {
    assert!(reply["tick"] == last || is_held(reply), "{reply}");
}

/// Whether the clock waits for a robot in this status.
fn is_held(status: &Value) -> bool {
    let awaiting = status["awaiting"].as_array();
    awaiting.is_some_and(|robots| !robots.is_empty())
}

/// A port of this machine at which no process listens. It is not one of those that the kernel gives to connections and to
/// listeners without a port, and other processes of tests, in Rust or Python, keep off until this one ends: nobody takes it before
/// it is used.
///
/// # Panics
/// If the folder of the claims cannot be made.
#[must_use]
pub fn free_port() -> u16 {
    static OFFSET: AtomicU16 = AtomicU16::new(0);
    static CLAIMS: Mutex<Vec<File>> = Mutex::new(Vec::new());
    const FIRST: u16 = 11_000;
    const COUNT: u16 = 20_000;
    let folder = root().join("target/tmp/ports");
    std::fs::create_dir_all(&folder).unwrap();

    // Processes of tests begin at different places.
    let begin = std::process::id() % u32::from(COUNT);
    loop {
        let offset = u32::from(OFFSET.fetch_add(1, Ordering::Relaxed));
        let port = u32::from(FIRST) + (begin + offset) % u32::from(COUNT);
        let port = u16::try_from(port).unwrap();

        let claim = File::create(folder.join(port.to_string())).unwrap();
        if claim.try_lock().is_ok() && TcpListener::bind(("127.0.0.1", port)).is_ok() {
            CLAIMS.lock().unwrap().push(claim);
            return port;
        }
    }
}

/// Whether a program has played a run to its end: its exit status is 0, or that of the verdict in the summary of the run.
#[must_use]
pub fn has_played(status: ExitStatus, folder: &Path) -> bool {
    if status.success() {
        return true;
    }
    let Ok(text) = std::fs::read_to_string(folder.join("summary.json")) else {
        return false;
    };

    let summary: Summary = serde_json::from_str(&text).unwrap();
    let verdict = i32::from(summary.verdict().exit_status());
    let has_end = matches!(summary.end, Some(End::Finished | End::Stopped));
    has_end && status.code() == Some(verdict)
}

/// Standard output and standard error of a program.
fn printed(output: &Output) -> String {
    let streams = [&output.stdout, &output.stderr];
    streams.map(|text| String::from_utf8_lossy(text)).concat()
}

/// Asserts that two runs, given by name and events, are the same. Shows the first event that differs.
pub fn assert_same(a: (&str, &[u8]), b: (&str, &[u8])) {
    let (a, a_bytes) = a;
    let (b, b_bytes) = b;
    if a_bytes == b_bytes {
        return;
    }

    let a_text = String::from_utf8_lossy(a_bytes);
    let b_text = String::from_utf8_lossy(b_bytes);
    let mut a_lines = a_text.lines();
    let mut b_lines = b_text.lines();
    for number in 1.. {
        let line = a_lines.next();
        let other = b_lines.next();
        assert!(
            line == other,
            "{a} and {b} differ from line {number} on:\n  {}\n  {}",
            line.unwrap_or("(end)"),
            other.unwrap_or("(end)")
        );
        assert!(line.is_some(), "{a} and {b} differ in the ends of lines");
    }
}

/// Runs checks at the same time, each on a thread of its own, and fails with the names of those that failed. It is for
/// checks that mostly wait, because the test harness runs only as many tests at a time as there are processors.
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

/// Does something with each of these items, some at a time, and returns what `check` has to say against them.
pub fn objections<T: Sync>(
    items: &[T],
    at_a_time: usize,
    check: impl Fn(&T) -> Option<String> + Sync,
) -> Vec<String> {
    let next = AtomicUsize::new(0);
    let objections = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..at_a_time {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let objection = check(item);
                    objections.lock().unwrap().extend(objection);
                }
            });
        }
    });

    objections.into_inner().unwrap()
}

/// Waits until `ready` returns a value; fails after [`PATIENCE`].
pub fn eventually<T>(what: &str, ready: impl FnMut() -> Option<T>) -> T {
    within(PATIENCE, what, ready)
}

/// Waits until `ready` returns a value; fails after `limit`.
pub fn within<T>(limit: Duration, what: &str, mut ready: impl FnMut() -> Option<T>) -> T {
    let mut found = None;
    let is_ready = is_within(limit, || {
        found = ready();
        found.is_some()
    });
    assert!(is_ready, "waited {limit:?} in vain for {what}");

    found.unwrap()
}

/// Waits until a condition holds, but not longer than `limit`; returns whether it does.
pub fn is_within(limit: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let begun = Instant::now();
    while !holds() {
        if begun.elapsed() >= limit {
            return false;
        }
        std::thread::sleep(Duration::from_millis(10));
    }

    true
}

/// The subcommands that the help of `cars` lists, in all of its groups.
#[must_use]
pub fn subcommands_in(help: &str) -> Vec<String> {
    let (listed, _) = help.split_once("\nOptions:\n").unwrap();
    let mut names = Vec::new();
    for line in listed.lines() {
        if line.starts_with("  ") {
            names.push(line.split_whitespace().next().unwrap().to_owned());
        }
    }

    assert!(names.len() > 20, "{names:?}");
    names
}
