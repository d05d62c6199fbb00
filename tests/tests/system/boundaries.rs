//! The missing arrows between crates, and between the modules of a crate, are invariants.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use system_tests::programs;

/// For each crate of this project: which others of this project it may depend on, tests included.
const ALLOWED: &[(&str, &[&str])] = &[
    ("world", &["crowd"]),
    ("radio", &[]),
    ("affect", &[]),
    ("crowd", &["pictures"]),
    ("protocol", &[]),
    ("lockstep", &["protocol"]),
    ("config", &["protocol"]),
    ("timeline", &["protocol"]),
    ("pictures", &["protocol", "timeline"]),
    ("statistics", &["protocol"]),
    ("observe", &["config", "protocol", "timeline"]),
    ("bus", &["protocol", "workspace-hack"]),
    ("recording", &["protocol", "timeline"]),
    (
        "export",
        &[
            "record",
            "affect",
            "config",
            "protocol",
            "recording",
            "timeline",
        ],
    ),
    ("terminal", &["protocol"]),
    ("robot", &["bus", "lockstep", "protocol", "terminal"]),
    ("robots", &["robot", "affect", "lockstep", "protocol"]),
    ("import", &["world", "config", "recording"]),
    (
        "scenario",
        &[
            "import",
            "world",
            "radio",
            "config",
            "lockstep",
            "observe",
            "protocol",
            "recording",
        ],
    ),
    (
        "record",
        &[
            "scenario",
            "config",
            "lockstep",
            "observe",
            "protocol",
            "recording",
            "timeline",
        ],
    ),
    (
        "environment",
        &[
            "record",
            "scenario",
            "radio",
            "world",
            "config",
            "lockstep",
            "observe",
            "pictures",
            "protocol",
            "recording",
        ],
    ),
    (
        "recorder",
        &[
            "environment",
            "record",
            "scenario",
            "lockstep",
            "protocol",
            "recording",
        ],
    ),
    (
        "simulator",
        &[
            "environment",
            "record",
            "recorder",
            "scenario",
            "world",
            "bus",
            "config",
            "lockstep",
            "protocol",
            "recording",
            "terminal",
        ],
    ),
    (
        "console",
        &[
            "bus",
            "pictures",
            "protocol",
            "recording",
            "terminal",
            "timeline",
        ],
    ),
    ("harness", &["bus", "lockstep", "protocol"]),
    ("conform", &["bus", "harness", "protocol"]),
    (
        "launch",
        &[
            "scenario", "record", "robot", "bus", "config", "protocol", "terminal",
        ],
    ),
    (
        "netem",
        &[
            "launch", "scenario", "record", "bus", "config", "protocol", "terminal",
        ],
    ),
    (
        "lab",
        &[
            "scenario",
            "record",
            "environment",
            "recorder",
            "robot",
            "robots",
            "config",
            "lockstep",
            "observe",
            "protocol",
            "recording",
        ],
    ),
    (
        "experiments",
        &[
            "bus",
            "lab",
            "scenario",
            "record",
            "robot",
            "robots",
            "config",
            "export",
            "observe",
            "protocol",
            "recording",
            "statistics",
        ],
    ),
    (
        "causes",
        &[
            "experiments",
            "lab",
            "scenario",
            "record",
            "environment",
            "robot",
            "config",
            "export",
            "observe",
            "protocol",
            "recording",
            "statistics",
            "timeline",
        ],
    ),
    (
        "hunts",
        &[
            "experiments",
            "lab",
            "scenario",
            "environment",
            "config",
            "export",
            "observe",
            "protocol",
            "timeline",
        ],
    ),
    (
        "reports",
        &[
            "experiments",
            "lab",
            "record",
            "config",
            "observe",
            "pictures",
            "protocol",
            "recording",
            "statistics",
            "timeline",
        ],
    ),
    (
        "cars",
        &[
            "affect",
            "crowd",
            "launch",
            "netem",
            "reports",
            "causes",
            "hunts",
            "experiments",
            "lab",
            "scenario",
            "record",
            "environment",
            "simulator",
            "export",
            "robot",
            "robots",
            "conform",
            "bus",
            "config",
            "protocol",
            "recording",
            "terminal",
        ],
    ),
    (
        "python-module",
        &[
            "reports",
            "causes",
            "hunts",
            "experiments",
            "lab",
            "launch",
            "scenario",
            "record",
            "robots",
            "robot",
            "bus",
            "config",
            "export",
            "protocol",
            "pictures",
            "terminal",
        ],
    ),
    (
        "bench",
        &[
            "crowd",
            "launch",
            "scenario",
            "record",
            "robot",
            "bus",
            "config",
            "protocol",
            "terminal",
            "system-tests",
        ],
    ),
    ("workspace-hack", &[]),
    ("zenoh-link-tcp", &[]),
    ("zenoh-link-tls", &["zenoh-link-tcp"]),
    ("zenoh-plugin-trait", &[]),
    (
        "system-tests",
        &[
            "scenario",
            "record",
            "environment",
            "simulator",
            "robot",
            "robots",
            "conform",
            "experiments",
            "hunts",
            "lab",
            "lockstep",
            "bus",
            "protocol",
            "recording",
            "statistics",
        ],
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

    for (name, allowed) in ALLOWED.iter().copied() {
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

/// The mangled names in a program's table of symbols.
fn symbols(program: &[u8]) -> Vec<&str> {
    program
        .split(|byte| *byte == 0)
        .filter(|symbol| symbol.starts_with(b"_ZN") || symbol.starts_with(b"_R"))
        .filter_map(|symbol| std::str::from_utf8(symbol).ok())
        .collect()
}

/// Whether symbols are of a crate, by their mangled names: the older kind, in which the crate comes first or begins the type of
/// an `impl`, and the newer one, in which the crate follows its number.
fn contain(symbols: &[&str], name: &str) -> bool {
    let length = name.len();
    let path = format!("_ZN{length}{name}");
    let type_of = format!("$LT${name}..");
    let newer = format!("_{length}{name}");

    symbols.iter().any(|symbol| {
        let follows = symbol
            .strip_prefix(&path)
            .and_then(|rest| rest.chars().next());
        follows.is_some_and(|next| next.is_ascii_digit())
            || (symbol.starts_with("_ZN") && symbol.contains(&type_of))
            || (symbol.starts_with("_R") && symbol.contains(&newer))
    })
}

#[test]
fn each_program_contains_its_own_crates_and_no_others() {
    let robot = (
        &["robots", "affect", "robot", "lockstep", "bus"][..],
        &[
            "world",
            "environment",
            "simulator",
            "scenario",
            "record",
            "lab",
            "launch",
            "netem",
        ][..],
    );
    let unemotional = (
        &["robots", "robot", "lockstep", "bus"][..],
        &[
            "affect",
            "world",
            "environment",
            "simulator",
            "scenario",
            "record",
            "lab",
            "launch",
            "netem",
        ][..],
    );
    let console = (
        &["pictures", "bus"][..],
        &[
            "world",
            "environment",
            "simulator",
            "robots",
            "affect",
            "lab",
            "launch",
            "netem",
        ][..],
    );
    let simulator = (
        &[
            "world",
            "environment",
            "simulator",
            "scenario",
            "record",
            "bus",
        ][..],
        &["affect", "robots", "robot", "lab", "launch", "netem"][..],
    );
    for (program, (own, others)) in [
        ("cars-sim", simulator),
        ("cars-console", console),
        ("cars-butler", robot),
        ("cars-leguin", robot),
        ("cars-vonda", robot),
        ("cars-bidder", unemotional),
        ("cars-scout", unemotional),
    ] {
        let bytes = std::fs::read(programs().join(program)).unwrap();
        let symbols = symbols(&bytes);
        for name in own {
            assert!(contain(&symbols, name), "{program} is without {name}");
        }
        for name in others {
            assert!(!contain(&symbols, name), "{program} contains {name}");
        }
    }
}

#[test]
fn only_bus_names_the_middleware() {
    for (name, dependencies) in dependencies() {
        assert_eq!(dependencies.contains("zenoh"), name == "bus", "{name}");
    }
}

#[test]
fn errors_are_rendered_in_one_crate() {
    for (name, dependencies) in dependencies() {
        // `bench` is a program for developers, a command line of its own.
        let may = ["config", "bench"].contains(&name.as_str());
        let does = dependencies.contains("miette");
        assert!(!does || may, "{name} must not depend on miette");
    }
}

/// All Rust files under a folder.
pub(super) fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
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
        let pure = [
            "world",
            "radio",
            "crowd",
            "affect",
            "environment",
            "lockstep",
            "pictures",
        ];
        if pure.contains(&name.as_str()) {
            for impure in ["tokio", "tracing", "zenoh", "clap", "nix"] {
                assert!(
                    !dependencies.contains(impure),
                    "{name} must not depend on {impure}"
                );
            }
        }
        if ["world", "radio", "crowd"].contains(&name.as_str()) {
            assert!(
                !dependencies.contains("serde"),
                "the environment is not a message"
            );
        }
    }
}

/// The modules of one crate: each is a file, named by its path from the crate's root (`crate` is the root itself).
struct Modules {
    /// Text of each module, without comments, strings and inline tests.
    texts: BTreeMap<String, String>,
}

impl Modules {
    /// Reads the modules that a root file declares, and those that they declare.
    fn of(root: &Path) -> Self {
        let mut modules = Self {
            texts: BTreeMap::new(),
        };
        modules.add("crate", root, root.parent().unwrap());
        modules
    }

    /// Adds a module; `folder` is where the files of its children are.
    fn add(&mut self, name: &str, file: &Path, folder: &Path) {
        let text = stripped(&std::fs::read_to_string(file).unwrap());
        let mut is_for_tests = false;
        for line in text.lines() {
            // A model or a test may use its parent's parts.
            let was_for_tests = std::mem::replace(&mut is_for_tests, line == "#[cfg(test)]");
            if was_for_tests {
                continue;
            }
            let Some((_, declared)) = line.split_once("mod ") else {
                continue;
            };
            let Some(child) = declared.strip_suffix(';') else {
                continue;
            };
            let beside = folder.join(format!("{child}.rs"));
            let within = folder.join(child).join("mod.rs");
            let file = if beside.exists() { beside } else { within };
            if file.exists() {
                self.add(&format!("{name}::{child}"), &file, &folder.join(child));
            }
        }

        self.texts.insert(name.to_owned(), text);
    }

    /// The modules that a module names in its paths.
    fn imports(&self, name: &str) -> BTreeSet<String> {
        let text = &self.texts[name];
        let mut imports = BTreeSet::new();
        for (at, first) in heads(text) {
            let parent = name.rsplit_once("::").map_or(name, |(parent, _)| parent);
            let start = match first {
                "crate" => "crate".to_owned(),
                "super" => parent.to_owned(),
                "self" => name.to_owned(),
                child if self.texts.contains_key(&format!("{name}::{child}")) => {
                    format!("{name}::{child}")
                }
                _ => continue,
            };
            // What the root re-exports is part of the crate's interface and no use of its own.
            if name == "crate" && is_in_public_use(text, at) {
                continue;
            }
            let rest = &text[at + first.len()..];
            for path in leaves(rest, &start).0 {
                imports.insert(self.module_of(&path));
            }
        }

        imports.remove(name);

        imports
    }

    /// The module in which the item at a path is.
    fn module_of(&self, path: &str) -> String {
        let mut path = path;
        while !self.texts.contains_key(path) {
            path = path.rsplit_once("::").unwrap().0;
        }
        path.to_owned()
    }

    /// Modules from which a path of imports leads back to them.
    fn in_cycles(&self) -> BTreeSet<String> {
        let mut reached: BTreeMap<&String, BTreeSet<String>> = BTreeMap::new();
        for name in self.texts.keys() {
            reached.insert(name, self.imports(name));
        }

        // As often as a path can be long.
        for _ in 0..self.texts.len() {
            let before = reached.clone();
            for targets in reached.values_mut() {
                for target in targets.clone() {
                    targets.extend(before[&target].iter().cloned());
                }
            }
        }

        reached
            .into_iter()
            .filter(|(name, targets)| targets.contains(*name))
            .map(|(name, _)| name.clone())
            .collect()
    }
}

/// A file without comments, text in quotes, and the tests at its end.
fn stripped(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let mut stripped = String::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap();
        for (index, piece) in code.split('"').enumerate() {
            if index % 2 == 0 {
                stripped += piece;
            }
        }
        stripped.push('\n');
    }

    stripped
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// First names of all paths, with their places: names before `::` that do not follow one.
fn heads(text: &str) -> Vec<(usize, &str)> {
    let mut heads = Vec::new();
    for (at, _) in text.match_indices("::") {
        let before = &text[..at];
        let begin = before
            .rfind(|c| !is_of_name(c))
            .map_or(0, |place| place + 1);
        if begin < at && !before[..begin].ends_with("::") {
            heads.push((begin, &text[begin..at]));
        }
    }

    heads
}

/// Whether a place of a file is in a `pub use` (also one that is limited to the crate).
fn is_in_public_use(text: &str, at: usize) -> bool {
    let statement = text[..at].rsplit([';', '}']).next().unwrap();
    let statement = statement.trim_start();
    statement.contains("use ") && statement.lines().any(|line| line.starts_with("pub"))
}

/// All paths of a tree such as `::a::{b, c::D}` below a path, and how much of the text they are.
fn leaves(text: &str, above: &str) -> (Vec<String>, usize) {
    let Some(below) = text.strip_prefix("::") else {
        return (vec![above.to_owned()], 0);
    };

    if let Some(list) = below.strip_prefix('{') {
        let mut paths = Vec::new();
        let mut at = 0;
        loop {
            at += list[at..].len() - list[at..].trim_start_matches([' ', '\n', ',']).len();
            if list[at..].is_empty() || list[at..].starts_with('}') {
                return (paths, at + 4);
            }
            let (more, length) = leaves(&format!("::{}", &list[at..]), above);
            paths.extend(more);
            // Without the `::` that was put before it; an alias (`a as b`) is skipped.
            at += (length - 2).max(1);
            let rest = &list[at..];
            at += rest.find([',', '}', ';']).unwrap_or(rest.len());
        }
    }

    let length = below.find(|c| !is_of_name(c)).unwrap_or(below.len());
    let path = match &below[..length] {
        "super" => above
            .rsplit_once("::")
            .map_or(above, |(parent, _)| parent)
            .to_owned(),
        "" | "self" => above.to_owned(),
        name => format!("{above}::{name}"),
    };
    let (paths, rest) = leaves(&below[length..], &path);

    (paths, 2 + length + rest)
}

/// Root files of a crate: its library and its programs.
fn roots(folder: &Path) -> Vec<PathBuf> {
    let mut roots = vec![folder.join("lib.rs"), folder.join("main.rs")];
    if let Ok(programs) = std::fs::read_dir(folder.join("bin")) {
        roots.extend(programs.map(|entry| entry.unwrap().path()));
    }
    roots.retain(|root| root.is_file());
    roots
}

#[test]
fn no_two_modules_import_each_other() {
    let mut wrong = Vec::new();
    for entry in std::fs::read_dir(system_tests::root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        for root in roots(&folder.join("src")) {
            let modules = Modules::of(&root);
            for module in modules.in_cycles() {
                let imports = modules.imports(&module);
                wrong.push(format!(
                    "{name}: {module} is in a cycle of imports; it imports {imports:?}"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn exec_knows_no_launch_files() {
    let modules = Modules::of(&system_tests::root().join("crates/launch/src/lib.rs"));
    let mut reached: BTreeSet<String> = BTreeSet::from(["crate::exec".to_owned()]);
    for name in modules.texts.keys() {
        if name.starts_with("crate::exec::") {
            reached.insert(name.clone());
        }
    }

    for _ in 0..modules.texts.len() {
        for name in reached.clone() {
            reached.extend(modules.imports(&name));
        }
    }

    for forbidden in ["crate", "crate::file", "crate::plan", "crate::launching"] {
        assert!(!reached.contains(forbidden), "exec imports {forbidden}");
    }
}

#[test]
fn cycles_of_imports_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lib.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\n");
    write("a.rs", "use crate::{b::{self, B}, c};\nstruct A;\n");
    write("b.rs", "// use crate::a::A;\nfn f() { super::c::g(); }\n");
    write(
        "c.rs",
        "fn g() {}\n#[cfg(test)]\nmod tests {\nuse crate::a::A;\n}\n",
    );
    let cycles = || Modules::of(&folder.path().join("lib.rs")).in_cycles();
    assert_eq!(cycles(), BTreeSet::new());

    write("c.rs", "fn g() -> super::a::A { todo!() }\n");
    let found: Vec<String> = cycles().into_iter().collect();
    assert_eq!(found, ["crate::a", "crate::b", "crate::c"]);

    write("c.rs", "use super::D;\n");
    assert_eq!(cycles(), BTreeSet::new());
    write("lib.rs", "mod a;\nmod b;\nmod c;\nuse c::g;\nstruct D;\n");
    let found: Vec<String> = cycles().into_iter().collect();
    assert_eq!(found, ["crate", "crate::c"]);
}

/// Most lines of code of a crate: one that is larger is several things.
const MAX_CODE_LINES: usize = 8000;
/// Fewest lines of code of a crate: one that is smaller is a module.
const MIN_CODE_LINES: usize = 300;

/// Number of lines of a file without the module of tests at its end.
fn code_lines(text: &str) -> usize {
    let mut lines = 0;
    let mut is_for_tests = false;
    for line in text.lines() {
        let begins_tests = is_for_tests && line.starts_with("mod ") && line.ends_with('{');
        if begins_tests {
            return lines - 1;
        }
        is_for_tests = line == "#[cfg(test)]";
        lines += 1;
    }
    lines
}

/// Number of lines of a crate's code, without its tests.
fn crate_lines(folder: &Path) -> usize {
    let source = folder.join("src");
    let mut files = Vec::new();
    sources(&source, &mut files);

    let is_of_tests = |file: &PathBuf| {
        let within = file.strip_prefix(&source).unwrap();
        within
            .iter()
            .any(|name| name == "tests" || name == "tests.rs")
    };
    files.retain(|file| !is_of_tests(file));
    files
        .iter()
        .map(|file| code_lines(&std::fs::read_to_string(file).unwrap()))
        .sum()
}

#[test]
fn crates_are_neither_too_large_nor_too_small() {
    let mut wrong = Vec::new();
    let mut crates = 0;
    for folder in std::fs::read_dir(system_tests::root().join("crates")).unwrap() {
        let folder = folder.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap();
        // It has dependencies only.
        if name == "workspace-hack" {
            continue;
        }
        let lines = crate_lines(&folder);
        if !(MIN_CODE_LINES..=MAX_CODE_LINES).contains(&lines) {
            wrong.push(format!("{name} has {lines} lines of code"));
        }
        crates += 1;
    }

    let why = format!("a crate has {MIN_CODE_LINES} to {MAX_CODE_LINES} lines without its tests");
    assert!(wrong.is_empty(), "{why}: {}", wrong.join(", "));
    assert!(crates > 20, "{crates}");
}

#[test]
fn lines_of_tests_are_not_counted() {
    let code = "//! A.\n\n#[cfg(test)]\nmod model;\n\nfn a() {}\n";
    assert_eq!(code_lines(code), 6);
    let tested = format!("{code}\n#[cfg(test)]\nmod tests {{\n    fn b() {{}}\n}}\n");
    assert_eq!(code_lines(&tested), 7);

    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("src");
    std::fs::create_dir_all(source.join("a/tests")).unwrap();
    for file in ["lib.rs", "a/b.rs", "a/tests.rs", "a/tests/c.rs"] {
        std::fs::write(source.join(file), &tested).unwrap();
    }
    assert_eq!(crate_lines(folder.path()), 14);
}

/// A build elsewhere, of a robot of one's own or by `cargo install`, does not read `.cargo/config.toml`: what the product needs
/// is not there.
#[test]
fn the_configuration_of_cargo_has_only_what_builds_and_tests_here_need() {
    let text = std::fs::read_to_string(system_tests::root().join(".cargo/config.toml")).unwrap();
    let config: toml::Table = text.parse().unwrap();
    let tables: Vec<&String> = config.keys().collect();
    assert_eq!(tables, ["env", "profile"]);
    let of_tests = "release.package.system-tests = { opt-level = 1 }";
    let of_tests: toml::Table = of_tests.parse().unwrap();
    assert_eq!(config["profile"].as_table(), Some(&of_tests));

    let variables = config["env"].as_table().unwrap();
    let variables: Vec<&str> = variables.keys().map(String::as_str).collect();
    // Without CFLAGS more of zstd is compiled, which recordings do not use.
    assert_eq!(variables, ["CFLAGS", "RUST_TEST_THREADS"]);

    for (file, constant) in [
        (
            "vendor/zenoh-link-tcp/src/lib.rs",
            "const TCP_LINGER_TIMEOUT: u64 = 0;",
        ),
        (
            "vendor/zenoh-link-tls/src/lib.rs",
            "const TLS_LINGER_TIMEOUT: u64 = 0;",
        ),
        (
            "vendor/zenoh-link-tls/src/lib.rs",
            "const TLS_ACCEPT_THROTTLE_TIME: u64 = 1000;",
        ),
    ] {
        let text = std::fs::read_to_string(system_tests::root().join(file)).unwrap();
        assert!(text.contains(constant), "{constant} is not in {file}");
    }
}
