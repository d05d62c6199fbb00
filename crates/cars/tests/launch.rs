//! `cars launch` as a process: what it prints, how it ends, and that it leaves no process behind. Shells play simulator
//! and robots; nothing here needs the bus.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot go on has failed"
)]

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{SigSet, Signal, kill};
use nix::unistd::Pid;

const SCENARIO: &str = "[[robot]]\nname = \"Butler\"\nat = [\"25 ft\", \"25 ft\"]\n";
const TIME: Duration = Duration::from_secs(90);

/// A folder with a scenario and a launch file.
struct Folder(tempfile::TempDir);

impl Folder {
    /// A launch of two shells, each given as a script; `$DIR` is this folder.
    fn new(simulator: &str, butler: &str, more: &str) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        std::fs::write(folder.path("hall.toml"), SCENARIO).unwrap();
        let text = format!(
            "scenario = \"hall.toml\"\n[console]\nenabled = false\n\
             [simulator]\ncommand = [\"sh\", \"-c\", '''{simulator}''']\n\
             [[process]]\nname = \"Butler\"\ncommand = [\"sh\", \"-c\", '''{butler}''']\n{more}\n"
        );
        std::fs::write(folder.path("launch.toml"), text).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn cars(&self, args: &[&str]) -> Command {
        // Who runs the tests may have told them to ignore signals, as `nohup` does, and children inherit that.
        let mut command = Command::new("env");
        command
            .args(["--default-signal=HUP,INT,QUIT", env!("CARGO_BIN_EXE_cars")])
            .current_dir(self.0.path())
            .env("DIR", self.0.path())
            .env_remove("NO_COLOR");
        command
            .arg("launch")
            .arg("launch.toml")
            .arg("--quiet")
            .args(args);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());

        command
    }

    /// Waits until a shell has written this file.
    #[track_caller]
    fn wait_for(&self, name: &str) {
        let begun = Instant::now();
        while !self.path(name).exists() {
            assert!(begun.elapsed() < TIME, "no {name}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_default()
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn signal(child: &Child, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
}

/// Waits for the end of a launch, but not for ever.
#[track_caller]
fn end(mut child: Child) -> Output {
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begun.elapsed() > TIME {
            let _ended = child.kill();
            panic!("the launch does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    child
        .stdout
        .take()
        .unwrap()
        .read_to_end(&mut stdout)
        .unwrap();

    child
        .stderr
        .take()
        .unwrap()
        .read_to_end(&mut stderr)
        .unwrap();

    Output {
        status,
        stdout,
        stderr,
    }
}

#[track_caller]
fn assert_gone(pid: &str) {
    let begun = Instant::now();
    let path = Path::new("/proc").join(pid.trim()).join("stat");
    while std::fs::read_to_string(&path).is_ok_and(|stat| !stat.contains(") Z ")) {
        assert!(begun.elapsed() < TIME, "process {pid} was left behind");
        std::thread::sleep(Duration::from_millis(5));
    }
}

const IN_ORDER: &str =
    "trap 'echo stopped > $DIR/record; exit 0' TERM; touch $DIR/up; sleep 600 & wait";
const DEAF: &str = "trap '' TERM; (sleep 600; true) & echo $! > $DIR/child; touch $DIR/deaf; wait";

#[test]
fn a_run_that_finishes_exits_with_0_and_leaves_logs() {
    let folder = Folder::new(
        "echo hello; until [ -e $DIR/done ]; do sleep 0.01; done",
        "echo ready >&2; touch $DIR/done; sleep 0.1",
        "",
    );
    let output = folder.cars(&[]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "Butler    | ready\n");
    assert_eq!(folder.read("runs/launch/logs/simulator.log"), "hello\n");
    assert_eq!(folder.read("runs/launch/logs/Butler.log"), "ready\n");
    assert!(folder.path("runs/launch/scenario.toml").exists());
}

#[test]
fn the_exit_status_is_that_of_the_first_required_failure() {
    let folder = Folder::new(
        IN_ORDER,
        "until [ -e $DIR/up ]; do sleep 0.01; done; echo broken >&2; exit 3",
        "",
    );
    let output = folder.cars(&[]).output().unwrap();
    assert_eq!(output.status.code(), Some(3));

    let stderr = text(&output.stderr);
    let end = "error: Butler ended with exit status 3\n\
               the last lines that it wrote as errors:\n  broken\nits log: runs/launch/logs/Butler.log\n";
    assert!(stderr.ends_with(end), "{stderr}");
    assert_eq!(folder.read("record"), "stopped\n");
}

#[test]
fn ctrl_c_once_ends_all_in_good_order() {
    let ends_in_order = |asking: Signal, code: i32| {
        let folder = Folder::new(IN_ORDER, "touch $DIR/robot; sleep 600", "");
        let launch = folder.cars(&[]).spawn().unwrap();
        folder.wait_for("up");
        folder.wait_for("robot");
        signal(&launch, asking);
        assert_eq!(end(launch).status.code(), Some(code));
        assert_eq!(folder.read("record"), "stopped\n");
    };

    std::thread::scope(|scope| {
        scope.spawn(|| ends_in_order(Signal::SIGINT, 130));
        scope.spawn(|| ends_in_order(Signal::SIGTERM, 143));
        scope.spawn(|| ends_in_order(Signal::SIGHUP, 129));
    });
}

#[test]
fn ctrl_c_twice_kills_all_at_once() {
    let folder = Folder::new(IN_ORDER, DEAF, "");
    let mut launch = folder.cars(&["--grace", "10 min"]).spawn().unwrap();
    folder.wait_for("up");
    folder.wait_for("deaf");
    signal(&launch, Signal::SIGINT);
    folder.wait_for("record");
    assert!(
        launch.try_wait().unwrap().is_none(),
        "one is still there, and has time"
    );

    signal(&launch, Signal::SIGINT);
    assert_eq!(end(launch).status.code(), Some(130));
    assert_gone(&folder.read("child"));
}

#[test]
fn what_is_started_by_somebody_else_is_printed_and_not_started() {
    let folder = Folder::new(
        "sleep 0.2",
        "touch $DIR/started",
        "extern = true\nenv = { LEVEL = \"two words\" }",
    );
    let output = folder.cars(&["--connect-port", "7999"]).output().unwrap();
    let stderr = text(&output.stderr);

    assert!(stderr.contains("start Butler yourself"), "{stderr}");
    assert!(
        stderr.contains("CARS_CONNECT=tcp/127.0.0.1:7999 CARS_RUN=launch LEVEL='two words'"),
        "{stderr}"
    );
    assert!(stderr.contains("--name Butler\n"), "{stderr}");
    assert!(!folder.path("started").exists());
}

#[test]
fn a_dry_run_prints_everything_and_starts_nothing() {
    let folder = Folder::new("touch $DIR/started", "touch $DIR/started", "");
    let args = [
        "--dry-run",
        "--connect-port",
        "7999",
        "--run",
        "demo",
        "--speed",
        "2",
        "--paused",
    ];
    let output = folder.cars(&args).output().unwrap();
    let stdout = text(&output.stdout);

    for part in [
        "# simulator\n",
        "runs/demo/scenario.toml --run=demo --listen=tcp/127.0.0.1:7999 --out=runs --speed=2 --no-verdict --paused --prepared\n",
        "# Butler\n",
        "CARS_CONNECT=tcp/127.0.0.1:7999 CARS_RUN=demo",
        "--name Butler\n",
    ] {
        assert!(stdout.contains(part), "{part:?} is not in:\n{stdout}");
    }

    assert!(!folder.path("started").exists() && !folder.path("runs").exists());
}

#[test]
fn where_somebody_else_is_faster_another_port_is_tried() {
    // The simulator of the first attempt says that its port is taken.
    let simulator = "for a; do case $a in --listen=*) echo ${a##*:} >> $DIR/ports;; esac; done; \
                     [ $(wc -l < $DIR/ports) = 1 ] || exit 0; exit 3";
    let folder = Folder::new(simulator, "sleep 600", "");
    let output = folder.cars(&["--grace", "0.2 s"]).output().unwrap();
    let stderr = text(&output.stderr);

    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("trying another port"), "{stderr}");
    assert_eq!(folder.read("ports").lines().count(), 2);
}

#[test]
fn a_program_that_is_nowhere_is_said_before_anything_starts() {
    let folder = Folder::new("touch $DIR/started", "true", "");
    let text_of = folder.read("launch.toml").replace(
        "command = [\"sh\", \"-c\", '''true''']",
        "command = [\"cars-nobody\"]",
    );
    std::fs::write(folder.path("launch.toml"), text_of).unwrap();
    let output = folder.cars(&[]).output().unwrap();
    let stderr = text(&output.stderr);

    for part in [
        "launch.toml:8:",
        "there is no program cars-nobody",
        "PATH",
        "cargo build --release",
    ] {
        assert!(stderr.contains(part), "{part:?} is not in:\n{stderr}");
    }

    assert_eq!(output.status.code(), Some(1));
    assert!(!folder.path("started").exists());
}

#[test]
fn a_program_starts_with_no_signal_blocked() {
    let asking: SigSet = [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP]
        .into_iter()
        .collect();
    asking.thread_block().unwrap();
    let parent = std::process::id().to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_cars"))
        .args(["child", &parent, "--", "cat", "/proc/self/status"])
        .output();
    asking.thread_unblock().unwrap();

    let status = text(&output.unwrap().stdout);
    assert!(status.contains("SigBlk:\t0000000000000000"), "{status}");
}

#[test]
fn nothing_is_left_when_the_launcher_is_killed() {
    let butler = "sleep 600 & echo $! > $DIR/child; setsid sh -c \"echo \\$\\$ > $DIR/daemon; sleep 600\" & \
                  until [ -s $DIR/child ] && [ -s $DIR/daemon ]; do sleep 0.01; done; touch $DIR/robot; sleep 600";
    let folder = Folder::new(IN_ORDER, butler, "");
    let mut launch = folder.cars(&[]).spawn().unwrap();
    folder.wait_for("up");
    folder.wait_for("robot");

    launch.kill().unwrap();
    launch.wait().unwrap();
    folder.wait_for("record");
    assert_gone(&folder.read("child"));
    assert_gone(&folder.read("daemon"));
}

#[test]
fn an_endpoint_that_nobody_could_use_is_refused_before_anything_is_made() {
    let folder = Folder::new("touch $DIR/started", "true", "");
    for (listen, reason) in [
        ("tcp://127.0.0.1:7999", "write tcp/127.0.0.1:7999"),
        ("127.0.0.1:7999", "write tcp/127.0.0.1:7999"),
        ("tcp/127.0.0.1:0", "port 0"),
    ] {
        let output = folder.cars(&["--listen", listen]).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        // Words are wrapped.
        let words: Vec<&str> = stderr
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect();
        assert!(words.join(" ").contains(reason), "{stderr}");
        assert!(!folder.path("started").exists() && !folder.path("runs").exists());
    }

    let output = folder
        .cars(&["--dry-run", "--connect-port", "0"])
        .output()
        .unwrap();
    let stdout = text(&output.stdout);
    assert!(stdout.contains("--listen=tcp/127.0.0.1:"), "{stdout}");
    assert!(!stdout.contains("--listen=tcp/127.0.0.1:0 "), "{stdout}");
}

/// Checks files in a folder; returns what is printed to both streams, and whether all can be used.
fn check(folder: &Folder, files: &[&str]) -> (String, String, bool) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cars"));
    let output = command
        .current_dir(folder.0.path())
        .arg("check")
        .args(files)
        .output()
        .unwrap();
    (
        text(&output.stdout),
        text(&output.stderr),
        output.status.success(),
    )
}

#[test]
fn check_reads_files_of_every_kind() {
    let folder = Folder::new("true", "true", "");
    let write = |name: &str, text: &str| std::fs::write(folder.path(name), text).unwrap();
    write(
        "links.toml",
        "[[link_fault]]\nrobot = \"Rosie\"\nat = \"1 s\"\nfor = \"2 s\"\ndo = \"cut\"\n",
    );
    write(
        "butler.toml",
        "refiller = \"Leguin\"\ntreat_capacity = 12\n",
    );
    std::fs::create_dir(folder.path("robots")).unwrap();
    write("robots/rosie.toml", "pace = \"1 ft/s\"\n");
    write("roster.txt", "# two\nButler\n\nLeguin\n");
    write("CARSConfig", "Butler\n");

    let files = [
        "links.toml",
        "butler.toml",
        "robots/rosie.toml",
        "roster.txt",
        "CARSConfig",
    ];
    let (stdout, stderr, is_good) = check(&folder, &files);
    assert!(is_good, "{stderr}");
    let expected = "ok links.toml: 1 fault of a link\n\
                    ok butler.toml: 2 parameters, which Butler takes\n\
                    ok robots/rosie.toml: 1 parameter, for a class that decides about them itself\n\
                    ok roster.txt: a roster: 2 robots, 100 guests, 1200 ticks\n\
                    ok CARSConfig: a roster: 1 robot, 100 guests, 1200 ticks\n";
    assert_eq!(stdout, expected);

    write(
        "links.toml",
        "[[link_fault]]\nrobot = \"Rosie\"\nat = \"1 s\"\nfor = \"0 s\"\ndo = \"cut\"\n",
    );
    write("butler.toml", "policy = \"nonsense\"\n");
    write("roster.txt", "Butler\n../Leguin\n");
    for (file, reason) in [
        ("links.toml", "more than zero"),
        ("butler.toml", "nonsense"),
        ("roster.txt", "roster.txt:2:1"),
    ] {
        let (_, stderr, is_good) = check(&folder, &[file]);
        assert!(!is_good && stderr.contains(reason), "{file}: {stderr}");
    }
}

#[test]
fn a_name_that_looks_like_an_option_is_refused_where_it_is_written() {
    let folder = Folder::new("true", "true", "");
    let hall = folder.read("hall.toml").replace("Butler", "--help");
    std::fs::write(folder.path("hall.toml"), hall).unwrap();
    let (_, stderr, is_good) = check(&folder, &["hall.toml"]);
    assert!(!is_good && stderr.contains("begins with '-'"), "{stderr}");

    let launch = folder.read("launch.toml").replace("\"Butler\"", "\"-x\"");
    std::fs::write(folder.path("launch.toml"), launch).unwrap();
    let (_, stderr, is_good) = check(&folder, &["launch.toml"]);
    assert!(!is_good && stderr.contains("launch.toml:7:"), "{stderr}");

    let output = folder.cars(&["--run=--help"]).output().unwrap();
    assert!(text(&output.stderr).contains("begins with '-'"));
}

#[test]
fn check_warns_of_what_may_not_be_meant() {
    let folder = Folder::new("true", "true", "required = false");
    let (stdout, stderr, is_good) = check(&folder, &["launch.toml"]);
    assert!(is_good && stdout.starts_with("ok launch.toml"), "{stderr}");
    assert!(stderr.contains("launch.toml:9:"), "{stderr}");
    assert!(stderr.contains("the clock waits for Butler"), "{stderr}");

    let scenario = format!("on_late = \"continue\"\nduration = \"10.2 s\"\n{SCENARIO}");
    std::fs::write(folder.path("hall.toml"), scenario).unwrap();
    let (_, stderr, is_good) = check(&folder, &["launch.toml"]);
    assert!(is_good && !stderr.contains("the clock waits"), "{stderr}");
    assert!(stderr.contains("hall.toml:2:12"), "{stderr}");
    assert!(stderr.contains("the run lasts 10 s"), "{stderr}");
}

#[test]
fn check_says_what_a_file_is_or_what_is_wrong_with_it() {
    let folder = Folder::new("true", "true", "");
    std::fs::write(folder.path("bad.toml"), "sede = 1\n").unwrap();
    let check = |files: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cars"));
        command
            .current_dir(folder.0.path())
            .arg("check")
            .args(files)
            .output()
            .unwrap()
    };
    let output = check(&["launch.toml", "hall.toml"]);
    let good = "ok launch.toml: 1 process, 1 robot, 0 guests, 1200 ticks\nok hall.toml: 1 robot, 0 guests, 1200 ticks\n";
    assert_eq!(
        (text(&output.stdout).as_str(), output.status.code()),
        (good, Some(0)),
        "{}",
        text(&output.stderr)
    );

    let output = check(&["bad.toml", "hall.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stdout).contains("ok hall.toml"),
        "the others are checked, too"
    );

    let stderr = text(&output.stderr);
    assert!(
        stderr.contains("bad.toml:1:1") && stderr.contains("unknown field `sede`"),
        "{stderr}"
    );
}
