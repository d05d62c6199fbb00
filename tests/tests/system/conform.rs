//! The conformance kit on the robots of the project, which pass, and on robots that are wrong in one thing each, which
//! fail by the rule that forbids it.

mod stdio;

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use conform::{CheckSetting, KitPart, PAGE, ProtocolRule, RULES, RosterRobot};
use protocol::RobotName;
use protocol::messages::Point;
use system_tests::tools::has_python;
use system_tests::{Lab, objections, programs, root, side_by_side};

/// A robot that passes: a name for the report, more arguments of `cars conform`, the command from the project's root.
type Passing = (
    &'static str,
    &'static [&'static str],
    &'static [&'static str],
);

const BY_HAND: Passing = ("a robot by hand", &[], &["wrong-robot"]);

const IN_SCENARIOS: [Passing; 4] = [
    (
        "Butler in the hall",
        &["--scenario", "configs/hors_doeuvres.toml"],
        &["cars-butler"],
    ),
    (
        "a robot that drives",
        &["--scenario", "tests/tests/system/conform/rover.toml"],
        &["rover"],
    ),
    (
        "Leguin in the hall",
        &["--scenario", "launch/hors_doeuvres.toml"],
        &["cars-leguin"],
    ),
    (
        "Vonda in the hall",
        &["--scenario", "configs/three_robots.toml", "--name", "Vonda"],
        &["cars-vonda"],
    ),
];

const WITH_DEFAULT_PARAMETERS: [Passing; 5] = [
    ("Vonda", &[], &["cars-vonda"]),
    ("Butler", &[], &["cars-butler"]),
    ("Leguin", &[], &["cars-leguin"]),
    ("Bidder", &[], &["cars-bidder"]),
    ("Scout", &[], &["cars-scout"]),
];

/// A rule that a robot breaks whose parent process ignores signals.
const DEAF: &str = "end.sigterm";

/// A program of the project, or of the system.
fn program(name: &str) -> String {
    let own = programs().join(name);
    if own.exists() {
        own.to_str().unwrap().to_owned()
    } else {
        name.to_owned()
    }
}

fn cars(more: &[&str], command: &[&str]) -> std::process::Output {
    let (name, arguments) = command.split_first().unwrap();
    let mut cars = Command::new(programs().join("cars"));
    // Whether Python flushes is for each program to decide.
    cars.current_dir(root())
        .env_remove("PYTHONUNBUFFERED")
        .env("CARS_FLUSH_NOTICE_S", "1")
        .arg("conform")
        .args(more)
        .arg("--")
        .arg(program(name))
        .args(arguments);
    cars.output().unwrap()
}

/// The command of `wrong-robot`, with what it does wrong.
fn wrong(rule: &str) -> Command {
    let robot = program("wrong-robot");
    if rule == DEAF {
        // A signal that the shell ignores is also ignored by the program that replaces it.
        let mut command = Command::new("sh");
        command.args(["-c", "trap '' TERM; exec \"$0\"", &robot]);
        return command;
    }
    let mut command = Command::new(robot);
    command.args(["--wrong", rule]);
    command
}

fn setting() -> CheckSetting {
    CheckSetting {
        ticks: 40,
        // One sends the robot to sleep, and the other one wakes it.
        commands: vec!["rest".to_owned(), "fly".to_owned()],
        ..CheckSetting::default()
    }
}

/// The same for a robot that has a parameter.
fn setting_of_walker() -> CheckSetting {
    let role = |x, y, parameters| RosterRobot {
        location: Point::new(x, y),
        parameters,
        ..RosterRobot::default()
    };
    let parameters = [("step_m".to_owned(), 0.2.into())];
    CheckSetting {
        fake_peers: [
            (robot_name("Walker"), role(5.0, 5.0, parameters.into())),
            (robot_name("Echo"), role(7.0, 6.0, [].into())),
        ]
        .into(),
        ..setting()
    }
}

fn robot_name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// All rules are checked: there is occasion to every one of them.
fn conforms((what, more, command): Passing) {
    let output = cars(more, command);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{what}: {text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let passed = text.lines().filter(|line| line.starts_with("ok ")).count();
    assert_eq!(passed, RULES.len(), "{what}: {text}");
}

fn conform(robots: &[Passing]) {
    std::thread::scope(|scope| {
        for robot in robots {
            scope.spawn(|| conforms(*robot));
        }
    });
}

#[test]
fn a_robot_by_hand_conforms() {
    conforms(BY_HAND);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_robots_of_the_project_conform() {
    conform(&IN_SCENARIOS);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_robots_of_the_project_conform_with_default_parameters() {
    conform(&WITH_DEFAULT_PARAMETERS);
}

/// Further ways to break a rule, after the one that is named like the rule.
const OTHERWISE: [&str; 170] = [
    "epoch.init:exactly",
    "tick.state-first:panels",
    "epoch.init:restarts",
    "epoch.init:ranges",
    "return.generation:rejoin",
    "return.generation:newest",
    "end.gone:impatient",
    "query.again:impatient",
    "news.wait:impatient",
    "epoch.init:byte",
    "epoch.init:two-bytes",
    "epoch.init:put-off",
    "return.rejoin:put-off",
    "epoch.init:reseeds",
    "return.rejoin:reseeds",
    "return.rejoin:earlier",
    "return.rejoin:impatient",
    "command.order:exchanged",
    "tick.newest:deaf",
    "determinism.seed:rarely",
    "epoch.late:two-bytes",
    "command.twice:hundred",
    "command.payload:ascii",
    "return.generation:placed",
    "return.rejoin:asked",
    "query.again:gone",
    "end.clock:epoch",
    "join.request:instance",
    "join.ready-last:first",
    "join.ready-last:queryables",
    "join.ready-last:news",
    "join.refused:mute",
    "join.refused:impatient",
    "tick.answer:generation",
    "tick.answer:unasked",
    "tick.state-first:unsubscribed",
    "command.order:sorts",
    "command.twice:ten",
    "command.sent:generation",
    "command.sent:targets",
    "command.sent:ten",
    "command.payload:long",
    "news.wait:equal",
    "tick.newest:every",
    "query.reply:newest",
    "query.again:never",
    "return.generation:any",
    "return.generation:lower",
    "return.own-joined:over",
    "return.own-joined:lower",
    "end.gone:back",
    "end.gone:over",
    "number.angles:half",
    "number.angles:awake",
    "command.sent:late",
    "command.sent:numbers",
    "command.sent:count",
    "operator.commands:answers",
    "news.wait:any",
    "news.wait:always",
    "query.tick:any",
    "query.at-once:computes",
    "query.at-once:waits",
    "query.at-once:news",
    "query.asking:epoch",
    "query.asking:zero",
    "query.asking:unreachable",
    "query.asking:range",
    "query.once:holds",
    "query.once:percept",
    "query.once:others",
    "query.once:wildcard",
    "clock.duplicate:commands",
    "clock.duplicate:order",
    "clock.duplicate:bytes",
    "clock.late:epoch",
    "epoch.init:random",
    "epoch.init:variables",
    "epoch.init:count",
    "epoch.init:numbers",
    "epoch.init:received",
    "epoch.init:token",
    "epoch.init:instance",
    "epoch.init:welcome",
    "epoch.late:early",
    "determinism.seed:stream",
    "return.generation:number",
    "return.generation:state",
    "return.rejoin:variables",
    "return.replaced:status",
    "end.clock:finished",
    "end.clock:stopped",
    "end.clock:aborted",
    "end.clock:news",
    "end.clock:answer",
    "end.gone:hasty",
    "query.again:often",
    "query.asking:listed",
    "tick.newest:asking",
    "epoch.init:asking",
    "epoch.init:waiting",
    "epoch.init:few",
    "epoch.late:next",
    "command.order:senders",
    "determinism.seed:reseeds",
    "tick.newest:news",
    "query.asking:followed",
    "query.asking:followed-awake",
    "query.asking:awake",
    "clock.late:awake",
    "clock.late:quiet",
    "command.twice:senders",
    "command.payload:numbers",
    "command.payload:deep",
    "compat.unknown-fields:news",
    "compat.unknown-fields:clock",
    "compat.unknown-fields:join",
    "end.gone:asking",
    "epoch.late:token",
    "return.rejoin:token",
    "determinism.seed:reseeds-stream",
    "determinism.seed:reseeds-first",
    "return.rejoin:parameters",
    "query.at-once:parts",
    "determinism.seed:reseeds-skipped",
    "news.wait:repeated",
    "return.rejoin:once",
    "epoch.init:location",
    "command.order:interleaved",
    "command.twice:blocked",
    "command.twice:adjacent",
    "epoch.late:byte",
    "clock.duplicate:panels",
    "news.wait:epoch",
    "determinism.seed:32-bits",
    "determinism.seed:second-stream",
    "epoch.init:parameters",
    "return.generation:first-command",
    "return.generation:deaf",
    "command.order:many",
    "query.asking:first",
    "query.asking:some",
    "end.gone:second",
    "clock.duplicate:twice",
    "end.clock:unnamed",
    "return.rejoin:three",
    "return.replaced:taken",
    "return.rejoin:later",
    "epoch.init:field",
    "command.order:again",
    "query.reply:epoch",
    "query.again:tokens",
    "epoch.init:cache",
    "epoch.init:seed",
    "determinism.seed:frames",
    "determinism.seed:asked",
    "determinism.seed:hash",
    "join.refused:ended",
    "join.refused:ten",
    "return.generation:zero",
    "return.replaced:unnamed",
    "epoch.init:unnamed",
    "end.clock:repeated",
    "return.generation:byte",
    "return.generation:two-bytes",
    "query.reply:later",
    "query.tick:epoch",
    "command.order:letters",
    "command.payload:fields",
    "clock.late:joined",
];

/// Further ways that are about how a message is written or put.
const OTHERWISE_ON_THE_WIRE: [&str; 17] = [
    "wire.keys:simulator",
    "wire.keys:news",
    "wire.keys:report",
    "wire.keys:state",
    "wire.keys:viewer",
    "wire.keys:operator",
    "wire.keys:commands",
    "wire.keys:outboxes",
    "end.gone:status",
    "robust.malformed:silent",
    "number.integers:command",
    "number.integers:refused",
    "wire.qos:command",
    "wire.qos:express",
    "wire.qos:state",
    "wire.qos:hasty",
    "wire.qos:waiting",
];

/// How many kits run at the same time: where one rule is checked, their robots mostly wait.
const KITS: usize = 6;
const WHOLE_KITS: usize = 2;

/// The rule that a robot breaks, from the way in which it does.
fn rule_of(how: &str) -> &str {
    how.split(':').next().unwrap()
}

/// What is wrong with the verdict on a robot that breaks a rule in this way: it must fail by that rule alone.
fn misjudged(how: &str, rules: &[ProtocolRule]) -> Option<String> {
    let name = rule_of(how);
    let report = match conform::check(&wrong(how), &setting_of_walker(), rules, &|_, _| ()) {
        Ok(report) => report,
        Err(error) => return Some(format!("{how}: {error}")),
    };
    let failed: Vec<&str> = report.failed().map(|(rule, _)| rule.name).collect();
    if failed != [name] {
        return Some(format!("{how} fails by {failed:?}: {report}"));
    }

    let reference = ProtocolRule::named(name).unwrap().reference();
    let is_referred = report.to_tap().contains(&format!("see: \"{reference}\""));
    (!is_referred).then(|| format!("{how}: no reference to the page: {report}"))
}

/// Judges robots side by side, by these rules or by all where there are none.
fn judge(robots: &[(&str, Vec<ProtocolRule>)], kits: usize) {
    let misjudgments = objections(robots, kits, |(how, rules)| misjudged(how, rules));
    assert!(misjudgments.is_empty(), "{}", misjudgments.join("\n"));
}

/// One of each part of the kit that is about one thing at a time: the others are checked with `--include-ignored`.
#[test]
fn a_wrong_robot_fails_in_the_part_in_which_it_is_wrong() {
    let robots = [
        ("query.once", KitPart::Alone),
        ("return.rejoin:later", KitPart::LaterEpoch),
        ("command.sent:generation", KitPart::Rejoined),
    ];
    let misjudgments = objections(&robots, KITS, |(how, part)| {
        let rule = ProtocolRule::named(rule_of(how)).unwrap();
        let checked = conform::check(&wrong(how), &setting_of_walker(), &[rule], &|_, _| ());
        let report = checked.unwrap();
        let parts: Vec<KitPart> = report.failed().map(|(_, failure)| failure.part).collect();
        (parts != [*part]).then(|| format!("{how}: {report}"))
    });
    assert!(misjudgments.is_empty(), "{}", misjudgments.join("\n"));
}

/// All rules are checked of a robot that breaks the first of each section; the others take as long and are played by their rule only.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_wrong_robot_fails_by_the_rule_that_it_breaks_and_by_no_other() {
    let mut robots = Vec::new();
    let mut before = None;
    for rule in RULES {
        let section = rule.name.split('.').next();
        let rules = if section == before {
            vec![rule]
        } else {
            Vec::new()
        };
        robots.push((rule.name, rules));
        before = section;
    }
    judge(&robots, WHOLE_KITS);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn rules_can_be_broken_in_more_than_one_way() {
    let mut robots = Vec::new();
    for how in OTHERWISE.iter().chain(&OTHERWISE_ON_THE_WIRE) {
        let mut rules = vec![ProtocolRule::named(rule_of(how)).unwrap()];
        // A state is put where there is a subscriber, which another check has.
        if *how == "wire.qos:state" {
            rules.push(ProtocolRule::named("query.tick").unwrap());
        }
        // Tokens are looked at where the simulator is gone.
        if *how == "wire.keys:simulator" {
            rules.push(ProtocolRule::named("end.gone").unwrap());
        }
        // It waits for an answer where others hold theirs back.
        if ["wire.qos:waiting", "wire.qos:hasty"].contains(how) {
            rules.push(ProtocolRule::named("query.waiting").unwrap());
        }
        robots.push((*how, rules));
    }
    judge(&robots, KITS);
}

#[test]
fn what_cannot_be_checked_is_reported() {
    for (more, command, reason) in [
        (&[][..], &["/no/such/program"][..], "No such file"),
        (&[], &["true"], "a request to join: it never came"),
        (
            &["--name", "Vonda"],
            &["wrong-robot"],
            "asks to be Walker, and Vonda is checked",
        ),
        (
            &["--scenario", "configs/hors_doeuvres.toml"],
            &["wrong-robot"],
            "its robots are Butler, Leguin",
        ),
        (
            &["--scenario", "configs/none.toml"],
            &["wrong-robot"],
            "none.toml",
        ),
        (
            &["--rule", "tick.tock"],
            &["wrong-robot"],
            "there is no such rule",
        ),
    ] {
        let output = cars(more, command);
        let error = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");

        assert_eq!(output.status.code(), Some(2), "{command:?}: {error}");
        assert!(error.to_lowercase().starts_with("error:"), "{error}");
        assert!(error.contains(reason), "{command:?}: {error}");
    }
}

#[test]
fn one_rule_can_be_checked_and_reported_as_json() {
    let output = cars(
        &["--json", "--rule", "end.clock", "--ticks", "24"],
        &["wrong-robot", "--wrong", "end.clock"],
    );
    assert_eq!(output.status.code(), Some(1));

    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&report["robot"], &report["failed"]),
        (&"Walker".into(), &1.into()),
        "{report}"
    );

    let [rule] = &report["rules"].as_array().unwrap()[..] else {
        panic!("one rule was asked for: {report}")
    };
    assert_eq!(
        (&rule["rule"], &rule["verdict"]),
        (&"end.clock".into(), &"failed".into())
    );

    assert!(
        rule["expected"].as_str().unwrap().contains("exit status 0"),
        "{rule}"
    );
    assert!(
        rule["came"].as_str().unwrap().contains("exit status: 3"),
        "{rule}"
    );
    assert_eq!(report["time.answer"]["ticks"], 25);
}

/// A program over standard input and output that answers each line and leaves its output to Python's buffer.
const UNFLUSHED: &str = r#"#!/usr/bin/env python3
import sys

for line in sys.stdin:
    if '"type":"end"' in line:
        break
    if '"type":"init"' in line and '"tick":0,' not in line:
        continue
    print('{"type":"done"}')
"#;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_program_that_does_not_flush_is_told_so() {
    if !has_python("the kit with a robot in Python") {
        return;
    }

    let lab = Lab::new();
    let flushed = UNFLUSHED.replace("\"}')", "\"}', flush=True)");
    let check = |name: &str, text: &str| {
        let program = lab.write(name, text);
        std::fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();

        let output = cars(
            &["--rule", "tick.answer"],
            &[
                "cars",
                "exec",
                "--name",
                "Mute",
                "--",
                program.to_str().unwrap(),
            ],
        );

        let printed = String::from_utf8_lossy(&output.stdout);
        let is_right = name == "right.py";
        assert_eq!(output.status.success(), is_right, "{name}: {printed}");
        for part in [
            "a report for tick 0",
            "its program has not flushed its standard output",
            "in Python with print(…, flush=True)",
        ] {
            assert_eq!(printed.contains(part), !is_right, "{name}: {printed}");
        }
    };
    side_by_side(&[
        ("silent.py", &|| check("silent.py", UNFLUSHED)),
        ("right.py", &|| check("right.py", &flushed)),
    ]);
}

/// Anchors of a page: its headings as links name them.
fn anchors(page: &str) -> Vec<String> {
    let mut anchors = Vec::new();
    for line in page.lines().filter(|line| line.starts_with('#')) {
        let heading = line.trim_start_matches('#').trim().to_lowercase();
        let anchor = heading
            .replace(' ', "-")
            .chars()
            .filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_')
            .collect();
        anchors.push(anchor);
    }
    anchors
}

#[test]
fn the_page_explains_every_rule_where_the_kit_refers_to_it() {
    let page = std::fs::read_to_string(root().join(Path::new(PAGE))).unwrap();
    let anchors = anchors(&page);

    for rule in conform::rules() {
        assert!(
            anchors.iter().any(|anchor| anchor == rule.section),
            "{} has no heading",
            rule.reference()
        );
        assert!(
            page.contains(&format!("**`{}`**", rule.name)),
            "{PAGE} does not state {}",
            rule.name
        );
    }
}
