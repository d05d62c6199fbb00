//! Standard output and standard error that cannot be written: a reader that has gone, a full disk, a closed terminal.

use std::fs::File;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use system_tests::{Lab, PROGRAMS, programs, root, subcommands_in};

/// A pipe whose reader has gone.
fn closed() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

/// A device on which there is never room.
fn full() -> Stdio {
    File::options()
        .write(true)
        .open("/dev/full")
        .unwrap()
        .into()
}

fn program(name: &str, args: &[&str]) -> Command {
    let mut command = Command::new(programs().join(name));
    command.current_dir(root()).args(args).stdin(Stdio::null());
    command
}

/// What a program prints as errors, and its exit status, with this standard output.
fn with_output(name: &str, args: &[&str], output: Stdio) -> (String, Option<i32>) {
    let command = program(name, args).stdout(output).output();
    let Output { status, stderr, .. } = command.unwrap();
    (String::from_utf8_lossy(&stderr).into_owned(), status.code())
}

#[track_caller]
fn check_output(name: &str, args: &[&str]) {
    let (stderr, code) = with_output(name, args, closed());
    assert_eq!(code, Some(0), "{name} {args:?}, without a reader: {stderr}");
    assert!(!stderr.contains("rror"), "{name} {args:?}: {stderr}");

    let (stderr, code) = with_output(name, args, full());
    assert_eq!(code, Some(1), "{name} {args:?}, without room: {stderr}");
    assert!(
        stderr.contains("No space left on device") && !stderr.contains("panicked"),
        "{name} {args:?}: {stderr}"
    );
}

/// The subcommands that `cars --help` lists.
fn subcommands() -> Vec<String> {
    let output = program("cars", &["--help"]).output().unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    subcommands_in(&help)
}

#[test]
fn help_without_a_reader_or_without_room_is_no_panic() {
    for name in PROGRAMS {
        check_output(name, &["--help"]);
        check_output(name, &["--version"]);
    }
    for name in subcommands().iter().filter(|name| *name != "help") {
        check_output("cars", &[name, "--help"]);
    }
}

#[test]
fn output_without_a_reader_or_without_room_is_no_panic() {
    let lab = Lab::new();
    lab.ok(&[
        "run",
        "configs/hors_doeuvres.toml",
        "--run",
        "first",
        "--duration",
        "20 s",
    ]);
    let out = lab.out().to_str().unwrap();
    let launch = "launch/hors_doeuvres.toml";
    let certificates = lab.out().join("certificates");
    let certificates = certificates.to_str().unwrap();
    let experiment = lab.out().join("experiment");
    let experiment = experiment.to_str().unwrap();
    let short = ["--seeds", "2", "--duration", "20 s", "-o", experiment];
    let deadlock = [&["experiment", "run", "deadlock"], short.as_slice()].concat();

    for args in [
        vec!["check", launch],
        vec!["completions", "bash"],
        vec!["launch", launch, "--dry-run"],
        vec!["launch", launch, "--export", "compose"],
        vec![
            "launch",
            launch,
            "--no-console",
            "--duration",
            "5 s",
            "--run",
            "second",
            "--out",
            out,
        ],
        vec![
            "run",
            launch,
            "--duration",
            "5 s",
            "--run",
            "third",
            "--out",
            out,
        ],
        vec!["log", "--run", "first", "--out", out],
        vec!["export", "first", "--emotionml", "--out", out],
        vec![
            "secure",
            "init",
            certificates,
            "--robots",
            "Butler",
            "--force",
        ],
        deadlock.clone(),
        [deadlock.as_slice(), &["--json"]].concat(),
    ] {
        check_output("cars", &args);
    }

    // Each makes a folder of its own.
    for (name, output, code) in [("Ada", closed(), 0), ("Bob", full(), 1)] {
        let args = ["new", "robot", name, "--lang", "bash", "--out", out];
        let (stderr, exited) = with_output("cars", &args, output);
        assert_eq!(exited, Some(code), "{stderr}");
    }
}

#[test]
fn an_error_decides_the_exit_status_without_a_reader() {
    let lab = Lab::new();
    let bad = lab.write("bad.toml", "sede = 1\n");
    let bad = bad.to_str().unwrap();
    let silent: [(&str, &[&str]); 5] = [
        ("cars", &["check", "configs/three_robots.toml", bad]),
        ("cars", &["run", bad]),
        ("cars-sim", &[bad]),
        (
            "cars-butler",
            &["--connect", "tcp/127.0.0.1:1", "--patience-s", "0.1"],
        ),
        ("cars-console", &["--recording", "/nowhere"]),
    ];

    for (name, args) in silent {
        for streams in [closed, full] {
            let mut command = program(name, args);
            command
                .stdout(closed())
                .stderr(streams())
                .env("RUST_LOG", "debug");
            assert_eq!(command.status().unwrap().code(), Some(1), "{name} {args:?}");
        }
    }
    let usage = program("cars", &["launch"]).stderr(full()).status();
    assert_eq!(usage.unwrap().code(), Some(2));
}

#[test]
fn a_launch_survives_its_terminal() {
    let lab = Lab::new();
    for (run, streams) in [("closed", closed as fn() -> Stdio), ("full", full)] {
        let mut command = lab.cars(&["launch", "launch/hors_doeuvres.toml", "--duration", "20 s"]);
        command
            .args(["--run", run, "--no-console"])
            .env("RUST_LOG", "debug");
        let status = command
            .stdout(streams())
            .stderr(streams())
            .status()
            .unwrap();

        // The table at the end is output that is missing; a reader that has gone wants none.
        assert_eq!(status.code(), Some(if run == "closed" { 0 } else { 1 }));
        let last = lab.events(run).pop().unwrap();
        assert_eq!(last["event"], "end");
        assert_eq!(lab.summary(run)["end"], "finished");
        let logs: PathBuf = lab.file(run, "logs");
        for log in std::fs::read_dir(logs).unwrap() {
            let text = std::fs::read_to_string(log.unwrap().path()).unwrap();
            assert!(!text.contains("panicked"), "{text}");
        }
    }
}

/// Three ticks of 25 ms end at 0.075 s, which is not 3 * 0.025 in floating point.
#[test]
fn times_have_the_decimals_of_the_tick_and_are_the_same_in_every_table() {
    let lab = Lab::new();
    let scenario = "tick = \"25 ms\"\nduration = \"100 ms\"\n[[robot]]\nname = \"Butler\"\nat = [\"5 m\", \"5 m\"]\n";
    let scenario = lab.write("quick.toml", scenario).display().to_string();
    let printed = lab.ok(&["run", &scenario, "--run", "decimals"]);
    assert!(printed.contains("after 0.100 s (4 ticks)"), "{printed}");

    let log = std::fs::read_to_string(lab.file("decimals", "cars.log")).unwrap();
    let times: Vec<&str> = log
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(times.first(), Some(&"0.000"), "{log}");
    assert_eq!(times.last(), Some(&"0.100"), "{log}");

    let to = lab.out().join("tables").display().to_string();
    lab.ok(&["export", "decimals", "-o", &to, "--csv"]);
    for table in ["events", "states"] {
        let file = lab.out().join("tables").join(format!("{table}.csv"));
        let text = std::fs::read_to_string(file).unwrap();
        let at_3 = text.lines().find(|line| line.starts_with("1,3,")).unwrap();
        assert!(at_3.starts_with("1,3,0.075,"), "{table}: {at_3}");
    }
}
