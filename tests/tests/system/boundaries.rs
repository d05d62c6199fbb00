//! The missing arrows between crates are invariants.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// For each crate of this project: which others of this project it may depend on, tests included.
const ALLOWED: [(&str, &[&str]); 11] = [
    ("world", &[]),
    ("affect", &[]),
    ("protocol", &[]),
    ("bus", &["protocol"]),
    ("robot", &["bus", "protocol"]),
    ("robots", &["robot", "affect"]),
    ("simulator", &["world", "bus", "protocol"]),
    ("console", &["bus", "protocol"]),
    ("conform", &["bus", "protocol"]),
    (
        "cars",
        &[
            "simulator",
            "robot",
            "robots",
            "affect",
            "conform",
            "bus",
            "protocol",
        ],
    ),
    (
        "system-tests",
        &["simulator", "robot", "robots", "conform", "bus", "protocol"],
    ),
];

fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let output = cargo
        .current_dir(system_tests::root())
        .args(["metadata", "--format-version", "1", "--no-deps"])
        .output();
    let metadata: serde_json::Value = serde_json::from_slice(&output.unwrap().stdout).unwrap();
    let names = |list: &serde_json::Value| -> BTreeSet<String> {
        list.as_array()
            .unwrap()
            .iter()
            .map(|entry| entry["name"].as_str().unwrap().to_owned())
            .collect()
    };
    let packages = metadata["packages"].as_array().unwrap();
    packages
        .iter()
        .map(|p| {
            (
                p["name"].as_str().unwrap().to_owned(),
                names(&p["dependencies"]),
            )
        })
        .collect()
}

#[test]
fn crates_depend_only_on_what_their_layer_allows() {
    let found = dependencies();
    let ours: BTreeSet<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    assert_eq!(
        found.keys().map(String::as_str).collect::<BTreeSet<_>>(),
        ours,
        "a crate came or went"
    );
    for (name, allowed) in ALLOWED {
        for dependency in found[name]
            .iter()
            .filter(|dependency| ours.contains(dependency.as_str()))
        {
            assert!(
                allowed.contains(&dependency.as_str()),
                "{name} must not depend on {dependency}"
            );
        }
    }
}

#[test]
fn only_bus_names_the_middleware() {
    for (name, dependencies) in dependencies() {
        assert_eq!(dependencies.contains("zenoh"), name == "bus", "{name}");
    }
}

/// All Rust files under a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        match entry.path() {
            path if path.is_dir() => sources(&path, found),
            path if path.extension().is_some_and(|extension| extension == "rs") => found.push(path),
            _ => {}
        }
    }
}

#[test]
fn one_file_names_the_middleware() {
    let mut files = Vec::new();
    sources(&system_tests::root().join("crates"), &mut files);
    let names_it = |file: &PathBuf| std::fs::read_to_string(file).unwrap().contains("zenoh::");
    let naming: Vec<_> = files.into_iter().filter(names_it).collect();
    assert!(
        matches!(&naming[..], [one] if one.ends_with("bus/src/middleware.rs")),
        "{naming:?}"
    );
}

#[test]
fn the_pure_crates_know_no_clock_no_network_and_no_files() {
    for (name, dependencies) in dependencies() {
        if name == "world" || name == "affect" {
            for impure in ["tokio", "tracing", "zenoh", "clap", "nix"] {
                assert!(
                    !dependencies.contains(impure),
                    "{name} must not depend on {impure}"
                );
            }
        }
        if name == "world" {
            assert!(
                !dependencies.contains("serde"),
                "the environment is not a message"
            );
        }
    }
}
