//! Tools that tests need beside the toolchain.

use std::io::Write;

/// Reports a skipped test directly on the standard error, because the test harness hides the output of passing tests.
pub fn skip(test: &str, reason: &str) {
    let _unseen = writeln!(std::io::stderr(), "\nSKIPPED {test}: {reason}\n");
}

/// Skips a test because a tool is missing. With the environment variable `CI` that is a failure.
pub fn lacks_tool(test: &str, what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{test}: {what}");
    skip(test, what);
}
