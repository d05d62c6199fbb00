//! The system's temporary folder, where any user may plant links.

use std::os::unix::fs::PermissionsExt;

use system_tests::{Lab, root};

#[test]
fn a_roster_is_launched_without_the_temporary_folder() {
    let lab = Lab::new();
    let temporary = lab.out().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    let roster = lab.write("CARSConfig.txt", "Butler\nLeguin\n");

    let mut command = lab.cars(&["launch", "--no-console", "--duration", "5 s"]);
    command
        .arg("--roster")
        .arg(roster)
        .args(["--run", "roster"]);
    let status = command.env("TMPDIR", &temporary).status().unwrap();

    assert!(status.success());
    assert_eq!(std::fs::read_dir(&temporary).unwrap().count(), 0);
}

#[test]
fn a_benchmark_uses_a_new_folder_for_this_user_alone() {
    let lab = Lab::new();
    let temporary = lab.out().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    let shared = std::fs::Permissions::from_mode(0o1777);
    std::fs::set_permissions(&temporary, shared).unwrap();

    let mut command = std::process::Command::new(system_tests::programs().join("cars"));
    command.current_dir(root()).env("TMPDIR", &temporary);
    command.args([
        "bench", "--only", "hall", "--rounds", "1", "--ticks", "1000000",
    ]);
    let mut bench = command.spawn().unwrap();
    let folder = system_tests::eventually("the folder", || {
        Some(std::fs::read_dir(&temporary).unwrap().next()?.unwrap())
    });
    let mode = folder.metadata().unwrap().permissions().mode();
    let name = folder.file_name().into_string().unwrap();
    let foreseeable = format!("cars-bench-{}", bench.id());
    bench.kill().unwrap();
    bench.wait().unwrap();

    assert_eq!(mode & 0o777, 0o700, "{name}");
    assert_ne!(name, foreseeable);
}
