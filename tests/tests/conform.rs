//! The conformance kit on the robots of the project, which pass, and on robots that are wrong in one thing each, which
//! fail by the rule that forbids it.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;
use std::process::Command;

use conform::{PAGE, RULES, Report, Rule, Setting, Verdict};
use system_tests::{programs, root};

/// Robots that pass: what to call it, more arguments of `cars conform`, the command from the project's root.
const ROBOTS: [(&str, &[&str], &[&str]); 7] = [
    ("a robot by hand", &[], &["wrong-robot"]),
    ("Vonda", &[], &["cars-vonda"]),
    ("Butler, with default parameters", &[], &["cars-butler"]),
    ("Leguin, with default parameters", &[], &["cars-leguin"]),
    (
        "Butler in the hall",
        &["--scenario", "configs/hors_doeuvres.toml"],
        &["cars-butler"],
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

/// Rules for which a robot must be started by somebody who ignores signals.
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
    cars.current_dir(root())
        .arg("conform")
        .args(more)
        .arg("--")
        .arg(program(name))
        .args(arguments);
    cars.output().unwrap()
}

/// The robot by hand, with what it does wrong.
fn wrong(rule: &str) -> Command {
    let robot = program("wrong-robot");
    if rule == DEAF {
        // What is ignored stays ignored by the program that takes the shell's place.
        let mut command = Command::new("sh");
        command.args(["-c", "trap '' TERM; exec \"$0\"", &robot]);
        return command;
    }
    let mut command = Command::new(robot);
    command.args(["--wrong", rule]);
    command
}

fn setting() -> Setting {
    Setting {
        ticks: 40,
        ..Setting::default()
    }
}

/// The rules that failed, with what came.
fn failed(report: &Report) -> Vec<String> {
    report
        .failed()
        .map(|(rule, failure)| format!("{}: {failure:?}", rule.name))
        .collect()
}

fn conforms(what: &str, more: &[&str], command: &[&str]) {
    let output = cars(more, command);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{what}: {text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let is_ok = |line: &&str| line.starts_with("ok ");
    assert_eq!(
        text.lines().filter(is_ok).count(),
        RULES.len(),
        "{what}: {text}"
    );
}

#[test]
fn the_robots_of_the_project_conform() {
    std::thread::scope(|scope| {
        for (what, more, command) in ROBOTS {
            scope.spawn(move || conforms(what, more, command));
        }
    });
}

#[test]
fn a_robot_by_hand_gives_occasion_to_every_rule() {
    let report = conform::check(&wrong(""), &setting(), &[]).unwrap();
    let passed = report
        .outcomes
        .iter()
        .filter(|outcome| outcome.verdict == Verdict::Passed)
        .count();
    assert_eq!(passed, RULES.len(), "{report}");
}

/// Each rule has a robot that breaks it, and whose other rules hold: 28 robots, a few at a time.
fn wrong_robots_fail_by_their_rule(part: usize) {
    for rule in RULES.into_iter().skip(part).step_by(PARTS) {
        let report = conform::check(&wrong(rule.name), &setting(), &[]).unwrap();
        let failed = failed(&report);
        assert!(
            matches!(&failed[..], [one] if one.starts_with(&format!("{}:", rule.name))),
            "a robot that breaks {} fails by {failed:#?}",
            rule.name
        );
        assert!(
            report
                .to_tap()
                .contains(&format!("see: \"{}\"", rule.reference())),
            "{report}"
        );
    }
}

/// Further ways to break a rule.
const OTHERWISE: [&str; 11] = [
    "join.request:instance",
    "join.ready-last:first",
    "join.refused:mute",
    "join.refused:impatient",
    "tick.answer:generation",
    "tick.state-first:unheard",
    "query.early:impatient",
    "clock.duplicate:commands",
    "epoch.init:remembers",
    "return.numbers:stream",
    "return.replaced:content",
];

#[test]
fn rules_can_be_broken_in_more_than_one_way() {
    for how in OTHERWISE {
        let rule = Rule::named(how.split(':').next().unwrap()).unwrap();
        let report = conform::check(&wrong(how), &setting(), &[rule]).unwrap();
        assert_eq!(report.outcomes.len(), 1);
        assert!(!report.is_passed(), "{how}: {report}");
    }
}

/// Tests that share the wrong robots.
const PARTS: usize = 4;

#[test]
fn wrong_robots_fail_by_their_rule_1() {
    wrong_robots_fail_by_their_rule(0);
}

#[test]
fn wrong_robots_fail_by_their_rule_2() {
    wrong_robots_fail_by_their_rule(1);
}

#[test]
fn wrong_robots_fail_by_their_rule_3() {
    wrong_robots_fail_by_their_rule(2);
}

#[test]
fn wrong_robots_fail_by_their_rule_4() {
    wrong_robots_fail_by_their_rule(3);
}

#[test]
fn what_cannot_be_checked_is_said() {
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

/// Anchors of a page: its headings as links name them.
fn anchors(page: &str) -> Vec<String> {
    let headings = page.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| {
        let text = line
            .trim_start_matches('#')
            .trim()
            .to_lowercase()
            .replace(' ', "-");
        text.chars()
            .filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_')
            .collect()
    };
    headings.map(anchor).collect()
}

#[test]
fn the_page_explains_every_rule_where_the_kit_says() {
    let page = std::fs::read_to_string(root().join(Path::new(PAGE))).unwrap();
    let anchors = anchors(&page);
    for rule in RULES {
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
