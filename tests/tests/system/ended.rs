//! Robots whose process ends in the middle of the run, and no other one follows.

use system_tests::{Lab, programs, root};

/// A launch of Butler and of Leguin, whose program ends with a status as soon as a file is there.
fn launch_file(lab: &Lab, status: u8, more: &str) -> String {
    let leguin = programs().join("cars-leguin");
    let go = lab.out().join("go");
    let script = format!(
        "{:?} \"$0\" \"$@\" & until [ -e {:?} ]; do sleep 0.02; done; kill $!; exit {status}",
        leguin.display().to_string(),
        go.display().to_string()
    );
    let text = format!(
        "scenario = {:?}\n[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n\
         [[process]]\nname = \"Leguin\"\ncommand = [\"sh\", \"-c\", '''{script}''']\n{more}\n",
        root()
            .join("configs/hors_doeuvres.toml")
            .display()
            .to_string()
    );
    lab.write("launch.toml", &text).to_str().unwrap().to_owned()
}

#[test]
fn a_run_ends_and_names_the_robot_that_no_process_follows() {
    for (run, status, more, because) in [
        ("ended-well", 0, "", "ended with exit status 0"),
        (
            "ended-quiet",
            0,
            "restart = \"on-failure\"",
            "ended with exit status 0",
        ),
        (
            "ended-optional",
            3,
            "required = false",
            "ended with exit status 3",
        ),
    ] {
        let lab = Lab::new();
        let file = launch_file(&lab, status, more);
        let mut launch = lab.start(
            run,
            &[
                "launch",
                &file,
                "--duration",
                "600 s",
                "--speed",
                "10",
                "--no-console",
                "--paused",
            ],
        );
        lab.until_ready(run);
        lab.step(run, 5);
        lab.ctl(run, &["start"]);
        lab.write("go", "");
        let exit = launch.wait();
        let printed = launch.printed();
        assert_eq!(exit.code(), Some(1), "{printed}");
        assert!(
            printed.contains(&format!("Leguin {because}, and no process follows")),
            "{printed}"
        );

        let events = lab.events(run);
        let end = events
            .iter()
            .rev()
            .find(|event| event.to_string().contains("waited_for"));
        let end = end.unwrap_or_else(|| panic!("{events:?}")).to_string();
        assert!(end.contains("Leguin") && end.contains(because), "{end}");
    }
}

#[test]
fn where_the_clock_does_not_wait_the_run_goes_on_without_it() {
    let lab = Lab::new();
    let file = launch_file(&lab, 0, "");
    let run = "ended-continue";
    let mut launch = lab.start(
        run,
        &[
            "launch",
            &file,
            "--duration",
            "60 s",
            "--speed",
            "max",
            "--no-console",
            "--paused",
            "--set",
            "on_late=\"continue\"",
        ],
    );
    lab.until_ready(run);
    lab.step(run, 5);
    lab.write("go", "");
    launch.prints("Leguin ended with exit status 0, and no process follows");
    lab.ctl(run, &["start"]);
    launch.finish();
    assert_eq!(lab.summary(run)["ticks"], 120);
}
