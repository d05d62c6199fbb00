//! What the tables say about runs that have no number, about few pairs, and about shares.

use serde_json::Value;
use system_tests::Lab;

use super::{command, root};

/// Widest table of differences, characters.
const WIDTH: usize = 80;

/// Two arms, of which one loses few commands: in some runs none, so that they are never at risk of what follows a loss.
fn experiment() -> String {
    let scenario = root().join("configs/hors_doeuvres.toml");
    format!(
        r#"
question = "What do runs say that were never at risk?"
scenario = {scenario:?}
duration = "90 s"
seeds = 8
baseline = "few"

[[arm]]
name = "few"
set = ["network.commands.loss=0.1"]
[[arm]]
name = "many"
set = ["network.commands.loss=0.9"]

[[measure]]
name = "same_tick"
column = "a loss after the loss"
contrast = true
time = {{ after = {{ event = "command_dropped" }}, to = {{ event = "command_dropped" }} }}

[[measure]]
name = "wait"
column = "wait after a loss"
unit = "s"
contrast = true
between = {{ begin = {{ event = "command_dropped" }}, end = {{ event = "behavior", robot = "Butler", to = "SERVE" }}, as = "mean", until_end = true }}

[[measure]]
name = "never"
column = "never"
contrast = true
time = {{ to = {{ event = "behavior", robot = "Butler", to = "SERVE" }}, after = {{ event = "link_cut" }} }}

[[measure]]
name = "served"
column = "served"
contrast = true
variable = {{ robot = "Butler", name = "served", as = "end" }}
"#
    )
}

#[test]
fn runs_without_a_number_are_counted_beside_each_number() {
    let lab = Lab::new();
    let file = lab.write("risk.toml", &experiment());
    let out = lab.out().join("results");
    let output = command(&["run", file.to_str().unwrap(), "-o", out.to_str().unwrap()]).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);

    let results = std::fs::read_to_string(out.join("results.json")).unwrap();
    let results: Value = serde_json::from_str(&results).unwrap();
    let contrast = |measure: &str| {
        let mut contrasts = results["contrasts"].as_array().unwrap().iter();
        contrasts.find(|one| one["measure"] == measure).unwrap()
    };

    // In every run at risk the event comes at once: no curve, no share and no test may say that the arms differ.
    let same = contrast("same_tick");
    let not_at_risk = same["excluded_baseline"]["not_at_risk"].as_u64().unwrap();
    assert!((1..=5).contains(&not_at_risk), "{same}");
    assert_eq!(same["n"], 8 - not_at_risk);
    assert_eq!(
        (&same["p_holm"], &same["share"]["value"]),
        (&1.0.into(), &0.0.into())
    );
    assert!(
        text.contains(&format!("{not_at_risk} not at risk")),
        "{text}"
    );
    assert!(
        text.contains(&format!("{0} of {0}", 8 - not_at_risk)),
        "{text}"
    );

    let wait = contrast("wait");
    assert_eq!(wait["excluded_baseline"]["no_pair"], not_at_risk);
    assert!(text.contains(&format!("{not_at_risk} no pair")), "{text}");

    // No link is cut.
    let never = contrast("never");
    assert_eq!(
        (&never["kind"], &never["p_holm"]),
        (&"no_pair".into(), &Value::Null)
    );
    assert_eq!(never["excluded"]["not_at_risk"], 8);
    assert!(text.contains("never: no comparison can be made"), "{text}");

    // A row of the table of runs says why it has no number.
    let runs = std::fs::read_to_string(out.join("runs.csv")).unwrap();
    assert!(
        runs.contains("same_tick_state") && runs.contains(",,not at risk"),
        "{runs}"
    );
    assert!(!runs.contains("_censored"));

    assert!(!text.contains("-0.0 ") && !text.contains("-0 "), "{text}");
    for line in text.lines().filter(|line| line.starts_with(['╭', '│'])) {
        assert!(line.chars().count() <= WIDTH, "{line}");
    }
}

#[test]
fn too_few_pairs_to_show_anything_are_named() {
    let lab = Lab::new();
    let file = lab.write("few.toml", &experiment());
    let out = lab.out().join("results");
    let printed = |seeds: &str| {
        let args = ["run", file.to_str().unwrap(), "--seeds", seeds];
        let args = [&args[..], &["-o", out.to_str().unwrap()]].concat();
        let output = command(&args).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };

    // Two of 32 assignments of signs.
    let text = printed("5");
    let why = "so few pairs cannot show a difference: p is 0.062 at least; play more seeds";
    assert!(text.contains(why), "{text}");
    assert!(
        text.contains("served: one comparison, so p is not corrected"),
        "{text}"
    );
    let served = printed("6");
    let served = served.split("\nserved").last().unwrap();
    assert!(!served.contains("so few pairs"), "{served}");
}
