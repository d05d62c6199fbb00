//! What the project is built from: advisories that `deny.toml` ignores, for as long as their reasons hold (all else in it is `cargo deny
//! check`'s), features, and the packages in `vendor`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use system_tests::{cargo, root, tools::skip};

/// A file of the project, which is in TOML.
fn toml(name: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(name)).unwrap();
    text.parse().unwrap()
}

/// The packages that are compiled for the package in a folder, and how they depend on each other; an error is what cargo says.
fn metadata(folder: &Path, more: &[&str]) -> Result<Value, String> {
    let output = cargo()
        .current_dir(folder)
        .args(["metadata", "--format-version=1"])
        .args(["--filter-platform", "x86_64-unknown-linux-gnu"])
        .args(more)
        .output()
        .unwrap();

    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok(serde_json::from_slice(&output.stdout).unwrap())
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
    let metadata = metadata(&root(), &["--offline", "--locked"]).unwrap();
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

/// The lines of `cargo tree` with these arguments: packages with their versions and features.
fn tree(arguments: &[&str]) -> BTreeSet<String> {
    let output = cargo()
        .current_dir(root())
        .args([
            "tree",
            "--offline",
            "--locked",
            "--prefix=none",
            "-f={p} {f}",
        ])
        .args(arguments)
        .output()
        .unwrap();

    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let text = String::from_utf8(output.stdout).unwrap();
    // What was listed before is marked.
    let lines = text
        .lines()
        .map(|line| line.trim_end_matches(" (*)").trim());
    lines.map(str::to_owned).collect()
}

/// Programs and SDK are built with what the workspace was built with: zenoh is compiled once (`crates/workspace-hack`).
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn zenoh_is_built_with_the_same_features_everywhere() {
    let package = |line: &str| line.split(' ').take(2).collect::<Vec<_>>().join(" ");
    let zenoh: BTreeSet<String> = tree(&["-p=zenoh", "-e=normal,build"])
        .iter()
        .map(|line| package(line))
        .collect();
    assert!(zenoh.len() > 100, "{zenoh:?}");

    let workspace = tree(&["--workspace", "-e=normal,build,dev"]);
    for program in ["cars", "console", "robots", "simulator", "robot"] {
        for line in tree(&["-p", program, "-e=normal,build"]) {
            assert!(
                !zenoh.contains(&package(&line)) || workspace.contains(&line),
                "`cargo build -p {program}` compiles zenoh again: {line}"
            );
        }
    }
}

/// The folder of a published package, which cargo downloads unless it is there; an error is what cargo says.
fn published(name: &str, version: &str) -> Result<PathBuf, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("src")).unwrap();
    std::fs::write(folder.path().join("src/lib.rs"), "").unwrap();
    // With the versions of the project, which are there.
    std::fs::copy(root().join("Cargo.lock"), folder.path().join("Cargo.lock")).unwrap();
    let manifest = format!(
        "[package]\nname = \"published\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n{name} = \"={version}\"\n"
    );
    std::fs::write(folder.path().join("Cargo.toml"), manifest).unwrap();

    let metadata = metadata(folder.path(), &[])?;
    let packages = metadata["packages"].as_array().unwrap();
    let package = packages.iter().find(|package| package["name"] == name);
    let manifest = package.unwrap()["manifest_path"].as_str().unwrap();
    Ok(Path::new(manifest).parent().unwrap().to_owned())
}

/// The names and contents of the files of a package that are compiled.
fn sources(package: &Path) -> BTreeMap<PathBuf, String> {
    let mut folders = vec![package.join("src")];
    let mut files = vec![package.join("Cargo.toml")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let kind = if path.is_dir() {
                &mut folders
            } else {
                &mut files
            };
            kind.push(path);
        }
    }

    let name = |file: &PathBuf| file.strip_prefix(package).unwrap().to_owned();
    let text = |file: &PathBuf| std::fs::read_to_string(file).unwrap();
    files.iter().map(|file| (name(file), text(file))).collect()
}

/// A package in `vendor` is the published one with the changes of its `changes.patch`, and comes with its license.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn vendored_packages_are_the_published_ones_and_their_patches() {
    for folder in std::fs::read_dir(root().join("vendor")).unwrap() {
        let folder = folder.unwrap().path();
        let manifest = toml(folder.join("Cargo.toml").to_str().unwrap());
        let name = manifest["package"]["name"].as_str().unwrap();
        let version = manifest["package"]["version"].as_str().unwrap();
        let license = std::fs::read_to_string(folder.join("LICENSE")).unwrap();
        assert!(license.contains("Apache License"), "{name}");

        let published = match published(name, version) {
            Ok(published) => published,
            Err(why) => {
                skip(
                    "vendored_packages_are_the_published_ones_and_their_patches",
                    &format!("{name} cannot be downloaded; connect to the network: {why}"),
                );
                return;
            }
        };
        let patched = tempfile::tempdir().unwrap();
        for (file, text) in sources(&published) {
            let file = patched.path().join(file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        let output = Command::new("git")
            .current_dir(patched.path())
            .arg("apply")
            .arg(folder.join("changes.patch"))
            .output()
            .unwrap();
        assert!(output.status.success(), "{name}: {output:?}");
        assert!(
            sources(patched.path()) == sources(&folder),
            "vendor/{name} is not the published package with its patch"
        );
    }
}

/// Whether rustdoc runs or compiles a block of code in these documentation comments.
fn has_example(text: &str) -> bool {
    let mut is_in_block = false;
    for line in text.lines().map(str::trim_start) {
        let comment = line.strip_prefix("//!").or(line.strip_prefix("///"));
        let Some(language) = comment.and_then(|comment| comment.trim().strip_prefix("```")) else {
            continue;
        };
        is_in_block = !is_in_block;
        let mut words = language.split([',', ' ']);
        let is_run = words.all(|word| {
            ["", "rust", "no_run", "should_panic", "compile_fail"].contains(&word)
                || word.starts_with("edition")
                || word.starts_with("E0")
        });
        if is_in_block && is_run {
            return true;
        }
    }
    false
}

/// Cargo builds and starts a test program for the examples of each library that does not state that it has none.
#[test]
fn libraries_test_their_examples_and_none_without_any() {
    let metadata = metadata(&root(), &["--offline", "--locked", "--no-deps"]).unwrap();
    let mut libraries = 0;
    for package in metadata["packages"].as_array().unwrap() {
        let folder = Path::new(package["manifest_path"].as_str().unwrap()).parent();
        let folder = folder.unwrap();
        if folder.starts_with(root().join("vendor")) {
            continue;
        }
        for target in package["targets"].as_array().unwrap() {
            let is_library = ["lib", "cdylib"].map(|kind| target["kind"][0] == kind);
            if !is_library.contains(&true) {
                continue;
            }
            let texts = sources(folder);
            let has_example = texts.values().any(|text| has_example(text));
            let name = &package["name"];
            assert_eq!(
                target["doctest"], has_example,
                "{name}: `doctest = false` belongs in [lib] if and only if no comment has an example"
            );
            libraries += 1;
        }
    }
    assert!(libraries > 20, "{libraries}");
}

#[test]
fn examples_in_comments_are_found() {
    assert!(has_example("/// ```\n/// run();\n/// ```\nfn run() {}"));
    assert!(has_example("    //! ```compile_fail,E0594\n    //! ```"));
    assert!(has_example(
        "/// ```text\n/// a\n/// ```\n/// ```no_run\n/// ```"
    ));
    assert!(!has_example("/// ```text\n/// a\n/// ```\n// ```\n"));
    assert!(!has_example("/// ```ignore\n/// ```\nlet text = \"```\";"));
}
