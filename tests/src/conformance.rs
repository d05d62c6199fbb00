//! `cars conform` on robots as launch files start them.

use std::path::Path;
use std::process::Command;

use crate::programs;

#[derive(serde::Deserialize)]
struct LaunchFile {
    scenario: String,
    process: Vec<Process>,
}

#[derive(serde::Deserialize)]
struct Process {
    name: String,
    command: Vec<String>,
}

/// Demands that a robot of a launch file keeps every rule of the protocol, in the scenario of that file.
pub fn assert_conforms(launch_file: &Path, robot: &str) {
    let text = std::fs::read_to_string(launch_file).expect("the launch file");
    let file: LaunchFile = toml::from_str(&text).expect("a launch file");
    let process = file
        .process
        .into_iter()
        .find(|process| process.name == robot)
        .expect("a process of this name");
    let mut words = process.command;

    // As the launcher does: what stands after a `--` is the program's own.
    let at = words
        .iter()
        .position(|word| word == "--")
        .unwrap_or(words.len());
    words.splice(at..at, ["--name".to_owned(), robot.to_owned()]);
    let own = programs().join(&words[0]);
    if own.exists() {
        words[0] = own.display().to_string();
    }

    let output = Command::new(programs().join("cars"))
        .current_dir(launch_file.parent().expect("a folder"))
        .args([
            "conform",
            "--name",
            robot,
            "--scenario",
            &file.scenario,
            "--",
        ])
        .args(&words)
        .env("PYTHONPATH", crate::root().join("sdk/python/src"))
        .output()
        .expect("cars");
    let said = [&output.stdout, &output.stderr]
        .map(|text| String::from_utf8_lossy(text))
        .concat();
    assert!(
        output.status.success(),
        "{robot} of {}: {said}",
        launch_file.display()
    );
    assert!(said.contains(" 0 failed"), "{said}");
}
