//! Robots in Python: the tests of `sdk/python`, with the programs of this build; and the random streams of both languages,
//! side by side.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use protocol::random::{MAX_SEED, stream, unit};
use system_tests::pytest::pytest;
use system_tests::tools::lacks_tool;
use system_tests::{programs, root};

/// A Python that knows the package of this checkout.
fn python() -> Command {
    let mut python = Command::new("python3");
    python
        .current_dir(root())
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARS_")) {
        python.env_remove(name);
    }

    python.stdin(Stdio::null());
    python
}

fn package() -> PathBuf {
    root().join("sdk/python/src")
}

/// Whether there is a Python with all that is needed. If not, the test is reported as skipped.
fn is_equipped() -> bool {
    let missing = match python().args(["-c", "import zenoh, pytest, mypy"]).output() {
        Ok(output) if output.status.success() => return true,
        Ok(_) => "python3 lacks eclipse-zenoh, pytest or mypy; `pip install './sdk/python[test]'`"
            .to_owned(),
        Err(error) => format!("python3 does not run ({error}); install Python 3.10 or later"),
    };

    lacks_tool("the tests of the SDK in Python", &missing);
    false
}

#[test]
fn the_package_passes_its_tests() {
    if !is_equipped() {
        return;
    }

    let folder = root().join("sdk/python");
    pytest(&folder.join("tests"), || {
        let mut python = python();
        python.current_dir(&folder).env("CARS_BIN_DIR", programs());
        python
    });
}

/// Draws of many streams, as a program in Python prints them.
const DRAWS: &str = "
import sys
from cars_robot import stream
for line in sys.argv[1:]:
    seed, name = line.split(' ', 1)
    own = stream(int(seed), name)
    print(*(own.unit() for _ in range(100)))
";

#[test]
fn streams_draw_the_same_numbers() {
    if !is_equipped() {
        return;
    }

    let names = ["guests", "robot/Butler", "robot/Leguin#2", "", "caf\u{e9}"];
    let seeds = [0, 1, 42, 2002, MAX_SEED, u64::MAX];
    let streams: Vec<(u64, &str)> = seeds
        .into_iter()
        .flat_map(|seed| names.map(|name| (seed, name)))
        .collect();

    let arguments = streams.iter().map(|(seed, name)| format!("{seed} {name}"));
    let output = python()
        .args(["-c", DRAWS])
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );

    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(printed.lines().count(), streams.len());
    for ((seed, name), line) in streams.into_iter().zip(printed.lines()) {
        let mut own = stream(seed, name);
        // Numbers are written so that they read back to the last bit.
        let found: Vec<f64> = line.split(' ').map(|unit| unit.parse().unwrap()).collect();
        let drawn: Vec<f64> = (0..100).map(|_| unit(&mut own)).collect();
        assert_eq!(found, drawn, "seed {seed}, stream {name}");
    }
}
