//! Programs that were built on one machine and run on another one do not show folders of the first.

use std::net::TcpListener;
use std::process::Command;

use system_tests::{Lab, programs, root};

#[test]
fn a_skeleton_needs_the_folder_of_the_project_where_it_is_not_around() {
    let elsewhere = tempfile::tempdir().unwrap();
    let cars = elsewhere.path().join("cars");
    std::fs::copy(programs().join("cars"), &cars).unwrap();
    let output = Command::new(cars)
        .current_dir(elsewhere.path())
        .args(["new", "robot", "Rosie", "--lang", "rust"])
        .output()
        .unwrap();

    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("--cars DIR"), "{text}");
    assert!(!text.contains(root().to_str().unwrap()), "{text}");
}

#[test]
fn errors_of_the_middleware_name_no_sources() {
    let lab = Lab::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let output = Command::new(programs().join("cars-sim"))
        .current_dir(root())
        .args(["configs/three_robots.toml", "--listen", &endpoint, "--out"])
        .arg(lab.out())
        .output()
        .unwrap();

    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("cannot listen at"), "{text}");
    assert!(!text.contains(".rs:"), "{text}");
}
