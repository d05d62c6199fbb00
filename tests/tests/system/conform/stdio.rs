//! The rules of programs over standard input and output, which `cars exec` runs: right programs pass, and those that are wrong
//! in one thing, which a run forgives, fail by the rule that forbids it.

use std::path::Path;
use std::process::Command;

use conform::{CheckReport, ProtocolRule, RULES, STDIO_RULES, check};
use system_tests::tools::has_python;
use system_tests::{objections, programs};

use super::{cars, rule_of, setting};

/// A program that does what the comments are replaced by, and nothing else.
const PROGRAM: &str = r#"import json, sys, time

def say(**line):
    print(json.dumps(line), flush=True)

for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "end":
        pass  # at the end
        break
    if message["type"] == "init" and message["tick"] > 0:
        continue
    done = {}
    pass  # in each tick
    say(type="done", **done)
"#;

/// What a program does: a name that begins with the rule that it breaks, or `right`; in each tick; at the end.
type Doing = (&'static str, &'static str, &'static str);

/// Programs that keep the rules, just so. The longest log is in few ticks: in all of them, and in all checks at once, gigabytes would
/// pass.
const RIGHT: [Doing; 4] = [
    ("right", "done['proposal'] = message['location']", ""),
    (
        "right:lines",
        "[say(type='log', text='x' * 512) for _ in range(512 * (message['tick'] % 20 == 3))]",
        "",
    ),
    ("right:text", "say(type='log', text='x' * 4096)", ""),
    ("right:slow", "", "time.sleep(0.5)"),
];

/// Programs that break one.
const WRONG: [Doing; 4] = [
    ("stdio.fields", "done['propsal'] = message['location']", ""),
    (
        "stdio.log",
        "[say(type='log', text='x') for _ in range(513)]",
        "",
    ),
    ("stdio.end", "", "sys.exit(3)"),
    ("stdio.end:stays", "", "time.sleep(600)"),
];

/// Programs that break one in another way.
const OTHERWISE: [Doing; 8] = [
    (
        "stdio.fields:within",
        "done['proposal'] = {'x': 1, 'y': 1, 'z': 1}",
        "",
    ),
    (
        "stdio.fields:random",
        "say(type='random', of='Butler'); sys.stdin.readline()",
        "",
    ),
    // The kit sends commands in some ticks only.
    (
        "stdio.fields:seldom",
        "done |= {'heard': 1} if 'commands' in message else {}",
        "",
    ),
    (
        "stdio.fields:log",
        "say(type='log', text='a', level='info')",
        "",
    ),
    ("stdio.log:text", "say(type='log', text='x' * 4097)", ""),
    (
        "stdio.log:bytes",
        "[say(type='log', text='x' * 4096) for _ in range(64)]; say(type='log', text='x')",
        "",
    ),
    ("stdio.end:signal", "", "import os; os.kill(os.getpid(), 9)"),
    (
        "stdio.end:seldom",
        "",
        "sys.exit(message['reason'] == 'aborted')",
    ),
];

/// Kits at a time: unlike the robots of other tests, these programs need a processor to start and to end.
const PROGRAMS: usize = 2;

/// The interpreter itself: what `python3` starts may be a script that looks for one.
fn interpreter() -> String {
    let print = ["-c", "import sys; print(sys.executable)"];
    let output = Command::new("python3").args(print).output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// The command of `cars exec` for a program.
fn exec(folder: &Path, (name, in_tick, at_end): Doing) -> Command {
    let mut text = PROGRAM.to_owned();
    for (place, does) in [("in each tick", in_tick), ("at the end", at_end)] {
        if !does.is_empty() {
            text = text.replace(&format!("pass  # {place}"), does);
        }
    }
    let program = folder.join(name);
    std::fs::write(&program, text).unwrap();

    let mut command = Command::new(programs().join("cars"));
    command
        .args(["exec", "--name", "Rosie", "--"])
        .arg(interpreter())
        .arg(program);
    command
}

/// What is wrong with the verdict on a program: it must fail by its rule alone.
fn misjudged(doing: Doing, rules: &[ProtocolRule]) -> Option<String> {
    let name = doing.0;
    let lab = tempfile::tempdir().unwrap();
    let command = exec(lab.path(), doing);
    let report: CheckReport = match check(&command, &setting(), rules, &|_, _| ()) {
        Ok(report) => report,
        Err(error) => return Some(format!("{name}: {error}")),
    };

    let failed: Vec<&str> = report.failed().map(|(rule, _)| rule.name).collect();
    let expected: Vec<&str> = match rule_of(name) {
        "right" => Vec::new(),
        rule => vec![rule],
    };
    // All rules are shown of such a program, whether they are named or not.
    let shown = if rules.is_empty() {
        RULES.len() + STDIO_RULES.len()
    } else {
        rules.len()
    };
    let is_right = failed == expected && report.outcomes.len() == shown;
    (!is_right).then(|| format!("{name} fails by {failed:?}: {report}"))
}

fn judge(programs: &[Doing], rules: &[ProtocolRule]) {
    if !has_python("the kit with robots in Python") {
        return;
    }

    let misjudgments = objections(programs, PROGRAMS, |doing| misjudged(*doing, rules));
    assert!(misjudgments.is_empty(), "{}", misjudgments.join("\n"));
}

#[test]
fn a_program_fails_by_the_rule_that_it_breaks() {
    judge(&[&RIGHT[..], &WRONG[..1]].concat(), &STDIO_RULES);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_rule_of_programs_can_be_broken_in_more_than_one_way() {
    judge(&OTHERWISE, &STDIO_RULES);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_program_fails_by_the_rule_that_it_breaks_and_by_no_other() {
    judge(&[&RIGHT[..], &WRONG].concat(), &[]);
}

#[test]
fn a_program_behind_a_script_is_recognized_and_other_robots_are_not_meant() {
    if !has_python("the kit with a robot in Python") {
        return;
    }

    let folder = tempfile::tempdir().unwrap();
    let wrong = exec(folder.path(), WRONG[0]);
    let words: Vec<&str> = wrong
        .get_args()
        .map(|word| word.to_str().unwrap())
        .collect();
    let script = format!(
        "exec {} {}",
        programs().join("cars").display(),
        words.join(" ")
    );
    let only = ["--rule", "stdio.fields"];
    let printed = |command: &[&str]| {
        let output = cars(&only, command);
        (
            output.status.code(),
            String::from_utf8(output.stdout).unwrap(),
        )
    };

    let (status, report) = printed(&["sh", "-c", &script]);
    assert_eq!(status, Some(1), "{report}");
    for part in [
        "not ok 1 - stdio.fields",
        "unknown field `propsal` of a line `done` ignored",
        "in tick 0",
        "see: \"docs/protocol.md#robots-over-stdin-and-stdout\"",
    ] {
        assert!(report.contains(part), "{report}");
    }

    let (status, report) = printed(&["wrong-robot"]);
    assert_eq!(status, Some(0), "{report}");
    let skipped = "ok 1 - stdio.fields # SKIP the robot is not a program that `cars exec` runs";
    assert!(report.contains(skipped), "{report}");
}
