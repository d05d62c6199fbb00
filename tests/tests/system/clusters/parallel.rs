//! GNU parallel on this machine, without ssh.

use std::process::Command;

use super::{Trial, checked, has_programs};

#[test]
fn the_printed_command_gives_the_results_of_this_machine() {
    if !has_programs("GNU parallel", &["parallel"], "parallel") {
        return;
    }
    let trial = Trial::new();
    let folder = trial.plan("the hosts' folder");
    let args = [
        "submit",
        "--engine",
        "parallel",
        "--units-per-task",
        "5",
        "--limit",
        "2",
    ];
    let commands = trial.cars(&args, &folder);

    let lines: Vec<&str> = commands.lines().collect();
    assert_eq!(lines.len(), 2, "{commands}");
    assert!(lines[0].ends_with(" 25..=29 30..=31"), "{commands}");
    let output = Command::new("sh")
        .args(["-euc", &commands])
        .output()
        .unwrap();
    checked(&output, &commands);
    trial.assert_results(&folder);
}
