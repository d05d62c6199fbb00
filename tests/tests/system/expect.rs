//! What is expected of a run: verdicts as events, in the table, as exit statuses; the same in one process and as processes.

use system_tests::processes::nobody_is_left;
use system_tests::{Lab, assert_same};

const SCENARIO: &str = "configs/hors_doeuvres.toml";
const HALL: &str = "launch/hors_doeuvres.toml";

const OVERLAP: &str = "no robot overlaps another";
const CALL: &str = "a call is answered or escalated";
const HEALED: &str = "after a partition has healed, treats are exchanged";
const PROGRESS: &str = "no robot stays in a behavior without progress";
const BUTLER_PLEASED: &str = "Butler's frustration ends well only by a positive input";
const LEGUIN_PLEASED: &str = "Leguin's frustration ends well only by a positive input";

/// Robots that call once and then wait for each other, cut off while Butler calls: one lost message stops their work.
const BROKEN: [&str; 6] = [
    "--set",
    "robot.Butler.params.policy=neither",
    "--set",
    "robot.Leguin.params.policy=neither",
    "--set",
    r#"network.partition=[{ groups = [["Butler"], ["Leguin"]], from = "20 s", until = "60 s" }]"#,
];

/// The verdicts of a run in the order of its record.
fn verdicts(lab: &Lab, run: &str) -> Vec<(String, String)> {
    let mut verdicts = Vec::new();
    for event in lab.events(run) {
        if event["event"] == "judged" {
            let text = |field: &str| event[field].as_str().unwrap().to_owned();
            verdicts.push((text("expectation"), text("verdict")));
        }
    }
    verdicts
}

fn named<const N: usize>(pairs: [(&str, &str); N]) -> Vec<(String, String)> {
    let pairs = pairs.map(|(name, verdict)| (name.to_owned(), verdict.to_owned()));
    pairs.to_vec()
}

/// Runs `cars`; returns its exit status and what it printed.
fn status(lab: &Lab, args: &[&str]) -> (i32, String) {
    let output = lab.cars(args).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.code().unwrap_or(-1), text)
}

#[test]
fn the_hall_does_what_is_expected_of_it() {
    let lab = Lab::new();
    let (code, table) = status(&lab, &["run", SCENARIO, "--run", "hall"]);
    assert_eq!(code, 0, "{table}");
    assert_eq!(
        verdicts(&lab, "hall"),
        named([
            (OVERLAP, "pass"),
            (CALL, "pass"),
            (HEALED, "not_asked"),
            (PROGRESS, "pass"),
            (BUTLER_PLEASED, "pass"),
            (LEGUIN_PLEASED, "not_asked")
        ])
    );
    let line = format!("not asked  {HEALED}: nothing that it is expected after happened until");
    assert!(table.contains(&line), "{table}");
    assert!(
        table.contains(&format!("pass       {OVERLAP}\n")),
        "{table}"
    );
    let because = &lab.summary("hall")["expectations"][HEALED]["because"];
    assert!(
        because
            .to_string()
            .contains("nothing that it is expected after")
    );

    // The digest of a run does not depend on what is expected of it.
    lab.ok(&["run", SCENARIO, "--run", "nothing", "--set", "expect=[]"]);
    assert!(verdicts(&lab, "nothing").is_empty());
    assert_eq!(
        lab.summary("hall")["digest"],
        lab.summary("nothing")["digest"]
    );
    assert_eq!(lab.summary("nothing").get("expectations"), None);
}

#[test]
fn a_team_that_stops_working_fails_in_one_process_and_as_processes() {
    let lab = Lab::new();
    let run = [&["run", SCENARIO, "--run", "alone"][..], &BROKEN].concat();
    let (code, table) = status(&lab, &run);
    assert_eq!(code, 1, "{table}");
    let lost = "tick 43 (21.5 s): Butler -> Leguin: refill (achieve)";
    let line = format!(
        "fail       {CALL}: tick 163 (81.5 s): it has not happened within 60 s after {lost}"
    );
    assert!(table.contains(&line), "{table}");
    assert_eq!(
        verdicts(&lab, "alone"),
        named([
            (CALL, "fail"),
            (PROGRESS, "fail"),
            (HEALED, "fail"),
            (OVERLAP, "pass"),
            (BUTLER_PLEASED, "pass"),
            (LEGUIN_PLEASED, "not_asked"),
        ])
    );

    let options = ["--no-console", "--speed", "max", "--run", "apart"];
    let launch = [&["launch", HALL][..], &options, &BROKEN].concat();
    let output = lab.cars(&launch).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(
        !errors.contains("exit status"),
        "no process failed: {errors}"
    );
    nobody_is_left("apart");
    assert_same(
        ("in one process", &lab.bytes("alone")),
        ("as processes", &lab.bytes("apart")),
    );
    lab.ok(&["verify", "apart"]);

    // Judged again from its record, by the same expectations and by others.
    let (code, text) = status(&lab, &["expect", "apart"]);
    assert_eq!(code, 1);
    for line in text.lines() {
        assert!(table.contains(line), "{line} is not in\n{table}");
    }
    assert_eq!(text.lines().count(), 6);

    let other = lab.write(
        "other.toml",
        "[[expect]]\nname = 'he calls'\neventually = { event = 'command_sent', from = 'Butler' }\nwithin = '10 min'\n",
    );
    let (code, text) = status(
        &lab,
        &["expect", "apart", "--expectations", other.to_str().unwrap()],
    );
    assert_eq!((code, text.as_str()), (0, "pass       he calls\n"));
}

#[test]
fn what_the_end_of_a_run_leaves_open_is_undecided() {
    let lab = Lab::new();
    let run = ["run", SCENARIO, "--run", "short", "--duration", "61 s"];
    let (code, table) = status(&lab, &run);
    assert_eq!(code, 2, "{table}");
    assert!(table.contains(&format!("undecided  {CALL}: ")), "{table}");
    assert_eq!(status(&lab, &["expect", "short"]).0, 2);

    // A run that is stopped: what never happened might have happened.
    let mut launch = lab.start("stopped", &["launch", HALL, "--no-console", "--paused"]);
    lab.until_ready("stopped");
    lab.step("stopped", 5);
    lab.ok(&["ctl", "stop", "--run", "stopped"]);
    assert_eq!(launch.wait().code(), Some(2), "{}", launch.printed());
    let undecided = verdicts(&lab, "stopped");
    assert_eq!(undecided.len(), 6);
    assert!(undecided.iter().all(|(_, verdict)| verdict == "undecided"));
}

#[test]
fn each_epoch_is_judged_by_itself() {
    let lab = Lab::new();
    let early = "expect=[{ name = 'soon', eventually = { event = 'behavior', robot = 'Leguin' }, within = '0 s' }]";
    let args = ["launch", HALL, "--no-console", "--paused", "--set", early];
    let mut launch = lab.start("epochs", &args);
    lab.until_ready("epochs");
    lab.step("epochs", 3);
    lab.ok(&["ctl", "init", "--run", "epochs"]);
    lab.until_ready("epochs");
    lab.step("epochs", 2);
    lab.ok(&["ctl", "stop", "--run", "epochs"]);
    assert_eq!(launch.wait().code(), Some(0), "{}", launch.printed());

    let first = std::fs::read_to_string(lab.file("epochs", "events-epoch1.jsonl")).unwrap();
    let judged = r#"{"tick":0,"event":"judged","expectation":"soon","verdict":"pass""#;
    assert_eq!(first.matches(judged).count(), 1);
    let second = String::from_utf8(lab.bytes("epochs")).unwrap();
    assert_eq!(second.matches(judged).count(), 1);
}

#[test]
fn a_record_without_reports_is_judged_by_its_events_and_one_without_an_end_is_undecided() {
    let lab = Lab::new();
    let bare = [
        "run",
        SCENARIO,
        "--run",
        "bare",
        "--set",
        "record.frames=false",
    ];
    lab.ok(&bare);
    let (code, text) = lab.fails(&["expect", "bare"]);
    assert_eq!(code, 1);
    assert!(text.contains("depends on what robots reported"), "{text}");

    let calls = lab.write(
        "calls.toml",
        "[[expect]]\nname = 'no loss'\nnever = { event = 'command_dropped' }\n",
    );
    let expect = ["expect", "bare", "--expectations", calls.to_str().unwrap()];
    assert_eq!(
        status(&lab, &expect),
        (0, "pass       no loss\n".to_owned())
    );

    // As if its simulator had been killed.
    let file = lab.file("bare", "events.jsonl");
    let events = std::fs::read_to_string(&file).unwrap();
    let end = events.find("{\"tick\":500,").unwrap();
    std::fs::write(&file, &events[..end]).unwrap();
    let (code, text) = status(&lab, &expect);
    assert_eq!(code, 2);
    assert!(
        text.starts_with("undecided  no loss: the run was ended at tick 499"),
        "{text}"
    );
}

#[test]
fn wrong_expectations_are_shown_with_their_place() {
    let lab = Lab::new();
    let text = std::fs::read_to_string(system_tests::root().join(SCENARIO)).unwrap();
    let text = text.replace(
        "robots/",
        &format!("{}/configs/robots/", system_tests::root().display()),
    );
    for (wrong, place, reason) in [
        (
            text.replace(
                "robot = \"Leguin\", behavior = \"REFILL\"",
                "robot = \"Leguina\", behavior = \"REFILL\"",
            ),
            "[[expect]]",
            "no robot of this scenario is called Leguina",
        ),
        (
            text.replace("{ overlap = \"any\" }", "{ overlaps = \"any\" }"),
            "never = { overlaps",
            "unknown field `overlaps`",
        ),
        (
            text.replace("event = \"link_healed\"", "event = \"healed\""),
            "after = { event = \"healed\" }",
            "there is no event \"healed\"",
        ),
    ] {
        let file = lab.write("wrong.toml", &wrong);
        let (code, shown) = lab.cars_without_out(&["check", file.to_str().unwrap()]);
        assert_eq!(code, 1, "{shown}");
        assert!(shown.contains(place) && shown.contains(reason), "{shown}");
    }

    let set = ["run", SCENARIO, "--set", "expect.0.never.overlap=Butler"];
    let (_, shown) = lab.fails(&set);
    assert!(shown.contains("`overlap` is \"any\""), "{shown}");

    lab.ok(&["run", SCENARIO, "--run", "parent", "--duration", "20 s"]);
    let (_, shown) = lab.fails(&["fork", "parent@10", "--set", "expect=[]"]);
    assert!(shown.contains("only the network, faults, rules"), "{shown}");
}
