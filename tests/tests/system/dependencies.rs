//! What `deny.toml` states about dependencies, for machines without `cargo deny`. Advisories are the exception: their database
//! is not part of the project.

use std::collections::BTreeSet;
use std::iter::Peekable;
use std::process::Command;
use std::str::SplitWhitespace;

use serde_json::Value;
use system_tests::{cargo, root};

/// A file of the project, which is in TOML.
fn toml(name: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(name)).unwrap();
    text.parse().unwrap()
}

/// The texts of an array.
fn texts(array: &toml::Value) -> BTreeSet<&str> {
    let array = array.as_array().unwrap();
    array.iter().map(|text| text.as_str().unwrap()).collect()
}

/// The packages that are compiled, and how they depend on each other.
fn metadata(deny: &toml::Table) -> Value {
    let mut command: Command = cargo();
    command
        .current_dir(root())
        .args(["metadata", "--format-version=1", "--offline", "--locked"]);
    for target in texts(&deny["graph"]["targets"]) {
        command.args(["--filter-platform", target]);
    }

    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Name and version.
fn title(package: &Value) -> String {
    let name = package["name"].as_str().unwrap();
    let version = package["version"].as_str().unwrap();
    format!("{name} {version}")
}

#[test]
fn every_license_is_allowed() {
    let deny = toml("deny.toml");
    let allowed = texts(&deny["licenses"]["allow"]);
    let metadata = metadata(&deny);
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100, "{} packages", packages.len());

    let mut refused = Vec::new();
    for package in packages {
        let license = package["license"].as_str().unwrap_or_default();
        if !is_allowed(license, &allowed) {
            refused.push(format!("{}: {license:?}", title(package)));
        }
    }
    assert!(refused.is_empty(), "not in deny.toml: {refused:#?}");
}

#[test]
fn every_package_is_from_a_known_source() {
    let deny = toml("deny.toml");
    let sources = &deny["sources"];
    assert_eq!(sources["unknown-registry"].as_str(), Some("deny"));
    assert_eq!(sources["unknown-git"].as_str(), Some("deny"));
    let registries = texts(&sources["allow-registry"]);
    let lock = toml("Cargo.lock");

    let mut refused = Vec::new();
    for package in lock["package"].as_array().unwrap() {
        // Packages of this workspace have none.
        let Some(source) = package.get("source") else {
            continue;
        };
        let source = source.as_str().unwrap();
        let registry = source.strip_prefix("registry+").unwrap_or_default();
        if !registries.contains(registry) {
            refused.push(format!("{}: {source}", package["name"]));
        }
    }
    assert!(refused.is_empty(), "not in deny.toml: {refused:#?}");
}

#[test]
fn every_dependency_states_a_version() {
    let deny = toml("deny.toml");
    assert_eq!(deny["bans"]["wildcards"].as_str(), Some("deny"));
    assert_eq!(deny["bans"]["allow-wildcard-paths"].as_bool(), Some(true));

    let mut refused = Vec::new();
    for package in metadata(&deny)["packages"].as_array().unwrap() {
        for dependency in package["dependencies"].as_array().unwrap() {
            if dependency["req"] == "*" && dependency["path"].is_null() {
                refused.push(format!("{}: {}", title(package), dependency["name"]));
            }
        }
    }
    assert!(refused.is_empty(), "any version will do: {refused:#?}");
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
    let metadata = metadata(&toml("deny.toml"));
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

/// Whether a license expression (SPDX 2.3, annex D) is satisfied by licenses that are allowed. `/` is crates.io's old form of
/// `OR`.
fn is_allowed(expression: &str, allowed: &BTreeSet<&str>) -> bool {
    let spaced = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    let is_allowed = alternatives(&mut words, allowed);

    is_allowed && words.next().is_none()
}

fn alternatives(words: &mut Peekable<SplitWhitespace>, allowed: &BTreeSet<&str>) -> bool {
    let mut is_allowed = conjunction(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        is_allowed |= conjunction(words, allowed);
    }
    is_allowed
}

fn conjunction(words: &mut Peekable<SplitWhitespace>, allowed: &BTreeSet<&str>) -> bool {
    let mut is_allowed = license(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        is_allowed &= license(words, allowed);
    }
    is_allowed
}

fn license(words: &mut Peekable<SplitWhitespace>, allowed: &BTreeSet<&str>) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let is_allowed = alternatives(words, allowed);
        return words.next_if_eq(&")").is_some() && is_allowed;
    }

    let mut license = words.next().unwrap_or_default().to_owned();
    if words.next_if_eq(&"WITH").is_some() {
        let exception = words.next().unwrap_or_default();
        license = format!("{license} WITH {exception}");
    }
    allowed.contains(license.as_str())
}

#[test]
fn license_expressions_are_understood() {
    let allowed = BTreeSet::from(["MIT", "ISC", "Apache-2.0 WITH LLVM-exception"]);

    for expression in [
        "MIT",
        "GPL-3.0 OR MIT",
        "GPL-3.0/MIT",
        "MIT AND ISC",
        "GPL-3.0 OR MIT AND ISC",
        "(GPL-3.0 OR MIT) AND ISC",
        "Apache-2.0 WITH LLVM-exception",
    ] {
        assert!(is_allowed(expression, &allowed), "{expression}");
    }
    for expression in [
        "",
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "(MIT OR ISC) AND GPL-3.0",
        "Apache-2.0",
        "MIT WITH LLVM-exception",
        "(MIT",
        "MIT)",
        "MIT ISC",
    ] {
        assert!(!is_allowed(expression, &allowed), "{expression}");
    }
}
