//! `cars why`: what cannot be asked, and answers that are interrupted.

use std::path::PathBuf;
use std::process::Stdio;

use nix::sys::signal::Signal;
use system_tests::processes::send;
use system_tests::{Lab, assert_same, eventually};

const HALL: &str = "configs/hors_doeuvres.toml";

/// A lab with a recorded run of the hall.
fn recorded(duration: &str) -> Lab {
    let lab = Lab::new();
    lab.ok(&["run", HALL, "--run", "hall", "--duration", duration, "-q"]);
    lab
}

#[test]
fn what_cannot_be_asked_is_refused() {
    let lab = recorded("20 s");
    for (what, reason) in [
        ("no robot overlaps", "it has \"no robot overlaps another\""),
        ("wall.elapsed_s", "is wall clock"),
        ("robots.Butler.blockd", "robots.*.blocked"),
        ("{ robot = 1 }", "never = { robot = 1 }"),
        (
            "{ robot = \"Butlr\", behavior = \"WAIT\" }",
            "never = { robot = \"Butlr\", behavior = \"WAIT\" }",
        ),
    ] {
        let (status, printed) = lab.fails(&["why", "hall", what]);
        assert_eq!(status, 1, "{what}: {printed}");
        let words: Vec<&str> = printed
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect();
        assert!(words.join(" ").contains(reason), "{what}: {printed}");
    }
    let (status, printed) = lab.fails(&["why", "hall", "--budget", "0"]);
    assert_eq!(status, 2, "{printed}");
    assert!(printed.contains("at least 1 fork"), "{printed}");
    assert!(!lab.file("hall", "why").exists());
}

/// The file of the forks of the only question.
fn forks(lab: &Lab) -> Option<PathBuf> {
    let files = std::fs::read_dir(lab.file("hall", "why")).ok()?;
    let mut paths = files.filter_map(|file| Some(file.ok()?.path()));
    paths.find(|path| path.extension().is_some_and(|end| end == "jsonl"))
}

#[test]
fn an_interrupted_answer_keeps_its_forks() {
    let lab = recorded("120 s");
    let ask = ["why", "hall", "robots.Butler.blocked"];
    let mut command = lab.cars(&ask);
    let why = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let why = why.spawn().unwrap();
    eventually("some forks", || {
        let kept = std::fs::read_to_string(forks(&lab)?).ok()?;
        (kept.lines().count() > 20).then_some(())
    });
    send(why.id(), Signal::SIGINT);
    let output = why.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("the same command goes on"), "{errors}");

    let kept = std::fs::read(forks(&lab).unwrap()).unwrap();
    let played = kept.iter().filter(|byte| **byte == b'\n').count();
    let budget = played.to_string();
    let printed = lab.ok(&["why", "hall", "robots.Butler.blocked", "--budget", &budget]);
    assert!(printed.contains("The budget ended"), "{printed}");
    let after = std::fs::read(forks(&lab).unwrap()).unwrap();
    assert_same(("kept", &kept), ("then", &after[..kept.len()]));
}
