//! A robot in C over zenoh-pico (`sdk/zenoh-pico`), built as its page says.
//!
//! No package registry has zenoh-pico, so these tests are skipped also in CI where it is not installed.

use std::path::{Path, PathBuf};
use std::process::Command;

use system_tests::tools::{has_python, skip};
use system_tests::{Lab, assert_same, programs, root};

use crate::stdio::{in_python, walk};

const PAGE: &str = "docs/zenoh-pico.md";

/// What the kit does not see of Walker, which asks nobody and obeys nobody.
const SKIPPED: [&str; 8] = [
    "command.order",
    "command.twice",
    "command.sent",
    "operator.commands",
    "query.reply",
    "query.again",
    "query.waiting",
    "query.at-once",
];

/// The words of `pkg-config`, if it knows these packages.
fn pkg_config(arguments: &[&str]) -> Option<String> {
    let output = Command::new("pkg-config").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// The options of the build that the page names: the tokens of `config.h` and their values.
fn options(page: &str) -> Vec<(String, String)> {
    let mut options = Vec::new();
    for word in page.split_whitespace() {
        let Some((name, value)) = word
            .strip_prefix("-D")
            .and_then(|option| option.split_once('='))
        else {
            continue;
        };
        if value.chars().all(|digit| digit.is_ascii_digit()) {
            let token = format!("Z_{}", name.trim_start_matches("Z_"));
            options.push((token, value.to_owned()));
        }
    }
    options
}

/// Why the robot cannot be built here.
fn missing(page: &str) -> Option<String> {
    if pkg_config(&["--exists", "zenohpico", "jansson"]).is_none() {
        return Some(format!(
            "pkg-config finds no zenohpico and jansson: {PAGE} says how to build them; set PKG_CONFIG_PATH"
        ));
    }

    let folder = pkg_config(&["--variable=prefix", "zenohpico"])?;
    let header = Path::new(&folder).join("include/zenoh-pico/config.h");
    let text = std::fs::read_to_string(&header).ok()?;
    for (token, value) in options(page) {
        if !text.contains(&format!("#define {token} {value}\n")) {
            let header = header.display();
            return Some(format!(
                "{header} does not have {token} {value}: build it as {PAGE} says"
            ));
        }
    }
    None
}

/// Builds Walker by the command of the page.
fn build(page: &str, folder: &Path) -> PathBuf {
    let command = page.lines().find(|line| line.starts_with("cc "));
    let command = command.expect("a command of the compiler on the page");
    let program = folder.join("walker");
    let output = format!("-Wall -Wextra -Werror -o {}", program.display());

    let built = Command::new("sh")
        .args(["-c", &command.replace("-o walker", &output)])
        .current_dir(root().join("sdk/zenoh-pico"))
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "{command}: {errors}");
    program
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_in_c_over_zenoh_pico_conforms_and_is_walker_byte_for_byte() {
    let test = "a robot in C over zenoh-pico";
    let page = std::fs::read_to_string(root().join(PAGE)).unwrap();
    assert_eq!(options(&page).len(), 3, "{PAGE}");
    if let Some(missing) = missing(&page) {
        skip(test, &missing);
        return;
    }
    if !has_python(test) {
        return;
    }

    let lab = Lab::new();
    let folder = tempfile::tempdir().unwrap();
    let program = build(&page, folder.path());
    let output = Command::new(programs().join("cars"))
        .args(["conform", "--name", "Walker", "--"])
        .arg(&program)
        .args(["--name", "Walker"])
        .output()
        .unwrap();
    let report = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{report}");
    let skipped: Vec<&str> = report
        .lines()
        .filter(|line| line.contains("# SKIP"))
        .filter_map(|line| line.split_whitespace().nth(3))
        .collect();
    assert_eq!(skipped, SKIPPED, "{report}");

    let command = format!(
        "[{:?}, \"--name\", \"Walker\"]",
        program.display().to_string()
    );
    assert_same(
        ("in Python", &walk(&lab, "walker-python", &in_python())),
        ("over zenoh-pico", &walk(&lab, "walker-pico", &command)),
    );
}
