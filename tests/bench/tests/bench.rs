//! `cars-bench`, in little: every process that it starts ends, and its table has what was asked for.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use system_tests::{Lab, programs, root};

/// `cars-bench`, among the other programs, from the root of the project.
fn command(args: &[&str]) -> Command {
    let mut command = Command::new(programs().join("cars-bench"));
    command.current_dir(root()).args(args);
    command
}

/// Runs it; returns its exit status and what it prints.
fn bench(args: &[&str]) -> (i32, String) {
    let output = command(args).output().unwrap();
    let out = String::from_utf8_lossy(&output.stdout);
    let err = String::from_utf8_lossy(&output.stderr);
    (output.status.code().unwrap_or(-1), format!("{out}{err}"))
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_build_is_compared_with_its_floor_and_with_another_build() {
    let other = programs().to_str().unwrap();
    let (code, text) = bench(&[
        "--rounds",
        "2",
        "--robots",
        "3",
        "--ticks",
        "600",
        "--only",
        "bare lock-step",
        "--against",
        other,
    ]);
    assert_eq!(code, 0, "{text}");

    let cells = |name: &str| -> Vec<f64> {
        // A table that is wider than a terminal is several, each with the names.
        let lines = text.lines().filter(|line| line.contains(name));
        lines
            .flat_map(|line| line.split('│'))
            .filter_map(|cell| cell.trim().parse().ok())
            .collect()
    };
    let [median, best, worst] = cells("zenoh star, 3 clients")[..] else {
        panic!("a star has no floor here, and is no build's:\n{text}")
    };
    assert!(worst > 0.0 && worst <= median && median <= best, "{text}");
    let [median, best, worst, of_star] = cells("zenoh star with messages, 3 clients")[..] else {
        panic!("the star with messages is compared with the bare one:\n{text}")
    };
    assert!(worst > 0.0 && worst <= median && median <= best, "{text}");
    assert!(of_star > 0.0, "{text}");
    let [
        median,
        best,
        worst,
        of_star,
        of_messages,
        other,
        this_of_other,
    ] = cells("bare lock-step, 3 robots")[..]
    else {
        panic!("seven figures are expected:\n{text}")
    };
    assert!(worst > 0.0 && worst <= median && median <= best, "{text}");
    assert!(of_star > 0.0 && of_messages > 0.0, "{text}");
    assert!(other > 0.0 && this_of_other > 0.0, "{text}");
    assert!(
        !text.contains("hall"),
        "what is left out is not measured:\n{text}"
    );
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_part_of_the_hall_is_measured_whatever_a_whole_run_is_to_show() {
    let args = ["--rounds", "1", "--robots", "2", "--ticks", "6000"];
    let (code, text) = bench(&[&["--only", "the hall"], &args[..]].concat());
    assert_eq!(code, 0, "{text}");
    for subject in ["the hall, as processes", "the hall, in one process"] {
        assert!(text.contains(subject), "{text}");
    }
}

#[test]
fn a_folder_without_programs_is_refused() {
    let lab = Lab::new();
    let folder = lab.out().to_str().unwrap();
    let (code, text) = bench(&["--against", folder]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("there is no"), "{text}");
}

#[test]
fn a_benchmark_uses_a_new_folder_for_this_user_alone() {
    let lab = Lab::new();
    let temporary = lab.out().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    let shared = std::fs::Permissions::from_mode(0o1777);
    std::fs::set_permissions(&temporary, shared).unwrap();

    let mut command = command(&["--only", "hall", "--rounds", "1", "--ticks", "1000000"]);
    command.env("TMPDIR", &temporary);
    let mut bench = command.spawn().unwrap();
    let folder = system_tests::eventually("the folder", || {
        Some(std::fs::read_dir(&temporary).unwrap().next()?.unwrap())
    });
    let mode = folder.metadata().unwrap().permissions().mode();
    let name = folder.file_name().into_string().unwrap();
    let foreseeable = format!("cars-bench-{}", bench.id());
    bench.kill().unwrap();
    bench.wait().unwrap();

    assert_eq!(mode & 0o777, 0o700, "{name}");
    assert_ne!(name, foreseeable);
}
