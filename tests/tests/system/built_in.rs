//! The files that come with the programs, used where the project's folder is not.

use std::collections::BTreeSet;
use std::path::Path;

use system_tests::processes::Running;
use system_tests::{Lab, assert_same, programs, root};

/// Runs `cars` in a folder of the lab without any file of the project; returns its exit status and its output.
fn elsewhere(lab: &Lab, args: &[&str]) -> (i32, String) {
    let output = lab.cars(args).current_dir(lab.out()).output().unwrap();
    let out = String::from_utf8_lossy(&output.stdout);
    let err = String::from_utf8_lossy(&output.stderr);
    (output.status.code().unwrap_or(-1), format!("{out}{err}"))
}

/// The same for subcommands that have no `--out`.
fn elsewhere_without_out(lab: &Lab, args: &[&str]) -> (i32, String) {
    let output = std::process::Command::new(programs().join("cars"))
        .current_dir(lab.out())
        .args(args)
        .output()
        .unwrap();
    let out = String::from_utf8_lossy(&output.stdout);
    let err = String::from_utf8_lossy(&output.stderr);
    (output.status.code().unwrap_or(-1), format!("{out}{err}"))
}

/// All files below a folder, by their paths there.
fn files_of(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap();
                found.insert(name.display().to_string());
            }
        }
    }
    found
}

#[test]
fn a_launch_of_a_name_is_that_of_its_file() {
    let lab = Lab::new();
    let brief = ["--duration", "5 s", "--speed", "max", "--quiet"];
    let play = |lab: &Lab, what: &[&str], run: &str| {
        let args = [what, &["--run", run], &brief].concat();
        let (_, text) = elsewhere(lab, &args);
        assert!(!text.contains("rror"), "{what:?}: {text}");
        lab.bytes(run)
    };

    let file = root().join("configs/three_robots.toml");
    let of_file = play(&lab, &["run", file.to_str().unwrap()], "file");
    let in_process = play(&lab, &["run", "three_robots"], "in-process");
    let launched = play(
        &lab,
        &["launch", "three_robots", "--no-console"],
        "launched",
    );
    assert_same(("file", &of_file), ("name, in one process", &in_process));
    assert_same(("file", &of_file), ("name, as processes", &launched));
}

#[test]
fn a_launch_of_a_name_is_resumed_in_another_folder() {
    let lab = Lab::new();
    let args = [
        "launch",
        "hors_doeuvres",
        "--no-console",
        "--paused",
        "--duration",
        "20 s",
        "--run",
        "stopped",
    ];
    let mut command = lab.cars(&args);
    command.current_dir(lab.out());
    let mut launch = Running::start(command, "stopped", lab.out().join("stopped"));
    lab.until_ready("stopped");
    lab.step("stopped", 10);
    lab.ctl("stopped", &["stop"]);
    launch.wait();

    let resumed = lab.out().join("stopped");
    let resumed = resumed.to_str().unwrap();
    lab.ok(&[
        "launch",
        "--resume",
        resumed,
        "--no-console",
        "--speed",
        "max",
    ]);
    lab.ok(&[
        "run",
        "hors_doeuvres",
        "--duration",
        "20 s",
        "--run",
        "whole",
    ]);
    assert_same(
        ("resumed", &lab.bytes("stopped")),
        ("never stopped", &lab.bytes("whole")),
    );
}

#[test]
fn init_writes_all_files_and_replaces_none() {
    let lab = Lab::new();
    let (code, text) = elsewhere_without_out(&lab, &["init", "mine"]);
    assert_eq!(code, 0, "{text}");
    let mine = lab.out().join("mine");
    let written = files_of(&mine);
    assert!(written.len() >= 16, "{written:?}");
    for name in &written {
        let text = |folder: &Path| std::fs::read_to_string(folder.join(name)).unwrap();
        assert_eq!(text(&mine), text(root().as_path()), "{name}");
    }

    // Everything that was written can be used where it is.
    for name in written.iter().filter(|name| {
        let parts = ["configs/robots", "configs/links", "configs/people"];
        !parts.iter().any(|part| name.starts_with(part))
    }) {
        let file = mine.join(name);
        let (code, text) = elsewhere_without_out(&lab, &["check", file.to_str().unwrap()]);
        assert_eq!(code, 0, "{name}: {text}");
    }

    let changed = mine.join("configs/museum.toml");
    std::fs::write(&changed, "seed = 1\n").unwrap();
    let lost = mine.join("configs/partition.toml");
    std::fs::remove_file(&lost).unwrap();
    let (code, text) = elsewhere_without_out(&lab, &["init", "mine"]);
    assert_eq!(code, 1, "{text}");
    assert!(
        text.contains("mine/configs/museum.toml has been changed"),
        "{text}"
    );
    assert!(!lost.exists(), "something was written");

    // Without the file that was changed, what is missing comes back.
    std::fs::remove_file(&changed).unwrap();
    let (code, text) = elsewhere_without_out(&lab, &["init", "mine"]);
    assert_eq!(
        (code, text.contains("2 files written")),
        (0, true),
        "{text}"
    );
    assert_eq!(files_of(&mine), written);
}

#[test]
fn every_name_can_be_checked_and_an_unknown_one_shows_them() {
    let lab = Lab::new();
    for name in [
        "hors_doeuvres",
        "museum",
        "crowded_hall",
        "walled_hall",
        "deliberate",
        "pantry",
        "affect",
        "crowd",
    ] {
        let (code, text) = elsewhere_without_out(&lab, &["check", name]);
        assert_eq!(code, 0, "{name}: {text}");
    }

    for command in ["launch", "run"] {
        let (code, text) = elsewhere(&lab, &[command, "musem"]);
        assert_eq!(code, 1, "{text}");
        assert!(text.contains("cannot read musem"), "{text}");
        assert!(
            text.contains("museum") && text.contains("three_robots"),
            "{text}"
        );
    }
    // A file comes before a name, and a path is no name.
    std::fs::write(lab.out().join("museum"), "seed = \"none\"\n").unwrap();
    let (code, text) = elsewhere(&lab, &["run", "museum"]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("museum cannot be used"), "{text}");
    let (code, text) = elsewhere(&lab, &["run", "configs/museum"]);
    assert_eq!(code, 1, "{text}");
}

#[test]
fn an_experiment_of_a_name_is_played_anywhere() {
    let lab = Lab::new();
    let folder = lab.out().join("results");
    let output = std::process::Command::new(programs().join("cars"))
        .current_dir(lab.out())
        .args(["experiment", "run", "deadlock", "--seeds", "2"])
        .args(["--duration", "1 s", "--jobs", "1", "--out"])
        .arg(&folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(folder.join("plan.json").exists(), "{:?}", files_of(&folder));
}

#[test]
fn a_manual_page_is_written_for_every_program() {
    let lab = Lab::new();
    let (code, text) = elsewhere_without_out(&lab, &["man", "pages/man1"]);
    assert_eq!(code, 0, "{text}");
    let pages = lab.out().join("pages/man1");
    for name in [
        "cars",
        "cars-launch",
        "cars-experiment-run",
        "cars-sim",
        "cars-console",
        "cars-butler",
        "cars-leguin",
        "cars-vonda",
        "cars-bidder",
        "cars-scout",
    ] {
        let page = std::fs::read_to_string(pages.join(format!("{name}.1"))).unwrap();
        assert!(page.contains(&format!(".TH {name} 1")), "{name}: {page}");
    }
    // What people do not type has no page.
    assert!(!pages.join("cars-child.1").exists());
}
