//! `cars crowd check`: its table, its exit status, and what it refuses.

use system_tests::Lab;

const CHECK: [&str; 3] = ["crowd", "check", "collision-free"];

/// What two runs of a case print.
fn table_of(only: &str, jobs: &str) -> String {
    let case = ["--only", only, "--runs", "2", "--jobs", jobs];
    let (status, text) = Lab::new().cars_without_out(&[&CHECK, &case[..]].concat());
    assert_eq!(status, 0, "{text}");
    text
}

#[test]
fn a_table_does_not_depend_on_the_number_of_jobs() {
    assert_eq!(table_of("RiMEA 1,", "1"), table_of("RiMEA 1,", "2"));
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_table_has_three_sets_of_data() {
    let text = table_of("RiMEA 4", "2");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    for part in [
        "RiMEA 4, corridor, 2 runs",
        "collision-free is calibrated to Weidmann, and judged by Weidmann.",
        "passed: all 9 rows that are judged",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Three sets of data at 1 person per m².
    let row = text.lines().find(|line| line.starts_with("│ 1 "));
    let row = row.unwrap_or_else(|| panic!("no row of 1 person per m²: {text}"));
    for part in ["0.81 ", "1.29 ", "1.06 ", " ok "] {
        assert!(row.contains(part), "{row}");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_table_of_many_people_does_not_depend_on_the_number_of_jobs() {
    assert_eq!(table_of("RiMEA 4", "1"), table_of("RiMEA 4", "2"));
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_model_that_fails_a_case_ends_with_1() {
    let case = ["--only", "RiMEA 4", "--runs", "1", "--against", "open"];
    let (status, text) = Lab::new().cars_without_out(&[&CHECK, &case[..]].concat());
    assert_eq!(status, 1, "{text}");
    assert!(text.contains("FAIL"), "{text}");
    assert!(text.contains("failed: "), "{text}");
}

#[test]
fn quick_plays_one_run_of_each_population() {
    let case = ["--quick", "--only", "RiMEA 1,"];
    let (status, text) = Lab::new().cars_without_out(&[&CHECK, &case[..]].concat());
    assert_eq!(status, 0, "{text}");
    assert!(text.starts_with("RiMEA 1, one person, 10 runs"), "{text}");
}

#[test]
fn numbers_out_of_bounds_and_cases_that_do_not_exist_are_refused() {
    let lab = Lab::new();
    let refused = |status, args: &[&str], reason: &str| {
        let (exit_status, text) = lab.cars_without_out(args);
        assert_eq!(exit_status, status, "{text}");
        assert!(text.contains(reason), "{text}");
    };
    for (option, value) in [
        ("--runs", "0"),
        ("--runs", "10001"),
        ("--jobs", "0"),
        ("--jobs", "2000"),
    ] {
        let args = [&CHECK, &[option, value][..]].concat();
        refused(
            2,
            &args,
            &format!("invalid value '{value}' for '{option} <N>'"),
        );
    }
    let stairs = [&CHECK, &["--only", "stairs"][..]].concat();
    refused(1, &stairs, "no case has \"stairs\" in its title");
    refused(
        2,
        &["crowd", "check", "boids"],
        "collision-free, social-force",
    );
}
