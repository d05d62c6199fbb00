//! Programs where the system starts no further threads.

use std::process::Command;

use system_tests::{Lab, free_port, programs, root};

/// A user without processes: limits of processes count those of a user.
const NOBODY_ELSE: &str = "54321";

/// A program of the project as a user who may have no further thread.
fn without_threads(program: &str, args: &[&str]) -> Command {
    let mut command = Command::new("setpriv");
    let user = [
        "--reuid",
        NOBODY_ELSE,
        "--regid",
        NOBODY_ELSE,
        "--clear-groups",
    ];
    command.args(user).args(["prlimit", "--nproc=1"]);
    command
        .arg(programs().join(program))
        .args(args)
        .current_dir(root());
    command
}

#[test]
fn no_threads_are_an_error_and_no_panic() {
    let is_possible = without_threads("cars", &["--version"]).output();
    if !is_possible.is_ok_and(|output| output.status.success()) {
        println!("skipped: only root can become a user without processes");
        return;
    }

    let lab = Lab::new();
    let out = lab.out().join("out");
    std::fs::create_dir(&out).unwrap();
    for folder in [lab.out(), &out] {
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o777);
        std::fs::set_permissions(folder, mode).unwrap();
    }
    let out = out.to_str().unwrap();
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let file = "launch/hors_doeuvres.toml";
    let programs: [(&str, &[&str]); 5] = [
        ("cars", &["router", "--listen", &endpoint]),
        ("cars-butler", &["--connect", &endpoint]),
        ("cars-console", &["--connect", &endpoint]),
        ("cars", &["run", file, "--out", out]),
        ("cars", &["launch", file, "--out", out, "--no-console"]),
    ];
    for (program, args) in programs {
        let output = without_threads(program, args).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(1),
            "{program} {args:?}: {stderr}"
        );
        assert!(!stderr.contains("panicked"), "{program} {args:?}: {stderr}");
        assert!(
            stderr.contains("thread") || stderr.contains("temporarily unavailable"),
            "{program} {args:?}: {stderr}"
        );
    }
}
