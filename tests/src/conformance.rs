//! Runs `cars conform` on the robots of launch files.

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

/// Asserts that a robot of a launch file keeps all rules of the protocol in the scenario of that file.
pub fn assert_conforms(launch_file: &Path, robot: &str) {
    let text = std::fs::read_to_string(launch_file).expect("the launch file");
    let file: LaunchFile = toml::from_str(&text).expect("a launch file");
    let mut processes = file.process.into_iter();
    let process = processes.find(|process| process.name == robot);
    let mut words = process.expect("a process of this name").command;

    // Like the launcher, before a `--`: what follows belongs to another program.
    let end = words.iter().position(|word| word == "--");
    let at = end.unwrap_or(words.len());
    words.splice(at..at, ["--name".to_owned(), robot.to_owned()]);
    let own = programs().join(&words[0]);
    if own.exists() {
        words[0] = own.display().to_string();
    }

    let output = Command::new(programs().join("cars"))
        .current_dir(launch_file.parent().expect("a folder"))
        .args(["conform", "--name", robot])
        .args(["--scenario", &file.scenario, "--"])
        .args(&words)
        .env("PYTHONPATH", crate::python::package())
        .output()
        .expect("cars");
    let printed = [&output.stdout, &output.stderr]
        .map(|text| String::from_utf8_lossy(text))
        .concat();
    assert!(
        output.status.success(),
        "{robot} of {}: {printed}",
        launch_file.display()
    );
    assert!(printed.contains(" 0 failed"), "{printed}");
}
