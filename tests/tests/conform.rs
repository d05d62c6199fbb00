//! The conformance kit on the robots of the project, which pass, and on robots that are wrong in one thing each, which
//! fail by the rule that forbids it.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use conform::{PAGE, RULES, Rule, Setting, Verdict};
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
        // A signal that the shell ignores is ignored by the program that takes its place, too.
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

/// Further ways to break a rule, after the one that is named like the rule.
const OTHERWISE: [&str; 46] = [
    "join.request:instance",
    "join.ready-last:first",
    "join.ready-last:queryables",
    "join.ready-last:news",
    "join.refused:mute",
    "join.refused:impatient",
    "tick.answer:generation",
    "tick.answer:unasked",
    "tick.state-first:unheard",
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
    "query.once:holds",
    "query.once:percept",
    "query.once:others",
    "clock.duplicate:commands",
    "clock.duplicate:order",
    "clock.duplicate:bytes",
    "clock.late:epoch",
    "epoch.init:random",
    "epoch.init:variables",
    "epoch.init:count",
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
    "end.clock:aborted",
    "end.clock:news",
    "end.clock:answer",
    "end.gone:hasty",
];

/// Further ways that are about how a message is written or put.
const OTHERWISE_ON_THE_WIRE: [&str; 5] = [
    "end.gone:status",
    "robust.malformed:silent",
    "number.integers:command",
    "wire.qos:command",
    "wire.qos:state",
];

/// Kits that run at the same time: their robots mostly wait.
const KITS: usize = 10;

/// What is wrong with the verdict on a robot that breaks a rule in this way: it must fail by that rule alone.
fn misjudged(how: &str, rules: &[Rule]) -> Option<String> {
    let name = how.split(':').next().unwrap();
    let report = match conform::check(&wrong(how), &setting(), rules) {
        Ok(report) => report,
        Err(error) => return Some(format!("{how}: {error}")),
    };
    let failed: Vec<&str> = report.failed().map(|(rule, _)| rule.name).collect();
    if failed != [name] {
        return Some(format!("{how} fails by {failed:?}: {report}"));
    }

    let reference = Rule::named(name).unwrap().reference();
    let is_referred = report.to_tap().contains(&format!("see: \"{reference}\""));
    (!is_referred).then(|| format!("{how}: no reference to the page: {report}"))
}

/// Judges robots side by side.
fn judge(robots: &[(&str, Vec<Rule>)]) {
    let next = AtomicUsize::new(0);
    let misjudged_ones = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..KITS {
            scope.spawn(|| {
                while let Some((how, rules)) = robots.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let found = misjudged(how, rules);
                    misjudged_ones.lock().unwrap().extend(found);
                }
            });
        }
    });

    let misjudged_ones = misjudged_ones.into_inner().unwrap();
    assert!(misjudged_ones.is_empty(), "{}", misjudged_ones.join("\n"));
}

#[test]
fn a_wrong_robot_fails_by_the_rule_that_it_breaks_and_by_no_other() {
    let robots: Vec<(&str, Vec<Rule>)> = RULES.iter().map(|rule| (rule.name, Vec::new())).collect();
    judge(&robots);
}

#[test]
fn rules_can_be_broken_in_more_than_one_way() {
    let rule = |how: &str| Rule::named(how.split(':').next().unwrap()).unwrap();
    let mut robots = Vec::new();
    for how in OTHERWISE.iter().chain(&OTHERWISE_ON_THE_WIRE) {
        robots.push((*how, vec![rule(how)]));
    }
    // A state is put where there is a subscriber, which another check has.
    for (how, rules) in &mut robots {
        if *how == "wire.qos:state" {
            rules.push(rule("query.tick"));
        }
    }
    judge(&robots);
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
