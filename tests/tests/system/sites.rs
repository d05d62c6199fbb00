//! Runs that end by the states of sites and expect something of them: as processes, again, judged once more, and as forks.

use serde_json::json;
use system_tests::processes::nobody_is_left;
use system_tests::{Lab, assert_same, programs};

/// Two robots take from T1 and T2 until both are empty. Each takes one a tick.
const TASKS: &str = r#"
duration = "60 s"
end_when = { sites = "T*", by = "all", variable = "stock", at_most = 0 }

[sensing]
rays = { count = 4, range = "4 m" }

[[site]]
name = "T{1..2}"
at = { line = { from = ["2 m", "4 m"], to = ["3 m", "4 m"] } }
range = "4 m"
state = { stock = { start = 6, min = 0 }, open = true, last = "" }

[[robot]]
name = "A"
at = ["2 m", "5 m"]
[[robot]]
name = "B"
at = ["2 m", "3 m"]

[[measure]]
name = "left"
variable = { sites = "T*", by = "sum", name = "stock", as = "end" }
[[measure]]
name = "acts of A"
count = { event = "site_changed", robot = "A*", site = "T{1..2}", key = "stock" }
[[measure]]
name = "closed"
time = { to = { site = "T1", variable = "open", is = false } }

[[expect]]
name = "one is half empty"
eventually = { sites = "T{1..2}", by = "any", variable = "stock", at_most = 3 }
within = "60 s"
[[expect]]
name = "the last word is that of a robot"
after = { event = "site_changed", site = "T*", robot = "A", key = "last" }
eventually = { site = "T1", variable = "last", is = ["A", "B"] }
within = "1 s"
[[expect]]
name = "none is closed"
always = { sites = "*", by = "count", variable = "open", each = { is = true }, is = 2 }
"#;

#[test]
fn a_run_ends_by_its_sites_and_is_judged_by_them() {
    let lab = Lab::new();
    let scenario = lab.write("tasks.toml", TASKS);
    let forager = programs().join("forager");
    let mut launch = format!(
        "scenario = {:?}\nspeed = \"max\"\n",
        scenario.display().to_string()
    );
    for robot in ["A", "B"] {
        launch += &format!(
            "[[process]]\nname = \"{robot}\"\ncommand = [\"{}\"]\n",
            forager.display()
        );
    }
    let launch = lab.write("launch.toml", &launch);
    let launch = launch.display().to_string();
    lab.ok(&["launch", &launch, "--no-console", "--run", "tasks"]);
    nobody_is_left("tasks");

    let end = lab.events("tasks").pop().unwrap();
    assert_eq!(end["reason"], "finished");
    assert_eq!(
        end["because"],
        "`stock` of the sites T* at most 0 (all) holds"
    );
    let summary = lab.summary("tasks");
    // Both robots take one from each site in each tick from the first one on.
    assert!(
        summary["ticks"].as_u64().unwrap() < 10,
        "{}",
        summary["ticks"]
    );
    let verdicts = summary["expectations"].as_object().unwrap();
    let verdicts: Vec<&serde_json::Value> = verdicts.values().map(|one| &one["verdict"]).collect();
    assert_eq!(verdicts, [&json!("pass"), &json!("pass"), &json!("pass")]);

    let measures = &summary["measures"];
    assert_eq!(measures["left"], json!({ "state": "value", "value": 0.0 }));
    assert_eq!(
        measures["acts of A"],
        json!({ "state": "value", "value": 6.0 })
    );
    assert_eq!(
        measures["closed"],
        json!({ "state": "not_reached", "waited_s": 60.0 })
    );
    // They are recorded in every tick, for the charts of the console.
    let mut left = Vec::new();
    for tick in lab.recorded("tasks") {
        assert!(!tick.frame.measures.contains_key("closed"));
        left.push(tick.frame.measures["left"]);
    }
    assert_eq!(left, [8.0, 4.0, 0.0]);

    let said = lab.ok(&["verify", "tasks"]);
    assert!(said.contains("to the end"), "{said}");
    // The states of sites follow from the events alone.
    std::fs::remove_file(lab.file("tasks", "run.mcap")).unwrap();
    let said = lab.ok(&["expect", "tasks"]);
    assert!(
        said.contains("pass") && !said.contains("undecided"),
        "{said}"
    );
}

#[test]
fn a_fork_is_judged_and_ends_by_the_sites_of_its_parent() {
    let lab = Lab::new();
    let configs = system_tests::root().join("configs");
    let text = std::fs::read_to_string(configs.join("hors_doeuvres.toml")).unwrap();
    let text = text.replace("\"robots/", &format!("\"{}/robots/", configs.display()));
    let site = "[[site]]\nname = \"T\"\ncount = 2\nat = \"random\"\nstate = { done = false }\n";
    let expect = "[[expect]]\nname = \"nothing is done\"\nnever = { sites = \"T*\", by = \"any\", variable = \"done\" }\n";
    let hall = lab.write("hall.toml", &format!("{text}\n{site}{expect}"));
    let hall = hall.display().to_string();
    let end = |s: u32| {
        format!(
            "end_when={{ sites = \"T*\", by = \"count\", variable = \"done\", is = 0, for = \"{s} s\" }}"
        )
    };
    lab.ok(&["run", &hall, "--run", "parent", "--set", &end(20), "-q"]);
    assert_eq!(lab.summary("parent")["ticks"], 40);
    let said = lab.ok(&["verify", "parent"]);
    assert!(said.contains("40 ticks to the end"), "{said}");

    lab.ok(&["fork", "parent@30", "--run", "same", "-q"]);
    assert_same(
        ("the run", &lab.bytes("parent")),
        ("the fork", &lab.bytes("same")),
    );
    lab.ok(&[
        "fork",
        "parent@40",
        "--run",
        "more",
        "--set",
        &end(25),
        "-q",
    ]);
    assert_eq!(lab.summary("more")["ticks"], 50);
    assert_eq!(
        lab.summary("more")["expectations"]["nothing is done"]["verdict"],
        "pass"
    );
    let said = lab.ok(&["verify", "more"]);
    assert!(said.contains("50 ticks to the end"), "{said}");

    let (_, said) = lab.fails(&[
        "run",
        &hall,
        "--set",
        "end_when={ site = \"T3\", variable = \"done\", is = true }",
    ]);
    assert!(
        said.contains("no site of this scenario is called T3; it has T1, T2"),
        "{said}"
    );
}
