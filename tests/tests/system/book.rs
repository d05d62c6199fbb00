//! The pages of the project: every link leads somewhere, on a repository page and in the book that `mdbook build` makes of
//! docs/, the book has every page, and what pages show of files and commands is right.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use protocol::keys::{QUERIES, STATE};
use system_tests::python::python;
use system_tests::{Lab, programs, root, subcommands_in};

/// Pages that are not in the book.
const OTHERS: [&str; 5] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "sdk/python/README.md",
    "sdk/stdio/README.md",
];

fn docs() -> PathBuf {
    root().join("docs")
}

fn read(page: &Path) -> String {
    std::fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// All pages in a folder.
fn pages(folder: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(pages(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.insert(path);
        }
    }

    found
}

/// A page without its blocks of code, line by line.
fn prose(page: &str) -> Vec<&str> {
    let mut lines = Vec::new();
    let mut is_code = false;
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            lines.push(line);
        }
    }

    lines
}

/// Where the links and pictures of a page lead.
fn links(page: &str) -> Vec<String> {
    let text = prose(page).join("\n");
    let mut found = Vec::new();
    for (begin, end) in [("](", ')'), ("src=\"", '"'), ("srcset=\"", '"')] {
        let rests = text.split(begin).skip(1);
        let links = rests.filter_map(|rest| rest.split_once(end));
        found.extend(links.map(|(to, _)| to.to_owned()));
    }

    found
}

/// A heading as GitHub and mdBook name it in links.
pub(crate) fn anchor(heading: &str) -> String {
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || *c == ' ' || *c == '-' || *c == '_');
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

fn anchors(page: &str) -> BTreeSet<String> {
    let lines = prose(page).into_iter();

    lines
        .filter(|line| line.starts_with('#'))
        .map(|line| anchor(line.trim_start_matches('#').trim()))
        .collect()
}

#[test]
fn every_link_leads_somewhere() {
    let mut all = pages(&docs());
    all.extend(OTHERS.map(|page| root().join(page)));
    let mut count = 0;

    for path in all {
        for link in links(&read(&path)) {
            let place = format!("{}: {link}", path.display());
            count += 1;
            if link.starts_with("https://") {
                continue;
            }

            let (file, section) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => path.clone(),
                file => path.parent().unwrap().join(file),
            };
            assert!(target.exists(), "{place}");
            if !section.is_empty() {
                assert!(anchors(&read(&target)).contains(section), "{place}");
            }

            // A site has the files of docs/ and nothing else of the project.
            if path.starts_with(docs()) {
                assert!(
                    !file.contains(".."),
                    "{place} is not in the book: name it as code"
                );
                assert!(
                    target.is_file(),
                    "{place} is no file, so the book does not have it"
                );
            }
        }
    }

    assert!(count > 200, "{count}");
}

#[test]
fn the_book_has_every_page() {
    let summary = docs().join("SUMMARY.md");
    let links = links(&read(&summary));
    let listed: BTreeSet<PathBuf> = links.iter().map(|link| docs().join(link)).collect();
    assert_eq!(listed.len(), links.len(), "a page is in SUMMARY.md twice");

    let mut expected = pages(&docs());
    expected.remove(&summary);
    assert_eq!(listed, expected);
}

#[test]
fn the_page_of_commands_names_them_all() {
    let mut cars = Command::new(programs().join("cars"));
    let help = cars.arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let page = read(&docs().join("commands.md"));
    for name in subcommands_in(&help) {
        assert!(page.contains(&format!("`cars {name}")), "{name}");
    }
}

/// The page of the paper's interface has its methods as they are called in Rust and in Python, and the keys of the queries.
#[test]
fn the_page_of_the_interface_has_its_methods_and_keys() {
    let page = read(&docs().join("interface.md"));
    let rust = read(&root().join("crates/robot/src/figure7.rs"));
    let (_, methods) = rust.split_once("pub trait CarsRobotInterface").unwrap();
    let methods = methods.split("\n    fn ").skip(1);
    let methods: Vec<&str> = methods.filter_map(|rest| rest.split('(').next()).collect();
    assert_eq!(methods.len(), 14);

    let python = read(&root().join("sdk/python/src/cars/_robot.py"));
    let (_, python) = python.split_once("class CarsRobotInterface").unwrap();
    for method in methods {
        assert!(page.contains(&format!("| `{method}(")), "{method}");
        assert!(python.contains(&format!("def {method}(self")), "{method}");
    }
    for what in QUERIES.iter().chain([&STATE]) {
        assert!(
            page.contains(&format!("get at `robot/OF/{what}`")),
            "{what}"
        );
    }
}

/// The blocks of TOML of a page, with the project's files where they are.
fn examples(page: &str) -> Vec<String> {
    let page = read(&docs().join(page));
    let rests = page.split("\n```toml\n").skip(1);
    let blocks = rests.filter_map(|rest| rest.split_once("\n```"));
    let configs = format!("\"{}/", root().join("configs").display());

    blocks
        .map(|(block, _)| {
            block
                .replace("\"../configs/", &configs)
                .replace("\"configs/", &configs)
                .replace("\"robots/", &format!("{configs}robots/"))
        })
        .collect()
}

/// The first example of scenario files is complete, and the others are parts of it.
#[test]
fn the_examples_of_files_are_right() {
    const WAIT: &str = "on_late = \"wait\"";
    const CONTINUE: &str = "on_late = \"continue\"";
    const DURATION: &str = "duration = \"600 s\"\n";

    let mut parts = examples("scenario-files.md");
    let complete = parts.remove(0);
    parts.extend(examples("faults.md"));
    parts.extend(examples("expectations.md"));
    let mut layers = examples("layers.md");
    let mut files = vec![complete.clone(), layers.remove(0)];
    parts.extend(layers);
    for part in parts {
        // A key before the tables replaces the one of the complete example.
        if part.contains(CONTINUE) {
            let rest = part.replace(CONTINUE, "");
            files.push(complete.replace(WAIT, CONTINUE) + "\n" + &rest);
        } else if let Some(rest) = part.strip_prefix(DURATION) {
            let (keys, tables) = match rest.split_once("\n[") {
                Some((keys, tables)) => (keys, format!("[{tables}")),
                None => (rest, String::new()),
            };
            let begin = complete.replace(DURATION, &format!("{DURATION}{keys}\n"));
            files.push(format!("{begin}\n{tables}"));
        } else {
            files.push(format!("{complete}\n{part}"));
        }
    }
    files.extend(examples("launch-files.md"));
    for page in ["first-experiment.md", "auction.md", "swarm.md"] {
        files.extend(examples(page));
    }
    assert_eq!(files.len(), 30);

    let lab = Lab::new();
    // A drawing that one of them names.
    lab.write(
        "plan.svg",
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 900"><line x1="500" y1="100" x2="800" y2="100" stroke="black"/></svg>"#,
    );
    for file in files {
        let path = lab.write("example.toml", &file);
        let (status, text) = lab.cars_without_out(&["check", path.to_str().unwrap()]);
        assert_eq!(status, 0, "{text}\n{file}");
    }
}

/// The page of layers has a scenario, a robot, and what the robot prints.
#[test]
fn the_robot_of_the_page_of_layers_cleans() {
    let page = read(&docs().join("layers.md"));
    let block = |begin: &str| {
        let (_, rest) = page.split_once(begin).unwrap();
        rest.split_once("```").unwrap().0.to_owned()
    };

    let lab = Lab::new();
    let scenario = lab.write("dust.toml", &block("```toml\n"));
    let robot = lab.write("clean.py", &block("```python\n"));
    let output = python()
        .arg(robot)
        .current_dir(scenario.parent().unwrap())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(printed, block("$ python clean.py\n"), "{error}");
}

/// Whoever tries the examples in a checkout has not changed it.
#[test]
fn git_ignores_what_the_examples_write() {
    let ignored = read(&root().join(".gitignore"));
    let ignored: BTreeSet<&str> = ignored.lines().collect();
    let mut written = BTreeSet::from(["hunt".to_owned()]); // `cars hunt` without --out.
    let book = pages(&docs());
    for page in book.iter().chain([&root().join("README.md")]) {
        for line in read(page).lines().filter(|line| line.contains("cars ")) {
            let words: Vec<&str> = line.split([' ', '`']).collect();
            let outputs = words.windows(2).filter(|pair| pair[0] == "-o");
            let robots = words
                .windows(3)
                .filter(|words| words[..2] == ["new", "robot"]);
            written.extend(outputs.map(|pair| pair[1].to_owned()));
            written.extend(robots.map(|words| words[2].to_owned()));
        }
    }

    assert!(written.contains("Rosie") && written.contains("report.html"));
    // Neither placeholders, nor what is elsewhere.
    written.retain(|path| path.to_uppercase() != *path && !path.contains('/'));
    for path in written {
        assert!(
            ignored.contains(&*format!("/{path}")),
            "{path} is not in .gitignore"
        );
    }
}
