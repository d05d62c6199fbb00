//! Advisories that `deny.toml` ignores, for as long as their reasons hold. All else in it is `cargo deny check`'s.

use std::collections::BTreeSet;

use serde_json::Value;
use system_tests::{cargo, root};

/// A file of the project, which is in TOML.
fn toml(name: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(name)).unwrap();
    text.parse().unwrap()
}

/// The packages that are compiled, and how they depend on each other.
fn metadata() -> Value {
    let output = cargo()
        .current_dir(root())
        .args(["metadata", "--format-version=1", "--offline", "--locked"])
        .args(["--filter-platform", "x86_64-unknown-linux-gnu"])
        .output()
        .unwrap();

    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// An advisory that is ignored is about a package that is there.
#[test]
fn every_ignored_advisory_is_still_needed() {
    let deny = toml("deny.toml");
    let lock = toml("Cargo.lock");
    let mut locked = BTreeSet::new();
    for package in lock["package"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        let version = package["version"].as_str().unwrap();
        locked.insert(format!("{name} {version}"));
    }

    let ignored = deny["advisories"]["ignore"].as_array().unwrap();
    assert!(!ignored.is_empty());
    for advisory in ignored {
        let id = advisory["id"].as_str().unwrap();
        let reason = advisory["reason"].as_str().unwrap();
        let (about, why) = reason.split_once(": ").unwrap();
        assert!(
            locked.contains(about),
            "{id}: {about:?} is not in Cargo.lock"
        );
        assert!(!why.is_empty(), "{id} has no reason");
    }
}

/// Why RUSTSEC-2026-0041 can be ignored: nothing calls lz4_flex without this feature.
#[test]
fn compression_is_not_compiled_in() {
    let metadata = metadata();
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap();
    let transport = nodes
        .iter()
        .find(|node| node["id"].as_str().unwrap().contains("zenoh-transport@"));
    let features = transport.unwrap()["features"].as_array().unwrap();

    assert!(features.contains(&"transport_tcp".into()), "{features:?}");
    assert!(
        !features.contains(&"transport_compression".into()),
        "{features:?}"
    );
}
