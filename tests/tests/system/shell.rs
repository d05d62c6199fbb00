//! From a shell: the calls between robots, the log, checks, the plain roster.

use system_tests::Lab;

#[test]
fn a_robot_can_be_asked_and_commanded_from_a_shell() {
    let lab = Lab::new();
    let mut launch = lab.start(
        "shell",
        &[
            "launch",
            "launch/hors_doeuvres.toml",
            "--paused",
            "--duration",
            "60 s",
        ],
    );
    lab.until_ready("shell");
    lab.step("shell", 1);
    let ask = |what| lab.ok(&["ctl", "query", "Leguin", what, "--run", "shell"]);
    assert_eq!(ask("emotion_state").trim(), "HAPPY");
    assert_eq!(ask("behavior_state").trim(), "WAIT");
    assert!(ask("location").contains("\"x\""));
    let (_, text) = lab.fails(&["ctl", "query", "Nobody", "speed", "--run", "shell"]);
    assert!(text.contains("no robot called Nobody answers"), "{text}");

    let sent = lab.ok(&["ctl", "command", "Leguin", "refill", "--run", "shell"]);
    assert!(sent.contains("Leguin receives"), "{sent}");
    lab.step("shell", 3);
    assert_eq!(
        ask("behavior_state").trim(),
        "REFILL",
        "the command took effect"
    );
    let (_, text) = lab.fails(&["ctl", "command", "Nobody", "refill", "--run", "shell"]);
    assert!(
        text.contains("no robot of this run is called Nobody"),
        "{text}"
    );

    lab.ok(&["ctl", "stop", "--run", "shell"]);
    launch.finish();
    let events = lab.events("shell");
    let find = |kind: &str| {
        events
            .iter()
            .find(|event| event["event"] == kind && event["from"] == "operator")
            .cloned()
    };
    assert_eq!(
        find("command_sent").expect("it is recorded")["command"],
        "refill"
    );
    assert_eq!(
        find("command_delivered").expect("it is recorded")["to"],
        "Leguin"
    );
    let log = lab.ok(&["log", "--run", "shell"]);
    assert!(log.contains("operator     -> Leguin: refill"), "{log}");
}

#[test]
fn the_log_can_be_followed_to_the_end() {
    let lab = Lab::new();
    let mut launch = lab.start(
        "follow",
        &[
            "launch",
            "launch/hors_doeuvres.toml",
            "--paused",
            "--duration",
            "60 s",
        ],
    );

    lab.until_ready("follow");
    lab.step("follow", 1);

    let mut log = lab.start("follow", &["log", "-f"]);
    log.prints("initialized");
    lab.ok(&["ctl", "speed", "max", "--run", "follow"]);
    lab.ok(&["ctl", "start", "--run", "follow"]);
    log.prints("finished");
    log.finish();
    launch.finish();
}

#[test]
fn files_are_checked_with_line_and_place() {
    let lab = Lab::new();
    let good = lab.cars_without_out(&[
        "check",
        "launch/hors_doeuvres.toml",
        "configs/three_robots.toml",
    ]);

    assert!(good.0 == 0 && good.1.contains("ok"), "{}", good.1);

    let bad = lab.write("bad.toml", "seed = 1\n[guests]\ncuont = 5\n");
    let (code, text) = lab.cars_without_out(&["check", bad.to_str().unwrap()]);
    assert_eq!(code, 1);

    for part in ["bad.toml", "cuont = 5", "unknown field `cuont`"] {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
}

#[test]
fn a_plain_roster_plays() {
    let lab = Lab::new();
    let roster = lab.write("CARSConfig.txt", "Butler\nLeguin\nVonda\n");
    let args = [
        "launch",
        "--roster",
        roster.to_str().unwrap(),
        "--run",
        "roster",
        "--duration",
        "30 s",
        "--speed",
        "max",
    ];
    let printed = lab.ok(&args);

    assert!(printed.contains("Vonda"), "{printed}");
    assert_eq!(lab.summary("roster")["ticks"], 60);
}

/// Alfred is a Butler, and calls Laila, a Leguin, although there is another Leguin.
#[test]
fn robots_of_one_class_play_under_names_of_their_own() {
    let lab = Lab::new();
    let roster = lab.write("CARSConfig.txt", "Butler Alfred\nLeguin\nLeguin Laila\n");
    let set = [
        "robot.Alfred.params.refiller=Laila",
        "robot.Laila.params.waiter=Alfred",
        "robot.Leguin.params.waiter=Alfred",
    ];
    let mut args = vec!["launch", "--roster", roster.to_str().unwrap()];
    args.extend(["--run", "names", "--duration", "200 s", "--speed", "max"]);
    args.extend(set.iter().flat_map(|set| ["--set", set]));
    let printed = lab.ok(&args);

    for shown in ["Alfred", "Laila", "Leguin"] {
        assert!(printed.contains(shown), "{shown} in\n{printed}");
        assert!(
            lab.file("names", "logs")
                .join(format!("{shown}.log"))
                .exists()
        );
    }
    let robots = &lab.summary("names")["robots"];
    assert!(robots["Alfred"]["state_variables"]["exchanges"].as_f64() >= Some(1.0));
    assert!(robots["Laila"]["state_variables"]["trips"].as_f64() >= Some(1.0));
    assert_eq!(robots["Leguin"]["state_variables"]["trips"], 0.0);

    // The same in one process, from the scenario in the record.
    let scenario = lab.file("names", "scenario.toml");
    lab.ok(&["run", scenario.to_str().unwrap(), "--run", "alone"]);
    let events = |run| std::fs::read(lab.file(run, "events.jsonl")).unwrap();
    assert!(events("names") == events("alone"), "they differ");

    let page = lab.file("names", "report.html");
    lab.ok(&["report", "names", "-o", page.to_str().unwrap()]);
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("Alfred") && page.contains("Laila"));
    assert_eq!(
        page.matches("Butler").count(),
        1,
        "in the scenario, as a class"
    );
}

#[test]
fn a_dry_run_says_what_it_would_start_and_starts_nothing() {
    let lab = Lab::new();
    let printed = lab.ok(&[
        "launch",
        "launch/hors_doeuvres.toml",
        "--dry-run",
        "--run",
        "dry",
    ]);

    for program in ["cars-sim", "cars-butler", "cars-leguin"] {
        assert!(printed.contains(program), "no {program} in\n{printed}");
    }

    assert!(!lab.file("dry", "events.jsonl").exists());
}

#[test]
fn a_run_is_three_processes_and_leaves_a_whole_folder() {
    let lab = Lab::new();
    let mut launch = lab.start(
        "folder",
        &[
            "launch",
            "launch/hors_doeuvres.toml",
            "--duration",
            "60 s",
            "--speed",
            "20",
        ],
    );

    for program in ["cars-sim", "cars-butler", "cars-leguin"] {
        assert!(launch.process(program) > 0);
    }

    launch.finish();

    for file in [
        "scenario.toml",
        "events.jsonl",
        "cars.log",
        "summary.json",
        "logs",
    ] {
        assert!(lab.file("folder", file).exists(), "no {file}");
    }

    assert!(
        launch.printed().contains("Butler") && launch.printed().contains("digest"),
        "{}",
        launch.printed()
    );

    let summary = lab.summary("folder");
    assert_eq!(
        (&summary["ticks"], &summary["end"]),
        (&120.into(), &"finished".into())
    );

    let last = lab.events("folder").pop().unwrap();
    assert_eq!(last["digest"], summary["digest"]);

    for event in lab.events("folder") {
        let text = event.to_string();
        assert!(
            !text.contains("127.0.0.1") && !text.contains("pid"),
            "a simulated fact only: {text}"
        );
    }
}

#[test]
fn a_run_in_progress_is_not_overwritten() {
    let lab = Lab::new();
    let mut launch = lab.start(
        "twice",
        &["launch", "launch/hors_doeuvres.toml", "--paused"],
    );
    lab.until_ready("twice");
    lab.step("twice", 1);

    for how in ["launch", "run"] {
        let (_, text) = lab.fails(&[how, "launch/hors_doeuvres.toml", "--run", "twice"]);
        assert!(text.contains("is in progress"), "{text}");
    }

    lab.ok(&["ctl", "stop", "--run", "twice"]);
    launch.finish();
    assert_eq!(lab.events("twice").last().unwrap()["event"], "end");
}
