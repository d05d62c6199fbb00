//! A swarm whose radios follow places: the same record however it is played, and why messages were lost wherever runs are shown.

use std::collections::BTreeSet;

use system_tests::{Lab, assert_same};

/// Radios whose mean power is enough up to 5 m, as the range of the shipped swarm is.
const RADIO: [&str; 2] = [
    "--set",
    "network.radio={ path_loss = { exponent = 3.0, loss_db = 40.0 }, sensitivity_dbm = -61.0, bodies_db = 3.0, shadowing = { sigma_db = 4.0 }, \
     fading = \"rayleigh\", bit_rate = \"40 kbit/s\", queue_bytes = 1000 }",
];

#[test]
fn why_messages_were_lost_is_the_same_in_processes_and_is_shown() {
    let lab = Lab::new();
    let play = |command: &str, run: &str, more: &[&str]| {
        let named = [command, "swarm", "--run", run, "--duration", "30 s"];
        let arguments = [&named[..], &RADIO, more].concat();
        lab.ok(&arguments);
    };
    play("run", "run", &[]);
    play("launch", "launched", &["--speed", "max"]);
    assert_same(
        ("run", &lab.bytes("run")),
        ("launched", &lab.bytes("launched")),
    );
    lab.ok(&["verify", "launched"]);

    let mut causes = BTreeSet::new();
    for event in lab.events("run") {
        if ["command_dropped", "query_lost"].contains(&event["event"].as_str().unwrap_or_default())
        {
            causes.insert(event["because"].as_str().unwrap().to_owned());
        }
    }
    let expected = ["body", "distance", "fading", "shadowing"].map(str::to_owned);
    assert_eq!(causes, BTreeSet::from(expected));

    let diagram = lab.ok(&["diagram", "run", "--from", "0 s", "--to", "5 s"]);
    assert!(diagram.contains("too weak by fading"), "titles say why");
    assert!(diagram.contains(">fading<"), "labels say why");

    let tables = lab.out().join("tables");
    let report = lab.out().join("report.html");
    lab.ok(&["export", "run", "--csv", "-o", tables.to_str().unwrap()]);
    lab.ok(&["report", "run", "-o", report.to_str().unwrap()]);
    let events = std::fs::read_to_string(tables.join("events.csv")).unwrap();
    assert!(events.contains(",shadowing"), "the table says why");
    let report = std::fs::read_to_string(report).unwrap();
    assert!(
        report.contains("too weak over the distance"),
        "the table of links"
    );
    assert!(report.contains("Loss by distance"), "the figure");
}
