//! The system's temporary folder, where any user may plant links.

use system_tests::Lab;

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
