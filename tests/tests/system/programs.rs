//! Robots in other languages over their standard input and output (`sdk/stdio`): compiled as their pages say, and launched
//! as they are shipped.

use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use protocol::random::{Stream, stream, unit};
use system_tests::conformance::assert_conforms;
use system_tests::python::{package, python};
use system_tests::tools::lacks_tool;
use system_tests::{Lab, assert_same, eventually, root};

const C: &str = "sdk/stdio/c/leguin.c";
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
    lacks(
        "C compiler",
        succeeds(Command::new("cc").arg("--version")),
        "`apt-get install gcc libc6-dev`",
    )
}

fn lacks_node() -> bool {
    let is_there = succeeds(
        Command::new("node").args(["-e", "if (parseInt(process.versions.node) < 18) throw 0"]),
    );
    lacks("Node.js", is_there, "install version 18 or later")
}

fn lacks_typescript() -> bool {
    lacks(
        "TypeScript",
        tsc().exists(),
        "`npm --prefix crates/console/check install`",
    )
}

fn tsc() -> PathBuf {
    root().join("crates/console/check/node_modules/.bin/tsc")
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

/// Leguin in C, compiled with these options.
fn compiled(lab: &Lab, options: &str) -> PathBuf {
    let program = lab.out().join("leguin");
    let mut cc = Command::new("cc");
    cc.args(options.split_whitespace())
        .arg("-o")
        .arg(&program)
        .args([C, "-lm"]);
    ok(&mut cc);
    program
}

/// An entry of a launch file, restarted when it fails.
fn process_of(name: &str, command: &str) -> String {
    format!("[[process]]\nname = \"{name}\"\nrestart = \"on-failure\"\ncommand = {command}\n")
}

/// A launch of a scenario in which one program is Leguin and, if wanted, Vonda.
struct Cast {
    lab: Lab,
    /// The scenario of the launch, and of the run to compare it with.
    scenario: PathBuf,
    /// The launch file.
    file: String,
}

impl Cast {
    fn new(lab: Lab, scenario: &str, has_vonda: bool, leguin: &str) -> Self {
        let scenario = root().join(scenario);
        let head = format!(
            "scenario = {:?}\n[console]\nenabled = false\n",
            scenario.display().to_string()
        );

        let mut text =
            head + &process_of("Butler", r#"["cars-butler"]"#) + &process_of("Leguin", leguin);
        if has_vonda {
            text += &process_of("Vonda", leguin);
        }

        let file = lab.write("launch.toml", &text).display().to_string();
        Self {
            lab,
            scenario,
            file,
        }
    }

    /// With Leguin in C, compiled with these options.
    fn in_c(scenario: &str, has_vonda: bool, options: &str) -> Self {
        let lab = Lab::new();
        compiled(&lab, options);
        Self::new(
            lab,
            scenario,
            has_vonda,
            r#"["cars", "exec", "--", "./leguin"]"#,
        )
    }

    /// Asserts that the launch gives the same run, byte for byte, as one process with the robots in Rust.
    fn assert_same_as_in_rust(&self, more: &[&str]) {
        let scenario = self.scenario.display().to_string();
        let mut local = vec!["run", &scenario, "--run", "in-rust"];
        local.extend(more);
        self.lab.ok(&local);
        let mut launch = vec!["launch", &self.file, "--run", "in-c", "--speed", "max"];
        launch.extend(more);
        self.lab.ok(&launch);

        let in_rust = self.lab.bytes("in-rust");
        let in_c = self.lab.bytes("in-c");
        assert_same(
            (&format!("{scenario} {more:?} in Rust"), &in_rust),
            ("with C", &in_c),
        );
    }
}

/// The options of the page.
const PLAIN: &str = "-std=c11 -O2 -ffp-contract=off";

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn leguin_in_c_is_leguin_in_rust_byte_for_byte() {
    if lacks_compiler() {
        return;
    }

    for (scenario, has_vonda) in [
        ("configs/hors_doeuvres.toml", false),
        ("configs/partition.toml", false),
        ("configs/museum.toml", false),
        ("configs/three_robots.toml", true),
    ] {
        let cast = Cast::in_c(scenario, has_vonda, PLAIN);
        for seed in ["1", "2", "2002"] {
            cast.assert_same_as_in_rust(&["--seed", seed]);

            // A run in which Leguin does nothing would show nothing.
            let text = String::from_utf8(cast.lab.bytes("in-c")).unwrap();
            for part in [
                r#""robot":"Leguin","from":"REFILL","to":"EXCHANGE""#,
                "jokes: ",
                r#""blocked","robot":"Leguin""#,
            ] {
                assert!(text.contains(part), "{scenario}, seed {seed}: no {part}");
            }
        }
    }
}

#[test]
fn her_parameters_and_vonda_mean_the_same_in_c() {
    if lacks_compiler() {
        return;
    }

    let cast = Cast::in_c("configs/three_robots.toml", true, PLAIN);
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
        cast.assert_same_as_in_rust(&more);
    }
}

#[test]
fn no_compiler_fuses_her_arithmetic() {
    if lacks_compiler() {
        return;
    }

    // Permits fused operations on machines that have them.
    Cast::in_c("configs/hors_doeuvres.toml", false, "-O3 -march=native")
        .assert_same_as_in_rust(&["--seed", "3"]);

    let mut sloppy = Command::new("cc");
    let output = sloppy
        .current_dir(root())
        .args(["-Ofast", "-c", "-o", "/dev/null", C])
        .output()
        .unwrap();
    assert!(
        printed(&output).contains("doubles must be computed as doubles"),
        "{}",
        printed(&output)
    );
}

#[test]
fn she_starts_over_and_takes_over_in_c_as_in_rust() {
    if lacks_compiler() {
        return;
    }
    let commands = [
        (r#"["cars-leguin"]"#, "rust"),
        (r#"["cars", "exec", "--", "./leguin"]"#, "c"),
    ];
    let [in_rust, in_c] = commands.map(|(command, run)| {
        let lab = Lab::new();
        compiled(&lab, PLAIN);
        let cast = Cast::new(lab, "configs/hors_doeuvres.toml", false, command);
        let fault =
            "fault=[{ robot = \"Leguin\", do = \"crash\", at = \"60 s\", for = \"0.1 s\" }]";

        let args = [
            "--set",
            fault,
            "--duration",
            "150 s",
            "--speed",
            "max",
            "--seed",
            "6",
            "--paused",
        ];
        let name = format!("over-{run}");
        let args: Vec<&str> = ["launch", &cast.file].into_iter().chain(args).collect();

        let mut launch = cast.lab.start(&name, &args);
        let ctl = |args: &[&str]| {
            let args: Vec<&str> = ["ctl"]
                .iter()
                .chain(args)
                .chain(&["--run", &name])
                .copied()
                .collect();
            cast.lab
                .cars(&args)
                .output()
                .is_ok_and(|output| output.status.success())
        };

        // Part of the first epoch, then all of the second one with its crash.
        eventually("the first ticks", || ctl(&["step", "50"]).then_some(()));
        eventually("the second epoch", || ctl(&["init"]).then_some(()));
        eventually("its start", || ctl(&["start"]).then_some(()));
        launch.finish();
        cast.lab.bytes(&name)
    });
    assert_same(("in Rust", &in_rust), ("in C", &in_c));

    let text = String::from_utf8(in_c).unwrap();
    for part in [
        "is back, and takes over where the last one was lost",
        r#""generation":2"#,
    ] {
        assert!(text.contains(part), "no {part}");
    }
}

/// A session with Leguin in which every query of hers has an answer.
const SESSION: &[&str] = &[
    r#"{"type":"init","protocol":2,"run":"r","name":"Leguin","generation":1,"epoch":1,"tick":0,"seed":42,"stream":"robot/Leguin","tick_s":0.5,"field_m":[15.24,15.24],"body_m":0.6096,"sensing_range_m":1.8288,"location":{"x":1.2192,"y":1.2192},"roster":["Butler","Leguin"],"parameters":{"waiter":"Butler","affect":"on","dynamics":{"label_cuts":[0.2,0.4,0.6,0.8]}}}"#,
    r#"{"type":"tick","tick":1,"location":{"x":1.2192,"y":1.2192},"commands":[{"from":"Butler","performative":"achieve","command":"refill"},{"from":"Bot","performative":"achieve","command":"\u00e9\ud83d\ude00 \"\\\u0007\u0000\n 0123456789012345678901234567890123456789012345678901234567890"}],"sensed":[{"name":"Vonda","location":{"x":1.0,"y":2e0}}]}"#,
    r#"{"type":"answer","value":{"epoch":1,"tick":0,"location":{"x":7.62,"y":7.62},"state_variables":{"need":true,"refiller":"Leguin"}}}"#,
    r#"{"type":"tick","tick":2,"location":{"x":1.2192,"y":1.2192}}"#,
    r#"{"type":"answer","error":"unreachable"}"#,
    r#"{"type":"tick","tick":3,"location":{"x":1.2192,"y":1.2192},"blocked":true}"#,
    r#"{"type":"answer","error":"unreachable"}"#,
    r#"{"type":"answer","value":{"bodies":[{"kind":"guest","location":{"x":1.5,"y":1.5}}]}}"#,
    r#"{"type":"end","reason":"finished"}"#,
];

/// A random whole number below `count`.
fn below(count: usize, chance: &mut Stream) -> usize {
    (unit(chance) * count as f64) as usize
}

/// The session with a few bytes changed, repeated, removed, or replaced by texts that are hard to parse.
fn damaged(chance: &mut Stream) -> Vec<u8> {
    const STUMBLING: &[&str] = &[
        "null",
        "1e999",
        "-",
        "\\ud800",
        "\n",
        "\0",
        "{",
        "]",
        "\"",
        "[[[[[[[[[[[[",
        "99999999999999999999",
    ];
    let mut session = SESSION.join("\n").into_bytes();
    for _ in 0..1 + below(4, chance) {
        let at = below(session.len(), chance);
        let len = below(12, chance);
        let end = (at + len).min(session.len());

        match below(5, chance) {
            0 => session[at] = u8::try_from(below(256, chance)).unwrap(),
            1 => drop(session.drain(at..end)),
            2 => drop(session.splice(at..at, session[at..end].to_vec())),
            3 => drop(session.splice(at..at, STUMBLING[below(STUMBLING.len(), chance)].bytes())),
            _ => drop(session.splice(at..at, vec![b'['; 100 * len])),
        }
        session.push(b'\n');
    }
    session
}

/// Runs a program with this text on its standard input.
fn run_with(program: &Path, session: &[u8]) -> Output {
    let mut command = Command::new(program);
    command
        .env("ASAN_OPTIONS", "exitcode=99")
        .env("UBSAN_OPTIONS", "halt_on_error=1:exitcode=99");
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
#[ignore = "thorough: with `-- --include-ignored`"]
fn no_input_breaks_leguin_in_c() {
    const STRICT: &str = "-std=c11 -O1 -g -Wall -Wextra -Wshadow -Wconversion -pedantic -Werror \
                          -fsanitize=address,undefined -fno-sanitize-recover=all";
    if lacks_compiler() {
        return;
    }
    let lab = Lab::new();
    let empty = lab.write("empty.c", "int main(void) { return 0; }\n");
    let program = lab.out().join("empty");
    let sanitizes = succeeds(
        Command::new("cc")
            .args(["-fsanitize=address,undefined", "-o"])
            .args([&program, &empty]),
    );
    if lacks(
        "C compiler with sanitizers",
        sanitizes,
        "`apt-get install gcc`",
    ) {
        return;
    }
    let cast = Cast::in_c("configs/three_robots.toml", true, STRICT);
    cast.assert_same_as_in_rust(&["--seed", "4", "--duration", "120 s"]);

    let program = cast.lab.out().join("leguin");
    let whole = run_with(&program, SESSION.join("\n").as_bytes());
    assert!(whole.status.success(), "{}", printed(&whole));
    assert_eq!(
        String::from_utf8_lossy(&whole.stdout)
            .matches("\"done\"")
            .count(),
        4,
        "{}",
        printed(&whole)
    );
    let mut chance = stream(1, "damage");
    let mut refused = 0;
    for _ in 0..300 {
        let session = damaged(&mut chance);
        let output = run_with(&program, &session);
        let status = output.status.code();
        let text = String::from_utf8_lossy(&output.stderr);
        let is_refusal =
            status == Some(1) && text.starts_with("leguin: ") && text.lines().count() == 1;
        assert!(
            status == Some(0) || is_refusal,
            "{}\nafter\n{}",
            printed(&output),
            String::from_utf8_lossy(&session)
        );
        refused += usize::from(is_refusal);
    }
    assert!(
        refused > 100,
        "only {refused} of 300 damaged sessions were refused"
    );
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

/// Compiles the robot in TypeScript as the launch file states; `npx` would fetch the compiler that the console's check has.
fn companion_is_compiled() {
    static DONE: OnceLock<()> = OnceLock::new();
    DONE.get_or_init(|| {
        let [command] = commands_of(ANY_LANGUAGE).try_into().unwrap();
        let args = command.strip_prefix("npx -p typescript tsc ").unwrap();
        ok(Command::new(tsc()).args(args.split_whitespace()));
    });
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
fn robots_in_javascript_typescript_and_bash_move_feel_and_repeat_themselves() {
    if lacks_node() || lacks_typescript() {
        return;
    }
    companion_is_compiled();
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
    for (robot, felt) in [("Nora", "LONELY"), ("Tove", "WORRIED"), ("Bruno", "GRUMPY")] {
        let emotions = changes(&events, "emotion", robot);
        assert!(
            emotions.iter().any(|emotion| emotion == felt),
            "{robot} never was {felt}: {emotions:?}"
        );
        assert!(
            !changes(&events, "behavior", robot).is_empty(),
            "{robot} did the same all the time"
        );
        let way_m = way_m(&lab, "any-first", robot);
        assert!(way_m > 20.0, "{robot} moved by {way_m} m in 300 s");
    }
    // They send each other commands.
    for part in [
        r#""command_sent","from":"Nora","to":"Tove""#,
        "nods to Nora",
    ] {
        assert!(String::from_utf8_lossy(&first).contains(part), "no {part}");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn robots_over_stdin_and_stdout_keep_the_rules_of_the_protocol() {
    if lacks_compiler() || lacks_node() || lacks_typescript() {
        return;
    }

    companion_is_compiled();
    let cast = Cast::in_c("configs/three_robots.toml", true, PLAIN);
    let in_c = PathBuf::from(&cast.file);
    let any_language = root().join(ANY_LANGUAGE);

    std::thread::scope(|scope| {
        for robot in ["Leguin", "Vonda"] {
            scope.spawn(|| assert_conforms(&in_c, robot));
        }
        for robot in ["Nora", "Tove", "Bruno"] {
            scope.spawn(|| assert_conforms(&any_language, robot));
        }
    });
}

/// The robot that was written with nothing but `docs/protocol.md`.
#[test]
fn a_robot_in_perl_draws_and_keeps_the_rules() {
    let is_there = succeeds(Command::new("perl").args(["-MJSON::PP", "-e1"]));
    if lacks("Perl with JSON::PP", is_there, "`apt-get install perl`") {
        return;
    }
    let wanderer = root().join("sdk/stdio/perl/wanderer.pl");
    ok(Command::new(&wanderer).args(["--check", "docs/vectors/streams.json"]));

    let lab = Lab::new();
    let scenario = "[[robot]]\nname = \"Wanda\"\nat = [\"25 ft\", \"25 ft\"]\n[[robot]]\nname = \"Wim\"\nat = [\"9 ft\", \"9 ft\"]\n";
    lab.write("stroll.toml", scenario);
    let mut launch = "scenario = \"stroll.toml\"\n".to_owned();
    for name in ["Wanda", "Wim"] {
        launch += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars\", \"exec\", \"--\", \"{}\"]\n",
            wanderer.display()
        );
    }
    let launch = lab.write("stroll-launch.toml", &launch);

    for run in ["perl-first", "perl-second"] {
        lab.ok(&[
            "launch",
            launch.to_str().unwrap(),
            "--run",
            run,
            "--no-console",
            "--speed",
            "max",
        ]);
    }
    assert_same(
        ("the first launch", &lab.bytes("perl-first")),
        ("the second", &lab.bytes("perl-second")),
    );

    assert!(way_m(&lab, "perl-first", "Wanda") > 20.0);
    assert_conforms(&launch, "Wanda");
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
    if lacks_compiler() || lacks_node() || lacks_typescript() {
        return;
    }
    companion_is_compiled();

    let lab = Lab::new();
    let stdio = root().join("sdk/stdio");
    let programs = [
        compiled(&lab, PLAIN),
        stdio.join("node/greeter.mjs"),
        stdio.join("typescript/companion"),
        stdio.join("bash/stroller.sh"),
    ];
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
fn robots_in_rust_python_and_c_in_one_run_are_the_robots_in_rust() {
    let has_python = succeeds(python().args(["-c", "import cars"]));
    if lacks_compiler() || lacks("Python", has_python, "`apt-get install python3`") {
        return;
    }

    let compile = commands_of(MIXED)
        .into_iter()
        .find(|command| command.starts_with("cc "));
    ok(Command::new("sh").args(["-c", &compile.unwrap()]));

    let lab = Lab::new();
    for (run, more) in [
        ("mixed", &[][..]),
        (
            "mixed-vonda",
            &["--set", "robot.Butler.params.refiller=Vonda"],
        ),
    ] {
        let alone = format!("{run}-rust");
        let local: Vec<&str> = ["run", MIXED, "--run", &alone]
            .iter()
            .chain(more)
            .copied()
            .collect();
        lab.ok(&local);

        let launch = [
            "launch",
            MIXED,
            "--run",
            run,
            "--no-console",
            "--speed",
            "max",
        ];
        let mut launch = lab.cars(&launch.iter().chain(more).copied().collect::<Vec<_>>());
        // As it is here, installed or not.
        launch
            .env("PYTHONPATH", package())
            .env("PYTHONDONTWRITEBYTECODE", "1");
        ok(&mut launch);

        assert_same(
            ("all in Rust", &lab.bytes(&alone)),
            ("in three languages", &lab.bytes(run)),
        );
        let end = &lab.events(run).pop().unwrap();
        assert_eq!(
            (&end["event"], &end["tick"]),
            (&"end".into(), &1200.into()),
            "{end}"
        );
    }
    assert_conforms(&root().join(MIXED), "Leguin");
}
