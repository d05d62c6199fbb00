//! What a person can change between two epochs, and what is said of mistakes.

use std::path::Path;

use protocol::RobotName;
use protocol::messages::{Point, Range, Setup};
use scenario::MAX_GUESTS;
use scenario::Scenario;
use scenario::diagnostic::Source;

fn scenario() -> Scenario {
    let text = "seed = 7\nduration = \"33 s\"\n[guests]\ncount = 5\n[[obstacle]]\nat = [\"2 ft\", \"2 ft\"]\n\
                [[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = { x = 1 }\n[[robot]]\nname = \"B\"\nat = [\"7 m\", \"5 m\"]\n";
    Scenario::parse(
        &Source {
            name: "hall".into(),
            text: text.into(),
        },
        Path::new("."),
    )
    .unwrap()
}

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// The fields that are blamed for a set-up.
fn blamed(change: impl FnOnce(&mut Setup)) -> Vec<String> {
    let mut setup = scenario().setup();
    change(&mut setup);
    scenario()
        .with_setup(&setup)
        .unwrap_err()
        .into_iter()
        .map(|error| error.field)
        .collect()
}

#[test]
fn the_set_up_of_a_scenario_gives_the_same_scenario() {
    let scenario = scenario();
    let same = scenario.with_setup(&scenario.setup()).unwrap();
    assert_eq!(format!("{same:?}"), format!("{scenario:?}"));
}

#[test]
fn what_is_changed_is_changed_and_the_rest_stays() {
    let mut setup = scenario().setup();
    setup.seed = 9;
    setup.guests = 20;
    setup.field_m = [20.0, 12.0];
    setup.obstacles = vec![Point::new(1.0, 1.0), Point::new(2.0, 2.0)];
    setup.robots.insert(name("A"), Point::new(3.0, 4.0));
    setup.log_file.name = "evening.log".into();
    let changed = scenario().with_setup(&setup).unwrap();

    assert_eq!(changed.setup(), setup);
    assert_eq!(changed.robots[&name("A")].parameters["x"], 1);
}

#[test]
fn the_number_of_guests_has_a_limit() {
    let mut setup = scenario().setup();
    setup.field_m = [4000.0, 4000.0];
    setup.guests = u32::try_from(MAX_GUESTS).unwrap();
    assert!(scenario().with_setup(&setup).is_ok());

    setup.guests += 1;
    let errors = scenario().with_setup(&setup).unwrap_err();
    assert_eq!(errors[0].field, "guests");
    assert_eq!(
        errors[0].reason,
        "1000001 guests, more than the 1000000 allowed"
    );
}

#[test]
fn every_mistake_is_told_beside_its_field() {
    assert_eq!(blamed(|setup| setup.seed = u64::MAX), ["seed"]);
    assert_eq!(blamed(|setup| setup.duration_s = 0.0), ["duration_s"]);
    assert_eq!(blamed(|setup| setup.duration_s = 1e300), ["duration_s"]);

    let wrong = Range {
        min: 3.0,
        mode: 1.0,
        max: 2.0,
    };

    assert_eq!(
        blamed(|setup| setup.guest_speed_mps = wrong),
        ["guest_speed_mps"]
    );
    assert_eq!(
        blamed(|setup| setup.guest_duration_s = wrong),
        ["guest_duration_s"]
    );
    assert_eq!(blamed(|setup| setup.guests = 100_000), ["guests"]);
    assert_eq!(blamed(|setup| setup.guests = u32::MAX), ["guests"]);
    assert_eq!(blamed(|setup| setup.field_m = [0.1, 5.0]), ["field_m"]);
    assert_eq!(blamed(|setup| setup.field_m = [1e9, 5.0]), ["field_m"]);
    assert_eq!(
        blamed(|setup| setup.obstacles.push(Point::new(-1.0, 1.0))),
        ["obstacles"]
    );
    assert_eq!(
        blamed(|setup| setup.robots.extend([(name("B"), Point::new(99.0, 1.0))])),
        ["robots.B"]
    );
    assert_eq!(
        blamed(|setup| setup.robots.extend([(name("B"), Point::new(5.1, 5.0))])),
        ["robots.B"]
    );
    assert_eq!(
        blamed(|setup| setup.robots.extend([(name("C"), Point::new(1.0, 9.0))])),
        ["robots.C"]
    );
    assert_eq!(
        blamed(|setup| assert!(setup.robots.remove(&name("A")).is_some())),
        ["robots.A"]
    );

    for bad in [
        "",
        "../x",
        "a/b",
        ".hidden",
        "events.jsonl",
        "scenario.toml",
        "run.mcap",
        "run-epoch1.mcap",
        "x\n",
    ] {
        assert_eq!(
            blamed(|setup| setup.log_file.name = bad.into()),
            ["log_file.name"],
            "{bad:?}"
        );
    }

    // Several mistakes are told at once.
    assert_eq!(
        blamed(|setup| {
            setup.seed = u64::MAX;
            setup.guest_speed_mps = wrong;
        }),
        ["seed", "guest_speed_mps"]
    );
}

#[test]
fn a_scenario_for_other_robots_is_refused_with_both_rosters() {
    let text = "[[robot]]\nname = \"Z\"\nat = [\"5 m\", \"5 m\"]\n";
    let other = Scenario::parse_alone(&Source {
        name: "z".into(),
        text: text.into(),
    })
    .unwrap();
    let reason = other.with_roster_of(&scenario()).unwrap_err();

    assert!(
        reason.contains('Z') && reason.contains('A') && reason.contains('B'),
        "{reason}"
    );
}

#[test]
fn a_scenario_from_outside_reads_no_files() {
    let text = "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams_from = \"/etc/passwd\"\n";
    let error = Scenario::parse_alone(&Source {
        name: "x".into(),
        text: text.into(),
    })
    .unwrap_err();

    assert!(
        error.in_words().contains("params_from"),
        "{}",
        error.in_words()
    );
}

#[test]
fn every_shipped_scenario_can_be_loaded_without_its_files() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let mut read = 0;
    for entry in std::fs::read_dir(&configs).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let source = Source::read(&path).unwrap();
        let alone = Scenario::parse_alone(&source)
            .unwrap_or_else(|error| panic!("{}: {}", path.display(), error.in_words()));
        let with_files = Scenario::parse(&source, &configs).unwrap();
        assert_eq!(alone.to_toml().unwrap(), with_files.to_toml().unwrap());
        read += 1;
    }
    assert!(read >= 6, "{read} scenarios");
}

#[test]
fn a_robot_whose_name_is_a_number_is_reported_by_its_own_name() {
    let text = "[[robot]]\nname = \"1\"\nat = [\"99 m\", \"5 m\"]\n\
                [[robot]]\nname = \"Berta\"\nat = [\"7 m\", \"5 m\"]\n";
    let source = Source {
        name: "numbers".into(),
        text: text.into(),
    };
    let error = Scenario::parse(&source, Path::new(".")).unwrap_err();
    assert!(
        error.in_words().contains("robot 1 at"),
        "{}",
        error.in_words()
    );

    let inside = Source {
        text: text.replace("99 m", "3 m"),
        ..source
    };
    let scenario = Scenario::parse(&inside, Path::new(".")).unwrap();
    let mut setup = scenario.setup();
    setup.robots.insert(name("Berta"), Point::new(3.1, 5.0));
    let errors = scenario.with_setup(&setup).unwrap_err();
    assert_eq!(errors[0].field, "robots.Berta");
    assert!(
        errors[0].reason.starts_with("robot Berta at") && errors[0].reason.ends_with("robot 1"),
        "{}",
        errors[0].reason
    );
}

/// A scenario with what a set-up does not name: sites, layers and walls.
fn world() -> Scenario {
    let text = r#"
        seed = 7
        duration = "30 s"
        [field]
        size = ["10 m", "10 m"]
        [[wall]]
        points = [["1 m", "3 m"], ["6 m", "3 m"]]
        [[site]]
        name = "T"
        at = ["7 m", "7 m"]
        [[site]]
        name = "U"
        count = 2
        at = "random"
        [[layer]]
        name = "dust"
        cell = "0.5 m"
        range = "2 m"
        peaks = [{ at = "random", radius = "2 m", height = 1 }]
        [[robot]]
        name = "A"
        at = ["5 m", "5 m"]
        [[expect]]
        name = "it is there"
        never = { robot = "A", behavior = "GONE" }
    "#;
    parse(text)
}

fn parse(text: &str) -> Scenario {
    let source = Source {
        name: "world".into(),
        text: text.to_owned(),
    };
    Scenario::parse_alone(&source).unwrap()
}

#[test]
fn what_a_set_up_does_not_name_fits_to_it() {
    for (size_m, seed) in [
        ([10.0, 10.0], 7),
        ([10.0, 10.0], 8),
        ([8.0, 20.0], 7),
        ([30.0, 9.2], 3),
    ] {
        let mut setup = world().setup();
        setup.field_m = size_m;
        setup.seed = seed;
        let changed = world().with_setup(&setup).unwrap();
        assert_eq!(changed.setup(), setup);

        // Its record is read, and is the same.
        let written = changed.to_toml().unwrap();
        let read = parse(&written);
        assert_eq!(read.to_toml().unwrap(), written);
        assert_eq!(read.layers["dust"].columns, changed.layers["dust"].columns);
        assert_eq!(read.layers["dust"].rows, changed.layers["dust"].rows);

        // A file with this set-up has the same places.
        let text = world().to_toml_without_seed().unwrap();
        let [width, height] = size_m;
        let text = text.replace(
            "size = [\"10 m\", \"10 m\"]",
            &format!("size = [\"{width} m\", \"{height} m\"]"),
        );
        let fresh = parse(&format!("seed = {seed}\n{text}"));
        assert_eq!(fresh.field_m, size_m);
        assert_eq!(fresh.sites, changed.sites);
        assert_eq!(fresh.layers, changed.layers);
    }
}

#[test]
fn a_set_up_that_what_it_does_not_name_does_not_fit_is_refused() {
    for (size_m, reason) in [
        ([6.5, 6.5], "is outside the field"),
        ([5.5, 8.0], "is not on the field"),
        ([900.0, 900.0], "more than the 131072 allowed"),
    ] {
        let mut setup = world().setup();
        setup.field_m = size_m;
        let errors = world().with_setup(&setup).unwrap_err();
        assert_eq!(errors.len(), 1, "{errors:?}");
        assert_eq!(errors[0].field, "field_m");
        assert!(errors[0].reason.contains(reason), "{errors:?}");
    }
}
