//! What an experiment expects of its runs decides about its exit status.

use std::process::Command;

use system_tests::{Lab, programs, root};

use super::{HALL, cars};

/// The exit status of an experiment that expects this, and what it says.
fn judged(expect: &str) -> (i32, String) {
    judged_in(&Lab::new(), expect)
}

/// The same, with the experiment in a lab.
fn judged_in(lab: &Lab, expect: &str) -> (i32, String) {
    let scenario = root().join(HALL);
    let text = format!(
        "question = '?'\nscenario = {scenario:?}\nduration = '60 s'\nseeds = 3\n[[arm]]\nname = 'it'\n\
         [[measure]]\nname = 'ticks'\nsummary = 'ticks'\n{expect}"
    );
    let file = lab.write("experiment.toml", &text);
    let out = lab.out().join("results");
    cars(&["run", file.to_str().unwrap(), "-o", out.to_str().unwrap()])
}

#[test]
fn the_exit_status_is_that_of_the_worst_verdict_of_the_experiment() {
    let served = "eventually = { robot = 'Butler', variable = 'served', at_least = 1 }";
    let passes = format!("[[expect]]\nname = 'serves'\n{served}\nwithin = '60 s'\n");
    let (status, notes) = judged(&passes);
    assert_eq!(status, 0, "{notes}");
    assert!(!notes.contains("serves"), "{notes}");

    let undecided = "[[expect]]\nname = 'flies'\n\
                     eventually = { robot = 'Butler', behavior = 'FLY' }\nwithin = '100 s'\n";
    let (status, notes) = judged(&format!("{passes}{undecided}"));
    assert_eq!(status, 2, "{notes}");
    assert!(
        notes.contains("undecided: flies: in 3 of 3 runs, the first is unit 0"),
        "{notes}"
    );

    let not_asked = "[[expect]]\nname = 'heals'\nafter = { event = 'link_healed' }\n\
                     eventually = { robot = 'Butler', behavior = 'SERVE' }\nwithin = '10 s'\n";
    let (status, notes) = judged(&format!("{passes}{not_asked}"));
    assert_eq!(status, 0, "{notes}");
    assert!(
        notes.contains("not asked: heals: in 3 of 3 runs, the first is unit 0"),
        "{notes}"
    );

    // No run fails for a goal, whether it is reached in all, some or none of them.
    let goals = "[[expect]]\nname = 'flies'\nreach = { robot = 'Butler', behavior = 'FLY' }\n\
                 [[expect]]\nname = 'works'\nreach = { robot = 'Butler', behavior = 'SERVE' }\n";
    let (status, notes) = judged(goals);
    assert_eq!(status, 0, "{notes}");
    assert!(
        notes.contains("never reached: flies: in none of 3 runs"),
        "{notes}"
    );
    assert!(!notes.contains("works"), "{notes}");

    let fails = "[[expect]]\nname = 'nobody speaks'\nnever = { event = 'command_sent' }\n";
    let (status, notes) = judged(&format!("{undecided}{fails}{passes}"));
    assert_eq!(status, 1, "{notes}");
    assert!(notes.contains("fail: nobody speaks: in "), "{notes}");
}

/// The commands for the worst unit can be typed as they are printed.
#[test]
fn what_decided_the_worst_unit_is_found_by_the_printed_commands() {
    let lab = Lab::new();
    let (status, notes) = judged_in(
        &lab,
        "[[expect]]\nname = 'nobody is stopped'\nnever = { event = 'blocked', robot = 'Butler' }\n",
    );
    assert_eq!(status, 1, "{notes}");
    let (_, commands) = notes.split_once("cars experiment replay ").unwrap();
    let (replay, why) = commands.split_once(" cars why ").unwrap();
    let (why, _) = why.split_once("' ").unwrap();

    let cars = programs().join("cars");
    let typed = |command: &str| {
        let line = format!("{} {command}", cars.display());
        let mut shell = Command::new("sh");
        let output = shell
            .args(["-c", &line])
            .current_dir(lab.out())
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        (
            output.status.success(),
            format!("{line}: {printed}{output:?}"),
        )
    };
    let (is_recorded, printed) = typed(&format!("experiment replay {replay}"));
    assert!(is_recorded, "{printed}");
    let (is_answered, printed) = typed(&format!("why {why}' --budget 200"));
    assert!(is_answered, "{printed}");
    assert!(
        printed.contains("\"nobody is stopped\" fails. "),
        "{printed}"
    );
}
