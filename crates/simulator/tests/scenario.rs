//! Scenario files: what they mean, and what people are told when they are wrong.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use miette::{GraphicalReportHandler, GraphicalTheme};
use simulator::Scenario;
use simulator::diagnostic::{FileError, Source};
use simulator::scenario::{Changes, OnLate};

fn parse(text: &str) -> Result<Scenario, FileError> {
    Scenario::parse(
        &Source {
            name: "hall.toml".into(),
            text: text.into(),
        },
        Path::new("."),
    )
}

/// The error as people see it, without colors.
fn shown(error: &FileError) -> String {
    let mut text = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    handler.render_report(&mut text, error).unwrap();
    text
}

#[test]
fn units_become_si_and_defaults_are_those_of_the_paper() {
    let scenario =
        parse("[guests]\ncount = 100\n[[robot]]\nname = \"Butler\"\nat = [\"25 ft\", \"25 ft\"]\n")
            .unwrap();
    assert_eq!(scenario.field_m, [15.24, 15.24]);
    assert_eq!(scenario.body_m, 0.6096);
    assert_eq!((scenario.tick_s, scenario.ticks), (0.5, 1200));
    assert_eq!(scenario.lateness.on_late, OnLate::Wait);
    assert_eq!(scenario.robots.values().next().unwrap().class, "Butler");
}

#[test]
fn parameters_reach_robots_in_si_units() {
    let text = "[[robot]]\nname = \"Butler\"\nat = [\"5 m\", \"5 m\"]\n\
                params = { speed = \"1 ft/s\", refiller = \"Vonda\", count = 3, nested = { wait = \"2 min\" } }\n";
    let scenario = parse(text).unwrap();
    let parameters = &scenario.robots.values().next().unwrap().parameters;
    assert_eq!(parameters["speed"], 0.3048);
    assert_eq!(parameters["refiller"], "Vonda");
    assert_eq!(parameters["count"], 3);
    assert_eq!(parameters["nested"]["wait"], 120.0);
}

#[test]
fn the_resolved_file_gives_the_same_scenario() {
    let text = "seed = 7\nduration = \"33 s\"\n[guests]\ncount = 5\nspeed = { min = \"0.1 ft/s\", mode = \"1 ft/s\", max = \"2 ft/s\" }\n\
                [[obstacle]]\nat = [\"2 ft\", \"2 ft\"]\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = { x = \"7 ft\", y = [1, 2.5] }\n";
    let first = parse(text).unwrap();
    let resolved = first.to_toml().unwrap();
    let second = parse(&resolved).unwrap();
    assert_eq!(format!("{first:?}"), format!("{second:?}"), "{resolved}");
    assert_eq!(resolved, second.to_toml().unwrap());
}

/// What is written, and what people are shown: the line, the place, and the reason.
#[test]
fn errors_show_line_place_and_reason() {
    for (text, line, reason) in [
        ("sed = 4\n", "1 │ sed = 4", "unknown field `sed`"),
        (
            "tick = \"0.5 ft\"\n",
            "1 │ tick = \"0.5 ft\"",
            "is not a time",
        ),
        ("tick = 0.5\n", "1 │ tick = 0.5", "a time such as"),
        (
            "duration = \"-1 s\"\n",
            "1 │ duration",
            "must be more than zero",
        ),
        ("seed = 9007199254740992\n", "1 │ seed", "2^53"),
        (
            "on_late = \"panic\"\n",
            "1 │ on_late",
            "unknown variant `panic`",
        ),
        (
            "[guests]\ncount = 5\nspeed = { min = \"3 ft/s\", mode = \"1 ft/s\", max = \"2 ft/s\" }\n",
            "3 │ speed",
            "min",
        ),
        (
            "[guests]\ncount = 700\n",
            "[guests]",
            "700 guests do not fit",
        ),
        (
            "[[robot]]\nname = \"a b\"\nat = [\"1 m\", \"1 m\"]\n",
            "2 │ name",
            "not a usable name",
        ),
        (
            "[[robot]]\nname = \"operator\"\nat = [\"1 m\", \"1 m\"]\n",
            "[[robot]]",
            "kept for commands from outside",
        ),
        (
            "[[robot]]\nname = \"A\"\nat = [\"99 m\", \"1 m\"]\n",
            "[[robot]]",
            "robot A",
        ),
        (
            "[[robot]]\nname = \"A\"\nat = [\"1 m\", \"1 m\"]\n[[robot]]\nname = \"A\"\nat = [\"3 m\", \"1 m\"]\n",
            "[[robot]]",
            "a second robot called A",
        ),
        (
            "[[obstacle]]\nat = [\"1 m\"]\n",
            "2 │ at",
            "invalid length 1",
        ),
    ] {
        let error = parse(text)
            .err()
            .unwrap_or_else(|| unreachable!("accepted: {text}"));
        let shown = shown(&error);
        assert!(shown.contains("hall.toml"), "{shown}");
        assert!(shown.contains(line), "no {line:?} in\n{shown}");
        assert!(shown.contains(reason), "no {reason:?} in\n{shown}");
    }
}

/// The end of a fault by the wall clock would fall into another tick every time where the clock goes on.
#[test]
fn a_fault_ends_by_the_wall_clock_only_where_the_clock_waits() {
    let with = |more: &str, kind: &str, end: &str| {
        parse(&format!(
            "{more}\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n[[fault]]\nrobot = \"A\"\ndo = \"{kind}\"\n\
             at = \"4 s\"\n{end}\n"
        ))
    };

    for kind in ["hang", "crash", "slow"] {
        let waiting = with("", kind, "for = \"1 s\"");
        assert!(waiting.is_ok(), "{kind}: {waiting:?}");
        let by_tick = with("on_late = \"continue\"", kind, "until = \"9 s\"");
        assert!(by_tick.is_ok(), "{kind}: {by_tick:?}");
        let by_wall = with("on_late = \"continue\"", kind, "for = \"1 s\"");
        let error = shown(&by_wall.unwrap_err());
        assert!(
            error.contains("continues without A") && error.contains("say `until`"),
            "{kind}: {error}"
        );
    }
}

#[test]
fn the_command_line_changes_a_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hall.toml");
    std::fs::write(
        &file,
        "[guests]\ncount = 5\n[[robot]]\nname = \"Butler\"\nat = [\"5 m\", \"5 m\"]\n",
    )
    .unwrap();
    let load = |set: &[&str]| {
        let set = set.iter().map(|change| change.parse().unwrap()).collect();
        Scenario::load(
            &file,
            &Changes {
                seed: Some(9),
                duration_s: Some(10.0),
                set,
            },
        )
    };
    let scenario = load(&[
        "guests.count=7",
        "robot.Butler.params.refiller=Vonda",
        "robot.0.class=Leguin",
    ])
    .unwrap();
    assert_eq!(
        (scenario.seed, scenario.ticks, scenario.guests.count),
        (9, 20, 7)
    );
    let robot = scenario.robots.values().next().unwrap();
    assert_eq!(
        (robot.class.as_str(), &robot.parameters["refiller"]),
        ("Leguin", &"Vonda".into())
    );

    let unknown = shown(&load(&["guest.count=7"]).unwrap_err());
    assert!(unknown.contains("unknown field `guest`"), "{unknown}");
    let unknown = shown(&load(&["robot.Vonda.class=X"]).unwrap_err());
    assert!(
        unknown.contains("called or numbered \"Vonda\""),
        "{unknown}"
    );
}

#[test]
fn a_plain_roster_is_the_experiment_of_the_paper() {
    let source = Source {
        name: "CARSConfig.txt".into(),
        text: "# who\nButler\n\nLeguin\nVonda\n".into(),
    };
    let text = simulator::roster::scenario_of(&source).unwrap();
    let scenario = Scenario::parse(&text, Path::new(".")).unwrap();
    let names: Vec<String> = scenario.roster().iter().map(ToString::to_string).collect();
    assert_eq!(names, ["Butler", "Leguin", "Vonda"]);
    assert_eq!(scenario.guests.count, 100);

    let bad = Source {
        name: "CARSConfig.txt".into(),
        text: "Butler\nLe guin\n".into(),
    };
    let error = shown(&simulator::roster::scenario_of(&bad).unwrap_err());
    assert!(error.contains("2 │ Le guin"), "{error}");
}
