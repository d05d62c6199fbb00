//! States as large as a message allows, asked for in every tick, end to end between processes.

use system_tests::processes::nobody_is_left;
use system_tests::tools::has_python;
use system_tests::{Lab, assert_same};

/// Asks the robots named after the first word, in every tick, and publishes as many texts of so many bytes.
const ROBOT: &str = r#"#!/usr/bin/env python3
import json, sys

count, bytes, *others = sys.argv[1:]
own = {f"v{i:03}": "x" * int(bytes) for i in range(int(count))}
out = sys.stdout

def say(line):
    out.write(json.dumps(line) + "\n")
    out.flush()

for line in sys.stdin:
    told = json.loads(line)
    if told["type"] == "end":
        break
    variables = dict(own)
    if told["type"] == "tick":
        for other in others:
            say({"type": "query", "of": other, "what": "state_variables"})
            answer = json.loads(sys.stdin.readline())["value"]
            variables["of " + other] = sum(len(text) for text in answer.values() if isinstance(text, str))
    say({"type": "done", "state_variables": variables})
"#;

/// A robot of a launch: its name, how many texts of how many bytes it publishes, and whom it asks.
struct Talker {
    name: String,
    texts: (usize, usize),
    asks: Vec<String>,
}

/// Plays so many ticks of them twice, the second time secured, and demands that the runs end, are the same, and that each
/// asker got what was there.
fn play(label: &str, talkers: &[Talker], ticks: u32) {
    let lab = Lab::new();
    let program = lab.write("talker.py", ROBOT);
    let mut scenario = format!(
        "tick = \"0.5 s\"\nduration = \"{} s\"\n[field]\nsize = [\"200 m\", \"10 m\"]\n",
        f64::from(ticks) * 0.5
    );
    let mut launch = "scenario = \"large.toml\"\n".to_owned();
    for (index, talker) in talkers.iter().enumerate() {
        let name = &talker.name;
        let (count, bytes) = talker.texts;
        scenario += &format!(
            "[[robot]]\nname = \"{name}\"\nat = [\"{} m\", \"5 m\"]\n",
            3 * index + 2
        );
        let asks: Vec<String> = talker
            .asks
            .iter()
            .map(|other| format!(", {other:?}"))
            .collect();
        launch += &format!(
            "[[process]]\nname = \"{name}\"\ncommand = [\"cars\", \"exec\", \"--\", \"python3\", {:?}, \"{count}\", \
             \"{bytes}\"{}]\n",
            program.display().to_string(),
            asks.concat()
        );
    }
    lab.write("large.toml", &scenario);
    let launch = lab.write("launch.toml", &launch).display().to_string();

    let certificates = lab.out().join("certificates").display().to_string();
    let names: Vec<&str> = talkers.iter().map(|talker| talker.name.as_str()).collect();
    let init = [
        "secure",
        "init",
        &certificates,
        "--robots",
        &names.join(","),
    ];
    let (code, text) = lab.cars_without_out(&init);
    assert_eq!(code, 0, "{text}");
    let runs = ["plain", "secured"].map(|kind| format!("{label}-{kind}"));
    for (run, security) in runs.iter().zip([&[][..], &["--secure", &certificates]]) {
        let mut args = vec!["launch", &launch, "--no-console", "--speed", "max"];
        args.extend(security);
        lab.start(run, &args).finish();
        nobody_is_left(run);
    }

    let [first, second] = &runs;
    assert_same((first, &lab.bytes(first)), (second, &lab.bytes(second)));
    let summary = lab.summary(first);
    assert_eq!(summary["ticks"], ticks);
    for talker in talkers {
        let last = &summary["robots"][&talker.name];
        assert_eq!(last["missed"], 0, "{last}");
        for other in &talker.asks {
            let (count, bytes) = talkers
                .iter()
                .find(|talker| talker.name == *other)
                .unwrap()
                .texts;
            let heard = last["state_variables"][format!("of {other}")].as_f64();
            assert_eq!(heard, Some((count * bytes) as f64), "{last}");
        }
    }
}

fn talker(name: &str, texts: (usize, usize), asks: &[String]) -> Talker {
    Talker {
        name: name.to_owned(),
        texts,
        asks: asks.to_vec(),
    }
}

/// 92 texts of 1,000 bytes held a run for ever when receiving and sending shared a thread at the simulator; this is nearly the
/// largest state that a report has room for, besides.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_state_as_large_as_a_message_allows_is_asked_for_in_every_tick() {
    if !has_python("large states of robots in Python") {
        return;
    }

    for (label, texts) in [("large-92kb", (92, 1_000)), ("large-800kb", (200, 4_000))] {
        let talkers = [
            talker("A", texts, &[]),
            talker("B", (0, 0), &["A".to_owned()]),
            talker("C", texts, &["A".to_owned()]),
        ];
        play(label, &talkers, 40);
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn many_states_go_to_one_asker_in_every_tick() {
    if !has_python("large states of robots in Python") {
        return;
    }

    let names: Vec<String> = (0..30).map(|index| format!("T{index:02}")).collect();
    let mut talkers = vec![talker("Asker", (0, 0), &names)];
    for name in &names {
        talkers.push(talker(name, (10, 1_000), &[]));
    }
    play("large-many", &talkers, 40);
}

/// Robots that are run on the middleware's thread and share a link: what they put in one tick is more than its queue holds.
#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn two_hundred_robots_of_one_process_get_through_their_ticks() {
    let lab = Lab::new();
    let names: Vec<String> = (0..200).map(|index| format!("B{index}")).collect();
    let mut scenario =
        "tick = \"0.5 s\"\nduration = \"10 s\"\n[field]\nsize = [\"60 m\", \"60 m\"]\n".to_owned();
    for (index, name) in names.iter().enumerate() {
        scenario += &format!(
            "[[robot]]\nname = \"{name}\"\nclass = \"Butler\"\nat = [\"{} m\", \"{} m\"]\n",
            4 * (index % 14) + 2,
            4 * (index / 14) + 2
        );
    }
    lab.write("many.toml", &scenario);
    let launch = format!(
        "scenario = \"many.toml\"\n[[process]]\nname = \"all\"\ncommand = [\"cars-butler\"]\nrobots = {names:?}\n"
    );
    let launch = lab.write("launch.toml", &launch).display().to_string();

    let args = ["launch", &launch, "--no-console", "--speed", "max"];
    lab.start("many", &args).finish();

    assert_eq!(lab.summary("many")["ticks"], 20);
}
