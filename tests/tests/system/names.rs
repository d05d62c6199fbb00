//! Names of types: a reader who has met a name knows it everywhere.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use system_tests::root;

use super::boundaries::sources;

/// Types of several crates with one name: they are the same idea, on the two sides of a border that no dependency crosses.
const SHARED: [(&str, &str); 6] = [
    ("Blocker", "what the environment finds, and the event of it"),
    ("Cars", "what a robot sees in a tick, in Rust and in Python"),
    (
        "Pose",
        "where a robot that drives is, in messages and in the environment",
    ),
    (
        "Range",
        "a triangular distribution, in messages and in scenarios",
    ),
    (
        "Stream",
        "a stream of random numbers, in Rust and in Python",
    ),
    (
        "Velocity",
        "what a robot that drives wants, in messages and in the environment",
    ),
];

/// Whether a file of the project is part of a product: not a test, and not a skeleton of `cars new`.
fn is_of_product(file: &Path) -> bool {
    let file = file.strip_prefix(root()).unwrap();
    let mut names = file.iter().filter_map(|name| name.to_str());
    !names.any(|name| ["tests", "tests.rs", "new"].contains(&name))
}

/// The name of the type or trait that a line declares. Not those that only stand for another type in a file or an implementation, and
/// not what a macro names.
fn declared(line: &str) -> Option<&str> {
    let mut words = line.split_whitespace().peekable();
    while words.peek()?.starts_with("pub") {
        let restricted = words.next()?;
        if restricted == "pub(in" {
            words.next();
        }
    }
    let keyword = words.next()?;
    if !["struct", "enum", "trait", "type"].contains(&keyword) {
        return None;
    }
    if keyword == "type" && !line.trim_start().starts_with("pub") {
        return None;
    }

    let name = words.next()?;
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_');
    let name = &name[..end.unwrap_or(name.len())];
    Some(name).filter(|name| !name.is_empty())
}

/// For each name the crates and files that declare a type with it.
fn declarations() -> BTreeMap<String, BTreeMap<String, Vec<PathBuf>>> {
    let mut found: BTreeMap<String, BTreeMap<String, Vec<PathBuf>>> = BTreeMap::new();
    for folder in std::fs::read_dir(root().join("crates")).unwrap() {
        let folder = folder.unwrap();
        let package = folder.file_name().into_string().unwrap();
        let mut files = Vec::new();
        sources(&folder.path().join("src"), &mut files);
        for file in files.into_iter().filter(|file| is_of_product(file)) {
            let text = std::fs::read_to_string(&file).unwrap();
            let product = text.split("#[cfg(test)]").next().unwrap();
            for name in product.lines().filter_map(declared) {
                let packages = found.entry(name.to_owned()).or_default();
                packages
                    .entry(package.clone())
                    .or_default()
                    .push(file.clone());
            }
        }
    }
    found
}

#[test]
fn declarations_are_found() {
    assert_eq!(declared("pub struct Point {"), Some("Point"));
    assert_eq!(
        declared("    pub(in crate::a) enum Kind<T> {"),
        Some("Kind")
    );
    assert_eq!(
        declared("pub(crate) type Pixel = (f64, f64);"),
        Some("Pixel")
    );
    assert_eq!(declared("    type Output = Self;"), None);
    assert_eq!(declared("        pub struct $type(pub f64);"), None);
    assert_eq!(declared("// struct"), None);
    assert_eq!(declared("let structure = 1;"), None);
    assert!(declarations().len() > 500);
}

#[test]
fn a_name_is_one_type_in_a_crate() {
    for (name, packages) in declarations() {
        for files in packages.values() {
            assert_eq!(files.len(), 1, "{name} stands for several types: {files:?}");
        }
    }
}

#[test]
fn a_name_is_one_idea_in_all_crates() {
    let declarations = declarations();
    let several = declarations
        .iter()
        .filter(|(_, packages)| packages.len() > 1);
    let several: BTreeSet<&str> = several.map(|(name, _)| name.as_str()).collect();
    let shared: BTreeSet<&str> = SHARED.iter().map(|(name, _)| *name).collect();
    assert_eq!(several, shared, "name one of them otherwise");
}
