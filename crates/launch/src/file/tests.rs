//! What is wrong with a launch file, in words.

use config::Changes;

use super::*;

const SCENARIO: &str = r#"
[[robot]]
name = "Butler"
at = ["25 ft", "25 ft"]
[[robot]]
name = "Leguin"
at = ["5 ft", "5 ft"]
"#;

fn scenario() -> Scenario {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.toml");
    std::fs::write(&path, SCENARIO).unwrap();
    Scenario::load(&path, &Changes::default()).unwrap()
}

fn load(text: &str) -> Result<LaunchFile, FileError> {
    let text = format!("scenario = \"../configs/hall.toml\"\n{text}");
    let mut file = LaunchFile::parse(
        Source {
            name: "launch/x.toml".to_owned(),
            text,
        },
        Path::new("launch"),
    )?;

    file.assign_robots(&scenario())?;
    Ok(file)
}

/// What is said about a launch file, without colors and lines that frame it.
#[track_caller]
fn refusal(text: &str) -> String {
    let error = load(text).expect_err("this file is to be refused");
    config::render_plain(&error, None, 200)
}

/// Every one of `words` is said about the file.
#[track_caller]
fn check(text: &str, words: &[&str]) {
    let shown = refusal(text);
    for word in words {
        assert!(shown.contains(word), "{word:?} is not in:\n{shown}");
    }
}

#[test]
fn a_file_can_name_its_runs() {
    let named = |name: &str| format!("run = \"{name}\"\n{BOTH}");
    let file = load(&named("Rosie")).unwrap();
    assert_eq!(file.run.unwrap().as_str(), "Rosie");
    assert_eq!(load(BOTH).unwrap().run, None);
    check(
        &named("latest"),
        &["launch/x.toml:2:7", "choose another name"],
    );
    check(&named("a/b"), &["launch/x.toml:2:7", "only letters"]);
}

const BOTH: &str = r#"
[[process]]
name = "Butler"
command = ["cars-butler"]
[[process]]
name = "Leguin"
command = ["cars-leguin"]
"#;

#[test]
fn a_file_means_what_it_says() {
    let file = load(&format!("speed = 20\n{BOTH}")).unwrap();
    assert_eq!(file.scenario, Path::new("configs/hall.toml"));
    assert_eq!(file.speed, Some(Speed(Some(20.0))));

    let butler = &file.processes[0];
    assert_eq!(butler.command, ["cars-butler"]);
    assert_eq!(butler.robots, [RobotName::new("Butler").unwrap()]);
    assert_eq!(
        (butler.restart, butler.is_required, butler.is_extern),
        (Restart::Never, true, false)
    );

    let file = load(&format!(
        "speed = \"max\"\n[simulator]\nenv = {{ RUST_LOG = \"debug\" }}\n{BOTH}\
         restart = \"on-failure\"\nbackoff = \"250 ms\"\nrequired = false\nextern = true\n"
    ));
    let file = file.unwrap();
    assert_eq!(file.speed, Some(Speed(None)));
    assert_eq!(file.simulator.env["RUST_LOG"], "debug");

    let leguin = &file.processes[1];
    assert_eq!(
        (leguin.restart, leguin.is_required, leguin.is_extern),
        (Restart::OnFailure, false, true)
    );
    assert_eq!(leguin.backoff, Duration::from_millis(250));
}

#[test]
fn the_console_runs_unless_it_is_not_wanted() {
    let console = load(BOTH).unwrap().console.unwrap();
    assert_eq!(
        (console.command, console.is_required),
        (vec!["cars-console".to_owned()], false)
    );

    let bound = load(&format!("[console]\nbind = \"127.0.0.1:8080\"\n{BOTH}"))
        .unwrap()
        .console
        .unwrap();
    assert_eq!(bound.command, ["cars-console", "--bind=127.0.0.1:8080"]);
    assert!(
        load(&format!("[console]\nenabled = false\n{BOTH}"))
            .unwrap()
            .console
            .is_none()
    );
}

#[test]
fn one_process_may_run_several_robots() {
    let file =
        load("[[process]]\nname = \"all\"\ncommand = [\"x\"]\nrobots = [\"Leguin\", \"Butler\"]")
            .unwrap();
    assert_eq!(file.processes[0].robots.len(), 2);
}

#[test]
fn an_entry_runs_robots_in_bulk() {
    let processes = |text: &str| {
        let mut processes = Vec::new();
        for process in load(text).unwrap().processes {
            processes.push((process.name, process.robots.len()));
        }
        processes
    };
    let named = |names: &[(&str, usize)]| {
        let names = names.iter();
        names
            .map(|(name, robots)| ((*name).to_owned(), *robots))
            .collect::<Vec<_>>()
    };
    let each = "[[process]]\nname = \"*\"\ncommand = [\"x\"]";
    assert_eq!(processes(each), named(&[("Butler", 1), ("Leguin", 1)]));
    let together = "[[process]]\nname = \"all\"\ncommand = [\"x\"]\nrobots = [\"Le*\", \"Butler\"]";
    assert_eq!(processes(together), named(&[("all", 2)]));

    check(
        &each.replace('*', "S*"),
        &[
            "launch/x.toml:3:8",
            "no robot whose name matches S*",
            "its robots are Butler, Leguin",
        ],
    );
    check(
        &each.replace('*', "B*"),
        &["robot Leguin", "is run by no process"],
    );
    check(
        &format!("{each}\n[[process]]\nname = \"Butler\"\ncommand = [\"x\"]"),
        &["robot Butler is run by process Butler already"],
    );
    check(
        &format!("{each}\nrobots = [\"Butler\"]"),
        &["leave `robots` out"],
    );
}

#[test]
fn an_entry_is_as_many_processes_as_its_robots_need() {
    let text = |per_process: &str, more: &str| {
        format!(
            "[[process]]\nname = \"team\"\ncommand = [\"x\"]\nrobots = \"*\"\nper_process = {per_process}\n{more}"
        )
    };
    let names = |per_process: &str| {
        let mut names = Vec::new();
        for process in load(&text(per_process, "")).unwrap().processes {
            let robots = process.robots.iter().map(ToString::to_string);
            names.push((process.name, robots.collect::<Vec<_>>().join(" ")));
        }
        names
    };
    let own = |(name, robots): (&str, &str)| (name.to_owned(), robots.to_owned());
    assert_eq!(
        names("1"),
        [("team1", "Butler"), ("team2", "Leguin")].map(own)
    );
    for per_process in ["2", "64", "1024"] {
        assert_eq!(names(per_process), [("team1", "Butler Leguin")].map(own));
    }

    for wrong in ["0", "1025"] {
        check(
            &text(wrong, ""),
            &["launch/x.toml:6:15", "a process has 1 to 1024 robots"],
        );
    }
    check(&text("-1", ""), &["launch/x.toml:6:15"]);
    check(
        "[[process]]\nname = \"*\"\ncommand = [\"x\"]\nper_process = 2",
        &["launch/x.toml:5:15", "name the process"],
    );
    check(
        &text(
            "1",
            "[[process]]\nname = \"team2\"\nrobots = []\ncommand = [\"x\"]",
        ),
        &["a second process called team2", "per_process"],
    );
    check(
        "[[process]]\nname = \"team\"\ncommand = [\"x\"]\nrobots = 3",
        &["robots are a name or a pattern"],
    );
}

/// What is said about one process for both robots of the hall with these lines.
fn together(lines: &str) -> Result<(), FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hall.toml");
    std::fs::write(&path, format!("{lines}{SCENARIO}")).unwrap();
    let scenario = Scenario::load(&path, &Changes::default()).unwrap();
    let text =
        "scenario = \"hall.toml\"\n[[process]]\nname = \"all\"\ncommand = [\"x\"]\nrobots = \"*\"";
    let source = Source {
        name: "launch/x.toml".to_owned(),
        text: text.to_owned(),
    };
    LaunchFile::parse(source, folder.path())?.assign_robots(&scenario)
}

#[test]
fn what_ends_a_process_is_meant_for_all_robots_of_it() {
    let change = |set: &str| format!("[[change]]\nat = \"3 s\"\nset = [{set}]\n");
    let fault = |robot: &str, end: &str| {
        format!("[[fault]]\nrobot = \"{robot}\"\ndo = \"crash\"\nat = \"5 s\"\nuntil = \"{end}\"\n")
    };
    for apart in [
        change("\"robot.Leguin.params.x=1\""),
        change("\"robot.*.params.x=1\"") + &change("\"robot.Leguin.params.x=2\"").replace('3', "4"),
        "on_late = \"continue\"\n".to_owned() + &fault("Leguin", "9 s"),
        "on_late = \"continue\"\n".to_owned() + &fault("Leguin", "9 s") + &fault("Butler", "8 s"),
        "[[fault]]\nrobot = \"Butler\"\ndo = \"restart\"\nat = \"5 s\"\n".to_owned(),
        change("'fault=[{ robot = \"Butler\", do = \"restart\", at = \"5 s\" }]'"),
    ] {
        let error = together(&apart).expect_err(&apart);
        let shown = config::render_plain(&error, None, 200);
        assert!(shown.contains("launch/x.toml:5:"), "{shown}");
        assert!(shown.contains("the scenario stops or restarts"), "{shown}");
        assert!(shown.contains("a process of its own"), "{shown}");
    }

    for alike in [
        change("\"robot.*.params.x=1\""),
        change("\"network.commands.loss=0.5\""),
        "on_late = \"continue\"\n".to_owned() + &fault("Leguin", "9 s") + &fault("Butler", "9 s"),
        "[[fault]]\nrobot = \"Butler\"\ndo = \"slow\"\nat = \"5 s\"\n".to_owned(),
        "[[fault]]\nrobot = \"Butler\"\ndo = \"hang\"\nat = \"5 s\"\nfor = \"1 s\"\n".to_owned(),
    ] {
        let given = together(&alike);
        assert!(given.is_ok(), "{alike}\n{given:?}");
    }
}

#[test]
fn a_misspelt_key_is_shown_with_file_line_and_caret() {
    let shown = refusal("[[process]]\nname = \"Butler\"\ncomand = [\"cars-butler\"]");
    let line = shown
        .lines()
        .position(|line| line.contains("comand = ["))
        .expect("the line is shown");

    assert!(shown.contains("launch/x.toml:4:1"), "{shown}");
    assert!(
        shown.lines().nth(line + 1).unwrap().contains("· ───┬──"),
        "{shown}"
    );
    assert!(shown.contains("unknown field `comand`"), "{shown}");
}

#[test]
fn every_robot_is_run_by_exactly_one_process() {
    let butler = "[[process]]\nname = \"Butler\"\ncommand = [\"cars-butler\"]\n";
    check(
        butler,
        &[
            "launch/x.toml:1:",
            "robot Leguin of this scenario is run by no process",
            "name = \"Leguin\"",
            "command = [\"cars-leguin\"]",
        ],
    );

    let again =
        "[[process]]\nname = \"again\"\ncommand = [\"x\"]\nrobots = [\"Leguin\", \"Butler\"]\n";
    check(
        &format!("{butler}{again}"),
        &[
            "launch/x.toml:8:",
            "robot Butler is run by process Butler already",
        ],
    );

    let stranger = "[[process]]\nname = \"Vonda\"\ncommand = [\"cars-vonda\"]\n";
    check(
        &format!("{BOTH}{stranger}"),
        &["has no robot Vonda", "its robots are Butler, Leguin"],
    );
}

#[test]
fn names_are_unique_and_fit_for_files() {
    check(
        &format!("{BOTH}{BOTH}"),
        &["a second process called Butler"],
    );
    check(
        "[[process]]\nname = \"simulator\"\ncommand = [\"x\"]",
        &["simulator's own", "[simulator]"],
    );
    check(
        "[[process]]\nname = \"console\"\ncommand = [\"x\"]",
        &["console's own", "[console]"],
    );
    check(
        "[[process]]\nname = \"../x\"\ncommand = [\"x\"]",
        &["not a usable name", "launch/x.toml:3:8"],
    );
}

#[test]
fn values_are_checked_where_they_stand() {
    check(
        "speed = 0",
        &["launch/x.toml:2:9", "neither a number above zero nor `max`"],
    );
    check(
        "speed = true",
        &["a speed is a number above zero, or \"max\""],
    );
    check(
        "[[process]]\nname = \"B\"\ncommand = []",
        &["a command names at least a program"],
    );
    check(
        "[simulator]\ncommand = [\"\"]",
        &["a command names at least a program"],
    );
    check(
        "[[process]]\nname = \"B\"\ncommand = [\"x\"]\nrestart = \"sometimes\"",
        &["sometimes", "on-failure"],
    );
    check(
        "[[process]]\nname = \"B\"\ncommand = [\"x\"]\nbackoff = \"0 s\"",
        &["a back-off is more than zero"],
    );
    check(
        "[[process]]\nname = \"B\"\ncommand = [\"x\"]\nbackoff = \"2 ft\"",
        &["is not a time such as"],
    );
    check("[[process]]\nname = \"B\"", &["missing field `command`"]);
}

#[test]
fn paths_have_no_detours() {
    assert_eq!(
        tidy(Path::new("launch/../configs/./x.toml")),
        Path::new("configs/x.toml")
    );
    assert_eq!(tidy(Path::new("../../x")), Path::new("../../x"));
    assert_eq!(tidy(Path::new("/a/../x")), Path::new("/x"));
}
