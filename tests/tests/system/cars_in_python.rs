//! Python: the tests of `sdk/python` over the module of this build, with the programs of this build; the random streams of both
//! languages, side by side; and the wheel, from `pip install` to a robot of one's own.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use protocol::random::{MAX_SEED, stream, unit};
use system_tests::pytest::{Choice, pytest};
use system_tests::python::python;
use system_tests::tools::lacks_tool;
use system_tests::{Lab, PROGRAMS, cargo, programs, root};

/// Whether there is a Python with all that is needed. If not, the test is reported as skipped.
fn is_equipped(modules: &str) -> bool {
    let missing = match python().args(["-c", &format!("import {modules}")]).output() {
        Ok(output) if output.status.success() => return true,
        Ok(_) => format!(
            "python3 lacks one of {modules}; the head of .ci/run says how they are installed"
        ),
        Err(error) => format!("python3 does not run ({error}); install Python 3.9 or later"),
    };

    lacks_tool("a test of the module for Python", &missing);
    false
}

#[test]
fn the_package_passes_its_tests() {
    test_the_package(Choice::Usual);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_package_passes_its_long_tests() {
    test_the_package(Choice::Thorough);
}

fn test_the_package(choice: Choice) {
    if !is_equipped(
        "cars, zenoh, pytest, mypy, pandas, pyarrow, polars, numpy, gymnasium, pettingzoo",
    ) {
        return;
    }

    let folder = root().join("sdk/python");
    pytest(&folder.join("tests"), choice, || {
        let mut python = python();
        python.current_dir(&folder).env("CARS_BIN_DIR", programs());
        python
    });
}

/// Draws of many streams, as a program in Python prints them.
const DRAWS: &str = "
import sys
from cars import stream
for line in sys.argv[1:]:
    seed, name = line.split(' ', 1)
    own = stream(int(seed), name)
    print(*(own.unit() for _ in range(100)))
";

#[test]
fn streams_draw_the_same_numbers() {
    if !is_equipped("cars") {
        return;
    }

    let names = ["guests", "robot/Butler", "robot/Leguin#2", "", "caf\u{e9}"];
    let seeds = [0, 1, 42, 2002, MAX_SEED, u64::MAX];
    let streams: Vec<(u64, &str)> = seeds
        .into_iter()
        .flat_map(|seed| names.map(|name| (seed, name)))
        .collect();

    let arguments = streams.iter().map(|(seed, name)| format!("{seed} {name}"));
    let printed = ok(python().args(["-c", DRAWS]).args(arguments));
    assert_eq!(printed.lines().count(), streams.len());
    for ((seed, name), line) in streams.into_iter().zip(printed.lines()) {
        let mut own = stream(seed, name);
        // Numbers are written so that they read back to the last bit.
        let found: Vec<f64> = line.split(' ').map(|unit| unit.parse().unwrap()).collect();
        let drawn: Vec<f64> = (0..100).map(|_| unit(&mut own)).collect();
        assert_eq!(found, drawn, "seed {seed}, stream {name}");
    }
}

/// Runs a command to its end, which must be a success, and returns what it printed.
fn ok(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().unwrap();
    let stdout = String::from_utf8_lossy(&stdout).into_owned();
    assert!(
        status.success(),
        "{command:?}: {status}\n{stdout}\n{}",
        String::from_utf8_lossy(&stderr)
    );
    stdout
}

/// Builds the wheel in the profile of this test, and returns its path.
fn wheel(folder: &Path) -> PathBuf {
    // What the wheel is made of is built with the variables of cargo as they are for people.
    let cargo = cargo();
    let mut build = Command::new("python3");
    for (name, value) in cargo.get_envs() {
        match value {
            Some(value) => build.env(name, value),
            None => build.env_remove(name),
        };
    }
    ok(build
        .current_dir(root())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .args(["sdk/python/build_wheel.py", "--profile", "release", "--out"])
        .arg(folder));
    let mut entries = std::fs::read_dir(folder).unwrap();
    entries.next().unwrap().unwrap().path()
}

/// A fresh environment, which sees what is installed on this machine, but not this checkout. Returns its folder of programs.
fn environment(folder: &Path) -> PathBuf {
    ok(python().args(["-m", "venv"]).arg(folder));
    let path = "import sysconfig; print(sysconfig.get_path('purelib'), end='')";
    let here = ok(python().args(["-c", path]));
    let bin = folder.join("bin");
    let there = ok(Command::new(bin.join("python3")).args(["-c", path]));
    std::fs::write(Path::new(&there).join("installed.pth"), here).unwrap();
    bin
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_researcher_installs_the_wheel_and_works() {
    if !is_equipped("cars, pandas, pyarrow, matplotlib, IPython, pip, venv") {
        return;
    }
    if Command::new("maturin").arg("--version").output().is_err() {
        lacks_tool(
            "the test of the wheel",
            "there is no maturin: `pip install maturin`",
        );
        return;
    }

    let lab = Lab::new();
    let wheel = wheel(&lab.out().join("wheels"));
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(
        name.starts_with("cars_simulator-0.1.0-cp39-abi3-"),
        "{name}"
    );
    let megabytes = std::fs::metadata(&wheel).unwrap().len() >> 20;
    assert!(megabytes < 100, "the wheel has {megabytes} MiB");

    let bin = environment(&lab.out().join("venv"));
    // As it is for somebody who has no checkout: in another folder, with no other program of CARS in the path.
    let away = lab.out().join("away");
    std::fs::create_dir(&away).unwrap();
    let path = format!("{}:/usr/bin:/bin", bin.display());
    let installed = |program: &str| {
        let mut command = Command::new(bin.join(program));
        command
            .current_dir(&away)
            .env("PATH", &path)
            .env_remove("PYTHONPATH")
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
    };
    let arguments = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index"];
    ok(installed("python3").args(arguments).arg(&wheel));

    for program in PROGRAMS {
        let version = ok(installed(program).arg("--version"));
        assert!(version.ends_with("0.1.0\n"), "{program}: {version}");
    }

    let session = root().join("sdk/python/tests/session.py");
    let said = ok(installed("python3").arg(session));
    assert!(said.ends_with("done\n"), "{said}");

    // A robot of one's own as a process, from the skeleton to the conformance kit.
    ok(installed("cars").args(["new", "robot", "Rosie", "--lang", "python"]));
    let launch = [
        "launch",
        "Rosie/launch.toml",
        "--no-console",
        "-q",
        "--speed",
        "max",
    ];
    ok(installed("cars").args(launch).args(["--duration", "60 s"]));
    let conform = [
        "conform",
        "--scenario",
        "Rosie/launch.toml",
        "--",
        "Rosie/robot.py",
    ];
    let printed = ok(installed("cars").args(conform));
    assert!(
        printed.contains("# Rosie: ") && printed.contains(" 0 failed"),
        "{printed}"
    );
}
