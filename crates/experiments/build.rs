//! States the commit that the program is built from, which results name: that of the checkout, or the variable `CARS_COMMIT`
//! where a package is built without one.

use std::path::Path;
use std::process::Command;

/// The folder of the checkout.
const GIT: &str = "../../.git";
/// A line more with every commit and checkout.
const MOVES: &str = "../../.git/logs/HEAD";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=CARS_COMMIT");
    // A file that is not there would count as changed every time.
    if Path::new(MOVES).exists() {
        println!("cargo:rerun-if-changed={MOVES}");
    }
    if std::env::var_os("CARS_COMMIT").is_none() && Path::new(GIT).exists() {
        let asked = Command::new("git")
            .args(["rev-parse", "--verify", "HEAD"])
            .output();
        let answered = asked.ok().filter(|output| output.status.success());
        if let Some(output) = answered {
            let commit = String::from_utf8_lossy(&output.stdout);
            println!("cargo:rustc-env=CARS_COMMIT={}", commit.trim());
        }
    }
}
