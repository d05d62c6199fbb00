//! Robots in other languages over their standard input and output (`sdk/stdio`): compiled as their launch files say, and launched
//! as they are shipped.

use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use system_tests::conformance::assert_conforms;
use system_tests::processes::Running;
use system_tests::python::package;
use system_tests::tools::{has_python, lacks_tool};
use system_tests::{Lab, assert_same, root};

const LEGUIN: &str = "sdk/stdio/node/leguin.mjs";
const STROLLER: &str = "sdk/stdio/bash/stroller.sh";
const ANY_LANGUAGE: &str = "launch/any_language.toml";
const MIXED: &str = "launch/mixed.toml";

/// Whether a test cannot run because a tool is missing. It prints this on a user's machine, and fails in CI.
fn lacks(tool: &str, is_there: bool, remedy: &str) -> bool {
    if is_there {
        return false;
    }
    lacks_tool(
        "a test of robots in other languages",
        &format!("there is no {tool}; {remedy}"),
    );
    true
}

fn succeeds(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .output()
        .is_ok_and(|output| output.status.success())
}

fn lacks_compiler() -> bool {
    let mut preprocess = Command::new("cc");
    preprocess.args(["-E", "-include", "cjson/cJSON.h", "-xc", "/dev/null"]);
    lacks(
        "C compiler with cJSON",
        succeeds(&mut preprocess),
        "`apt-get install gcc libc6-dev libcjson-dev`",
    )
}

fn lacks_node() -> bool {
    let is_there = succeeds(
        Command::new("node").args(["-e", "if (parseInt(process.versions.node) < 18) throw 0"]),
    );
    lacks("Node.js", is_there, "install version 18 or later")
}

/// Runs a command from the project's root, which must succeed.
fn ok(command: &mut Command) -> Output {
    let output = command
        .current_dir(root())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "{command:?}: {}", printed(&output));
    output
}

fn printed(output: &Output) -> String {
    let out = String::from_utf8_lossy(&output.stdout);
    let err = String::from_utf8_lossy(&output.stderr);
    format!("{}\n{out}\n{err}", output.status)
}

/// The commands in the head of a launch file, to be typed before the first launch.
fn commands_of(launch_file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join(launch_file)).unwrap();
    let commands = text
        .lines()
        .filter_map(|line| line.strip_prefix("#     "))
        .map(str::to_owned);
    commands.collect()
}

/// An entry of a launch file, restarted when it fails.
fn process_of(name: &str, command: &str) -> String {
    format!("[[process]]\nname = \"{name}\"\nrestart = \"on-failure\"\ncommand = {command}\n")
}

/// The launch file of a scenario in which a program is Leguin and, if wanted, Vonda.
fn launch_file(lab: &Lab, scenario: &str, has_vonda: bool, leguin: &str) -> String {
    let scenario = root().join(scenario).display().to_string();
    let mut text = format!("scenario = {scenario:?}\n[console]\nenabled = false\n");
    text += &process_of("Butler", r#"["cars-butler"]"#);
    text += &process_of("Leguin", leguin);
    if has_vonda {
        text += &process_of("Vonda", leguin);
    }
    lab.write("launch.toml", &text).display().to_string()
}

/// The command of Leguin in JavaScript.
fn in_javascript() -> String {
    let program = root().join(LEGUIN).display().to_string();
    format!(r#"["cars", "exec", "--", {program:?}]"#)
}

/// Asserts that a launch gives the same run, byte for byte, as one process with the robots in Rust.
fn assert_same_as_in_rust(lab: &Lab, launch_file: &str, more: &[&str]) {
    lab.ok(&[&["run", launch_file, "--run", "in-rust"], more].concat());
    let launch = ["launch", launch_file, "--run", "launched", "--speed", "max"];
    lab.ok(&[&launch, more].concat());
    assert_same(
        (&format!("{more:?} in Rust"), &lab.bytes("in-rust")),
        ("launched", &lab.bytes("launched")),
    );
}

#[test]
fn robots_in_javascript_bid_by_broadcasts_with_payloads() {
    if lacks_node() {
        return;
    }

    let lab = Lab::new();
    let bidder = root()
        .join("sdk/stdio/node/bidder.mjs")
        .display()
        .to_string();
    let mut scenario = "duration = \"3 s\"\n".to_owned();
    let mut launch =
        "scenario = \"bids.toml\"\nspeed = \"max\"\n[console]\nenabled = false\n".to_owned();
    for (name, x) in [("Ada", "3.1"), ("Bo", "1.3"), ("Cyd", "5.7")] {
        scenario += &format!("[[robot]]\nname = \"{name}\"\nat = [\"{x} m\", \"2 m\"]\n");
        launch += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars\", \"exec\", \"--\", {bidder:?}]\n"
        );
    }
    lab.write("bids.toml", &scenario);
    let launch = lab.write("launch.toml", &launch);
    lab.ok(&["launch", launch.to_str().unwrap(), "--run", "bids"]);

    let events = lab.events("bids");
    let of_kind = |kind: &'static str| events.iter().filter(move |event| event["event"] == kind);
    assert_eq!(of_kind("command_delivered").count(), 6);
    let payloads: Vec<String> = of_kind("command_sent")
        .filter(|event| !event["payload"].is_null())
        .map(|event| event["payload"].to_string())
        .collect();
    // Once for each broadcast, and to the last bit: the distance of Bo.
    assert_eq!(payloads.len(), 3);
    let distance_m = (1.3_f64 * 1.3 + 2.0 * 2.0).sqrt();
    assert_eq!(
        payloads[1],
        format!(r#"{{"distance_m":{distance_m},"task":"clean"}}"#)
    );
    let gave_up: Vec<&str> = of_kind("behavior")
        .filter(|event| event["tick"] == 2 && event["to"] == "WAIT")
        .filter_map(|event| event["robot"].as_str())
        .collect();
    assert_eq!(gave_up, ["Ada", "Cyd"], "Bo is the nearest");

    // Played from the record: its payloads are there.
    lab.ok(&["verify", lab.out().join("bids").to_str().unwrap()]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn leguin_in_javascript_is_leguin_in_rust_byte_for_byte() {
    if lacks_node() {
        return;
    }

    for (scenario, has_vonda, seed) in [
        ("configs/hors_doeuvres.toml", false, "2002"),
        ("configs/partition.toml", false, "1"),
        ("configs/museum.toml", false, "2"),
        ("configs/three_robots.toml", true, "1"),
    ] {
        let lab = Lab::new();
        let file = launch_file(&lab, scenario, has_vonda, &in_javascript());
        assert_same_as_in_rust(&lab, &file, &["--seed", seed]);

        // A run in which Leguin does nothing would show nothing.
        let text = String::from_utf8(lab.bytes("launched")).unwrap();
        for part in [
            r#""robot":"Leguin","from":"REFILL","to":"EXCHANGE""#,
            "jokes: ",
            r#""blocked","robot":"Leguin""#,
        ] {
            assert!(text.contains(part), "{scenario}, seed {seed}: no {part}");
        }
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn her_parameters_and_vonda_mean_the_same_in_javascript() {
    if lacks_node() {
        return;
    }

    let lab = Lab::new();
    let file = launch_file(&lab, "configs/three_robots.toml", true, &in_javascript());
    let shorter = ["--duration", "200 s", "--seed", "5"];
    for changes in [
        &["robot.Butler.params.refiller=Vonda"][..],
        &[
            "robot.Leguin.params.hurry_mult=1.3",
            "robot.Leguin.params.caution=0.9",
        ],
        &[
            "robot.Leguin.params.affect=off",
            "robot.Vonda.params.schematic=off",
        ],
        &[
            "robot.Leguin.params.policy=rules",
            "robot.Vonda.params.policy=timer",
        ],
        // The waiter is not in the roster, so Leguin searches.
        &[
            "robot.Leguin.params.waiter=Nobody",
            "robot.Leguin.params.turn_mean_s=2.0",
        ],
        &[
            "robot.Leguin.params.sensory_motor=off",
            "robot.Leguin.params.dynamics.th_concerned=0.3",
            "tick=0.1s",
        ],
        &[
            "network.commands.loss=0.3",
            "network.queries.loss=0.3",
            "robot.Leguin.params.block_patience_s=10",
        ],
    ] {
        let sets = changes.iter().flat_map(|change| ["--set", change]);
        let more: Vec<&str> = shorter.into_iter().chain(sets).collect();
        assert_same_as_in_rust(&lab, &file, &more);
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn she_starts_over_and_takes_over_in_javascript_as_in_rust() {
    if lacks_node() {
        return;
    }
    let commands = [
        (r#"["cars-leguin"]"#.to_owned(), "rust"),
        (in_javascript(), "javascript"),
    ];
    let [in_rust, in_javascript] = commands.map(|(command, run)| {
        let lab = Lab::new();
        let file = launch_file(&lab, "configs/hors_doeuvres.toml", false, &command);
        let fault =
            "fault=[{ robot = \"Leguin\", do = \"crash\", at = \"60 s\", for = \"0.1 s\" }]";
        let name = format!("over-{run}");
        let args = ["--set", fault, "--duration", "150 s", "--seed", "6"];
        let mut launch = lab.paused(&name, &file, &args);

        // Part of the first epoch, then all of the second one with its crash.
        lab.until_ready(&name);
        lab.step(&name, 50);
        lab.ctl(&name, &["init"]);
        lab.until_ready(&name);
        lab.ctl(&name, &["start"]);
        launch.finish();
        lab.bytes(&name)
    });
    assert_same(("in Rust", &in_rust), ("in JavaScript", &in_javascript));

    let text = String::from_utf8(in_javascript).unwrap();
    for part in [
        "is back, and takes over where the last one was lost",
        r#""generation":2"#,
    ] {
        assert!(text.contains(part), "no {part}");
    }
}

/// The command of Walker in Python.
pub(crate) fn in_python() -> String {
    format!(
        r#"["python3", {:?}]"#,
        root().join("sdk/python/examples/walker.py")
    )
}

/// The record of a run in which a program is Walker: guests are in its way, and it is told something.
pub(crate) fn walk(lab: &Lab, run: &str, command: &str) -> Vec<u8> {
    lab.write(
        "walk.toml",
        "tick = \"0.1 s\"\nduration = \"60 s\"\n[guests]\ncount = 60\n[[robot]]\nname = \"Walker\"\nat = [\"7 ft\", \"9 ft\"]\n",
    );
    let text = format!(
        "scenario = \"walk.toml\"\n{}",
        process_of("Walker", command)
    );
    let file = lab.write(&format!("{run}.toml"), &text);
    let file = file.display().to_string();
    let launch = [
        "launch",
        &file,
        "--no-console",
        "--paused",
        "--speed",
        "max",
    ];

    let mut command = lab.cars(&[&launch[..], &["--run", run]].concat());
    command
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    let mut launch = Running::start(command, run, lab.out().join(run));
    lab.until_ready(run);
    lab.step(run, 10);
    lab.ok(&["ctl", "command", "Walker", "sit down", "--run", run]);
    lab.ctl(run, &["start"]);
    launch.finish();
    lab.bytes(run)
}

#[test]
fn walker_in_c_is_walker_in_python_byte_for_byte() {
    if lacks_compiler() || !has_python("Walker in Python") {
        return;
    }

    let lab = Lab::new();
    let in_c = walk(
        &lab,
        "walker-c",
        &format!(r#"["cars", "exec", "--", {:?}]"#, walker()),
    );
    let in_python = walk(&lab, "walker-python", &in_python());
    assert_same(("in Python", &in_python), ("in C", &in_c));

    let text = String::from_utf8(in_c).unwrap();
    for part in [
        "does not know what operator means by 'sit down'",
        "ANNOYED",
        "\"blocked\"",
    ] {
        assert!(text.contains(part), "no {part}");
    }
}

#[test]
fn doubles_that_are_not_computed_as_doubles_are_refused() {
    if lacks_compiler() {
        return;
    }

    let mut sloppy = Command::new("cc");
    sloppy.args(["-Ofast", "-c", "-o", "/dev/null", "sdk/stdio/c/walker.c"]);
    let output = sloppy.current_dir(root()).output().unwrap();
    let errors = printed(&output);
    assert!(
        errors.contains("doubles must be computed as doubles"),
        "{errors}"
    );
}

/// Runs a program with this text on its standard input.
fn run_with(program: &Path, session: &[u8]) -> Output {
    let mut command = Command::new(program);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());

    let mut child = command.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let session = session.to_vec();
    // It may end before it has read everything.
    let writer = std::thread::spawn(move || input.write_all(&session).is_ok());

    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

#[test]
fn the_page_makes_a_robot_from_nothing() {
    if lacks(
        "Python",
        succeeds(Command::new("python3").arg("--version")),
        "`apt-get install python3`",
    ) {
        return;
    }

    let page = std::fs::read_to_string(root().join("docs/any-language.md")).unwrap();
    let mut blocks = page.split("\n```").skip(1).step_by(2);
    let [program, scenario, launch] = ["python\n", "toml\n", "toml\n"].map(|language| {
        let block = blocks.next().and_then(|block| block.strip_prefix(language));
        block.unwrap_or_else(|| panic!("no block of {language}"))
    });

    let lab = Lab::new();
    let program = lab.write("walker.py", &format!("{program}\n"));
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    lab.write("walk.toml", scenario);
    let launch = lab.write("walk-launch.toml", launch).display().to_string();

    lab.ok(&[
        "launch",
        &launch,
        "--no-console",
        "--speed",
        "max",
        "--duration",
        "60 s",
        "--run",
        "page",
    ]);

    // Half a meter a second, but where a guest is in the way.
    let way_m = way_m(&lab, "page", "Walker");
    assert!(
        (10.0..=30.0).contains(&way_m),
        "it walked {way_m} m in a minute"
    );
    assert!(
        String::from_utf8(lab.bytes("page"))
            .unwrap()
            .contains("\"to\":\"CALM\"")
    );
}

/// Walker in C, compiled as the launch file states.
fn walker() -> PathBuf {
    static DONE: OnceLock<()> = OnceLock::new();
    DONE.get_or_init(|| {
        let [compile] = commands_of(ANY_LANGUAGE).try_into().unwrap();
        ok(Command::new("sh").args(["-c", &compile]));
    });
    root().join("target/walker")
}

/// What a robot changed to in a run: its emotions, or its behaviors.
fn changes(events: &[serde_json::Value], kind: &str, robot: &str) -> Vec<String> {
    events
        .iter()
        .filter(|event| event["event"] == kind && event["robot"] == robot)
        .filter(|event| event["from"].is_string())
        .map(|event| event["to"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn robots_in_c_and_bash_move_feel_and_repeat_themselves() {
    if lacks_compiler() {
        return;
    }
    walker();
    let lab = Lab::new();
    for run in ["any-first", "any-second"] {
        lab.start(
            run,
            &["launch", ANY_LANGUAGE, "--no-console", "--speed", "max"],
        )
        .finish();
    }
    let [first, second] = ["any-first", "any-second"].map(|run| lab.bytes(run));
    assert_same(("the first launch", &first), ("the second launch", &second));

    let events = lab.events("any-first");
    for (robot, felt) in [("Walker", "ANNOYED"), ("Bruno", "GRUMPY")] {
        let emotions = changes(&events, "emotion", robot);
        assert!(
            emotions.iter().any(|emotion| emotion == felt),
            "{robot} never was {felt}: {emotions:?}"
        );
        let way_m = way_m(&lab, "any-first", robot);
        assert!(way_m > 20.0, "{robot} moved by {way_m} m in 300 s");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn robots_over_stdin_and_stdout_keep_the_rules_of_the_protocol() {
    if lacks_compiler() || lacks_node() {
        return;
    }

    walker();
    let lab = Lab::new();
    let file = launch_file(&lab, "configs/three_robots.toml", true, &in_javascript());
    let in_javascript = PathBuf::from(&file);
    let any_language = root().join(ANY_LANGUAGE);

    std::thread::scope(|scope| {
        for robot in ["Leguin", "Vonda"] {
            scope.spawn(|| assert_conforms(&in_javascript, robot));
        }
        for robot in ["Walker", "Bruno"] {
            scope.spawn(|| assert_conforms(&any_language, robot));
        }
    });
}

/// The length of the way of a robot in a run, meters.
fn way_m(lab: &Lab, run: &str, robot: &str) -> f64 {
    let mut places = Vec::new();
    for tick in lab.recorded(run) {
        let mut robots = tick.frame.robots.into_iter();
        if let Some(own) = robots.find(|other| other.name.as_str() == robot) {
            places.push((own.location.x, own.location.y));
        }
    }

    places
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0).abs() + (pair[1].1 - pair[0].1).abs())
        .sum()
}

#[test]
fn every_program_ends_at_the_line_end_and_at_the_end_of_its_input() {
    if lacks_compiler() || lacks_node() {
        return;
    }

    let programs = [walker(), root().join(LEGUIN), root().join(STROLLER)];
    for program in programs {
        let end = run_with(&program, b"{\"type\":\"end\",\"reason\":\"finished\"}\n");
        assert!(
            end.status.success() && end.stdout.is_empty(),
            "{}: {}",
            program.display(),
            printed(&end)
        );

        let silence = run_with(&program, b"");
        assert!(
            silence.status.success() && silence.stdout.is_empty(),
            "{}: {}",
            program.display(),
            printed(&silence)
        );

        let rubbish = run_with(&program, b"rubbish\n");
        assert_eq!(
            rubbish.status.code(),
            Some(1),
            "{}: {}",
            program.display(),
            printed(&rubbish)
        );
        assert!(
            !rubbish.stderr.is_empty(),
            "{} does not report rubbish",
            program.display()
        );
    }
}

#[test]
fn robots_in_rust_python_and_javascript_in_one_run_are_the_robots_in_rust() {
    are_the_robots_in_rust("mixed", &[]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn vonda_refills_in_one_run_of_three_languages_as_in_rust() {
    are_the_robots_in_rust(
        "mixed-vonda",
        &["--set", "robot.Butler.params.refiller=Vonda"],
    );
    assert_conforms(&root().join(MIXED), "Leguin");
}

/// Plays the launch of robots in three languages.
fn are_the_robots_in_rust(run: &str, more: &[&str]) {
    if lacks_node() || !has_python("robots in three languages") {
        return;
    }

    let lab = Lab::new();
    lab.ok(&[&["run", MIXED, "--run", "in-rust"], more].concat());
    let launch = [
        "launch",
        MIXED,
        "--run",
        run,
        "--no-console",
        "--speed",
        "max",
    ];
    let mut launch = lab.cars(&[&launch, more].concat());
    // As it is here, installed or not.
    launch
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    ok(&mut launch);

    assert_same(
        ("all in Rust", &lab.bytes("in-rust")),
        ("in three languages", &lab.bytes(run)),
    );
    let end = &lab.events(run).pop().unwrap();
    assert_eq!(
        (&end["event"], &end["tick"]),
        (&"end".into(), &1200.into()),
        "{end}"
    );
}
