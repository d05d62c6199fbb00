//! The console's page in a browser: `tests/console`.

mod launched;

use std::path::Path;
use std::process::Command;

use system_tests::pytest::{Choice, pytest};
use system_tests::tools::lacks_tool;
use system_tests::{programs, root};

#[test]
fn the_page_works_in_a_browser() {
    in_a_browser(Choice::Usual);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_page_works_in_every_size_and_color_and_with_very_much() {
    in_a_browser(Choice::Thorough);
}

/// Runs `tests/console` in Chromium if it is installed.
fn in_a_browser(choice: Choice) {
    if let Some(missing) = missing_tools() {
        return lacks_tool("the tests of the console in a browser", &missing);
    }

    pytest(&root().join("tests/console"), choice, || {
        let mut python = Command::new("python3");
        python
            .current_dir(root())
            .env("CARS_BIN", programs())
            .env("PYTHONDONTWRITEBYTECODE", "1");
        for variable in [
            "CARS_RUN",
            "CARS_CONNECT",
            "CARS_LISTEN",
            "CARS_CONSOLE_BIND",
        ] {
            python.env_remove(variable);
        }
        python
    });
}

/// What the tests in a browser lack, and how to install it.
fn missing_tools() -> Option<String> {
    let browsers = ["/usr/bin/chromium-headless-shell", "/usr/bin/chromium"];
    if !browsers.iter().any(|browser| Path::new(browser).exists()) {
        let install = "`apt-get install chromium-headless-shell`";
        return Some(format!(
            "there is none of {}; {install}",
            browsers.join(", ")
        ));
    }

    let python = Command::new("python3")
        .args(["-c", "import pytest, playwright.sync_api"])
        .output();
    match python {
        Ok(output) if output.status.success() => None,
        Ok(_) => Some(
            "python3 has no pytest or no playwright; `pip install pytest playwright`".to_owned(),
        ),
        Err(error) => Some(format!(
            "python3 does not run ({error}); install Python 3.11 or later"
        )),
    }
}
