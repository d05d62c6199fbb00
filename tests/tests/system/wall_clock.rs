//! The time of day is set while a run is under way.

use std::path::{Path, PathBuf};

use system_tests::processes::Running;
use system_tests::tools::lacks_tool;
use system_tests::{Lab, assert_same, eventually};

const FILE: &str = "launch/hors_doeuvres.toml";

/// The library that shows another time of day to the programs into which it is loaded.
fn faketime() -> Option<PathBuf> {
    let architectures = Path::new("/usr/lib").read_dir().ok()?.flatten();
    let found = architectures
        .map(|entry| entry.path().join("faketime/libfaketimeMT.so.1"))
        .find(|library| library.exists());
    if found.is_none() {
        lacks_tool(
            "wall_clock",
            "there is no libfaketime here (Debian: apt install libfaketime)",
        );
    }
    found
}

#[test]
fn a_time_of_day_that_is_set_back_changes_nothing_and_prints_nothing() {
    let Some(library) = faketime() else {
        return;
    };
    let lab = Lab::new();
    let run = "set-back";
    let offset = lab.write("offset", "+0");
    let args = ["--no-console", "--speed", "100", "--duration", "200 s"];
    let mut command = lab.cars(&["launch", FILE]);
    command
        .args(args)
        .args(["--run", run])
        .env("LD_PRELOAD", library)
        .env("FAKETIME_TIMESTAMP_FILE", &offset)
        .env("FAKETIME_NO_CACHE", "1")
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    let mut launch = Running::start(command, run, lab.out().join(run));

    eventually("the clock", || {
        let events = std::fs::read_to_string(lab.file(run, "events.jsonl")).ok()?;
        events.contains("\"tick\":20,").then_some(())
    });
    let year = 365 * 24 * 3600;
    std::fs::write(&offset, format!("-{year}")).unwrap();
    launch.finish();

    for process in ["simulator", "Butler", "Leguin"] {
        let log = lab.file(run, &format!("logs/{process}.log"));
        let text = std::fs::read_to_string(log).unwrap();
        assert!(!text.contains("timestamp"), "{process}: {text}");
    }
    lab.ok(&["run", FILE, "--run", "as-it-is", "--duration", "200 s"]);
    assert_same(
        ("with another time of day", &lab.bytes(run)),
        ("without", &lab.bytes("as-it-is")),
    );
}
