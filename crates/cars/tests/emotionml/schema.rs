//! Validation by W3C's XML schema, where it and `xmllint` are at hand. The schema is W3C's and no part of this project.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Once;

/// Whether `xmllint` finds a document valid; `None`, and a loud word, where that cannot be said.
///
/// # Panics
/// The schema is there, `xmllint` is not, and this is CI.
pub(crate) fn is_valid(document: &str, folder: &Path) -> Option<bool> {
    let schema = schema()?;

    if Command::new("xmllint").arg("--version").output().is_err() {
        let text = "no `xmllint`: install it (Debian: libxml2-utils) to validate by W3C's schema";
        assert!(std::env::var_os("CI").is_none(), "{text}");
        say(text);
        return None;
    }

    let file = folder.join("document.xml");
    std::fs::write(&file, document).unwrap();
    let args = ["--noout", "--nonet", "--schema"];
    let output = Command::new("xmllint")
        .args(args)
        .arg(schema)
        .arg(file)
        .output()
        .unwrap();

    // 3 and 4: not valid. Anything else says nothing about the document.
    let code = output.status.code();
    assert!(
        matches!(code, Some(0 | 3 | 4)),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );

    Some(code == Some(0))
}

fn schema() -> Option<PathBuf> {
    const VARIABLE: &str = "CARS_EMOTIONML_XSD";

    let told = std::env::var_os(VARIABLE).map(PathBuf::from);
    let beside =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/emotionml/emotionml.xsd");
    let schema = told.unwrap_or(beside);
    if schema.exists() {
        return Some(schema);
    }

    say(&format!(
        "no W3C schema: put emotionml.xsd and emotionml-fragments.xsd of https://www.w3.org/TR/emotionml/ into one \
         folder and let {VARIABLE} name the first to validate by it"
    ));

    None
}

/// Once, and past the test harness, which keeps what tests print to itself.
fn say(text: &str) {
    static SAID: Once = Once::new();
    SAID.call_once(|| {
        let _ = writeln!(std::io::stderr(), "SKIPPED: {text}");
    });
}
