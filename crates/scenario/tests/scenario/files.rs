//! Scenario files: what they mean, and what people are told when they are wrong.

use std::path::Path;

use protocol::RobotName;
use protocol::messages::DisplayUnit;
use scenario::Scenario;
use scenario::diagnostic::{FileError, Source};
use scenario::{Changes, GuestRules, OnLate};

use super::{parse, shown};

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
fn a_field_without_a_size_has_that_of_the_paper() {
    let scenario = parse("[field]\nmax_speed = \"5 ft/s\"\n").unwrap();
    assert_eq!(scenario.field_m, [15.24, 15.24]);
    assert_eq!(scenario.max_speed_mps, 1.524);
}

#[test]
fn the_unit_for_people_changes_nothing_else_and_is_kept() {
    let text = "[field]\nsize = [\"50 ft\", \"50 ft\"]\n";
    let meters = parse(text).unwrap();
    let feet = parse(&format!("{text}display_unit = \"ft\"\n")).unwrap();
    assert_eq!(meters.display_unit, DisplayUnit::Meters);
    assert_eq!(feet.display_unit, DisplayUnit::Feet);
    assert_eq!(feet.field_m, meters.field_m);
    assert_eq!(
        parse(&feet.to_toml().unwrap()).unwrap().display_unit,
        DisplayUnit::Feet
    );

    let error = shown(&parse("[field]\ndisplay_unit = \"feet\"\n").unwrap_err());
    assert!(
        error.contains("hall.toml:2") && error.contains("`m` or `ft`"),
        "{error}"
    );
}

#[test]
fn rules_for_guests_have_defaults_and_are_kept() {
    let walking = parse("[guests]\ncount = 5\n").unwrap();
    assert_eq!(walking.guest_rules, GuestRules::default());

    let text = "tick = \"0.1 s\"\n[guests]\ncount = 5\n[guests.faces]\nrange = \"4 ft\"\nmake_way = [\"angry\", \"fearful\"]\n\
                approach = [\"happy\"]\n[guests.requests]\npatience = \"1.1 s\"\n";
    let scenario = parse(text).unwrap();
    let faces = scenario.guest_rules.faces.clone().unwrap();
    assert_eq!(faces.range_m, 1.2192);
    assert_eq!(
        faces.make_way,
        ["angry", "fearful"].map(str::to_owned).into()
    );
    let requests = scenario.guest_rules.requests.unwrap();
    assert_eq!((requests.range_m, requests.patience), (1.8288, 11));
    let written = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(written.guest_rules, scenario.guest_rules);

    for (wrong, reason) in [
        (
            "[guests.faces]\nmake_way = [\"sad\"]\napproach = [\"sad\"]\n",
            "make way for a face \"sad\"",
        ),
        ("[guests.faces]\nrange = \"0 m\"\n", "more than zero"),
        ("[guests.requests]\npatience = \"0 s\"\n", "more than zero"),
        ("[guests.requests]\nlimit = 3\n", "unknown field `limit`"),
    ] {
        let error = shown(&parse(&format!("[guests]\ncount = 5\n{wrong}")).unwrap_err());
        assert!(
            error.contains("hall.toml:") && error.contains(reason),
            "{error}"
        );
    }
    let list = |count: usize| {
        (0..count)
            .map(|face| format!("\"f{face}\""))
            .collect::<Vec<_>>()
            .join(",")
    };
    let with = |count| {
        parse(&format!(
            "[guests]\ncount = 5\n[guests.faces]\napproach = [{}]\n",
            list(count)
        ))
    };
    assert!(with(64).is_ok());
    assert!(shown(&with(65).unwrap_err()).contains("more than 64 faces"));
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

#[test]
fn a_range_of_names_is_a_count() {
    let text = |names: &str| {
        format!(
            "[field]\nsize = [\"60 ft\", \"60 ft\"]\n[[robot]]\n{names}\nat = \"random\"\nparams = {{ k = 1 }}\n"
        )
    };
    let counted = parse(&text("name = \"S\"\ncount = 20")).unwrap();
    let ranged = parse(&text("name = \"S{1..20}\"")).unwrap();
    assert_eq!(ranged.to_toml().unwrap(), counted.to_toml().unwrap());
    assert_eq!(ranged.robots.len(), 20);
    assert!(ranged.robots.values().all(|robot| robot.class == "S"));

    let later = parse(&text("name = \"S{9..11}\"\nclass = \"Leguin\"")).unwrap();
    let names: Vec<&str> = later.robots.keys().map(RobotName::as_str).collect();
    assert_eq!(names, ["S10", "S11", "S9"]);
    assert_eq!(later.robots[&RobotName::new("S9").unwrap()].class, "Leguin");

    for (names, place, reason) in [
        (
            "name = \"S{3..1}\"",
            "hall.toml:4:8",
            "the range ends with 1, before 3",
        ),
        ("name = \"S{1..}\"", "hall.toml:4:8", "such as"),
        ("name = \"{1..2}\"", "hall.toml:4:8", "name"),
        (
            "name = \"S{1..1025}\"",
            "hall.toml:3:1",
            "more than 1024 robots",
        ),
        (
            "name = \"S{1..2}\"\ncount = 2",
            "hall.toml:3:1",
            "leave `count` out",
        ),
    ] {
        let shown = shown(&parse(&text(names)).unwrap_err());
        assert!(shown.contains(place) && shown.contains(reason), "{shown}");
    }
}

/// A scenario with robots in bulk that stand side by side, as changes place them.
const BULK: &str = "[[robot]]\nname = \"Butler\"\nat = [\"5 m\", \"5 m\"]\n\
                    [[robot]]\nname = \"S\"\ncount = 3\nat = \"random\"\non_late = \"continue\"\nparams = { k = 1 }\n";

fn loaded(text: &str, set: &[&str]) -> Result<Scenario, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hall.toml");
    std::fs::write(&file, text).unwrap();
    let set = set.iter().map(|change| change.parse().unwrap()).collect();
    let changes = Changes {
        set,
        ..Changes::default()
    };
    Scenario::load(&file, &changes)
}

#[test]
fn a_table_with_a_count_is_as_many_robots() {
    let scenario = parse(BULK).unwrap();
    let names: Vec<String> = scenario.roster().iter().map(ToString::to_string).collect();
    assert_eq!(names, ["Butler", "S1", "S2", "S3"]);
    let s2 = "S2".parse().unwrap();
    assert_eq!(scenario.robots[&s2].class, "S");
    assert_eq!(scenario.robots[&s2].parameters["k"], 1);
    assert_eq!(scenario.lateness.of(&s2), OnLate::Continue);

    let classed = BULK.replace("count = 3", "count = 3\nclass = \"Leguin\"");
    assert_eq!(parse(&classed).unwrap().robots[&s2].class, "Leguin");

    // The most robots that there can be, and one more.
    let many = |count: usize| {
        parse(&format!(
            "[field]\nsize = [\"100 m\", \"100 m\"]\n{}",
            BULK.replace("count = 3", &format!("count = {count}"))
        ))
    };
    assert_eq!(many(1023).unwrap().robots.len(), 1024);
    assert_eq!(many(0).unwrap().robots.len(), 1);
    let error = shown(&many(1024).unwrap_err());
    assert!(error.contains("more than 1024 robots"), "{error}");

    let long = BULK.replace("\"S\"", &format!("\"{}\"", "S".repeat(64)));
    let error = shown(&parse(&long).unwrap_err());
    assert!(error.contains("longer than 64 characters"), "{error}");
    let negative = shown(&parse(&BULK.replace("count = 3", "count = -1")).unwrap_err());
    assert!(negative.contains("count = -1"), "{negative}");
    let taken = format!("{BULK}[[robot]]\nname = \"S2\"\nat = [\"9 m\", \"9 m\"]\n");
    let error = shown(&parse(&taken).unwrap_err());
    assert!(error.contains("a second robot called S2"), "{error}");
}

#[test]
fn changes_name_robots_by_patterns() {
    let k = |scenario: &Scenario, robot: &str| {
        let parameters = &scenario.robots[robot].parameters;
        parameters.get("k").and_then(serde_json::Value::as_i64)
    };
    let given = |set: &[&str]| {
        let scenario = loaded(BULK, set).unwrap();
        ["Butler", "S1", "S2", "S3"].map(|robot| k(&scenario, robot))
    };
    let one = Some(1);
    assert_eq!(
        given(&["robot.S*.params.k=2"]),
        [None, Some(2), Some(2), Some(2)]
    );
    assert_eq!(
        given(&["robot.S.params.k=2"]),
        [None, Some(2), Some(2), Some(2)]
    );
    assert_eq!(given(&["robot.S2.params.k=2"]), [None, one, Some(2), one]);
    assert_eq!(given(&["robot.*.params.k=2"]), [Some(2); 4]);
    // How many they are is set first, wherever it stands.
    let scenario = loaded(BULK, &["robot.S9.params.k=2", "robot.S.count=9"]).unwrap();
    assert_eq!((k(&scenario, "S9"), k(&scenario, "S8")), (Some(2), one));

    let error = shown(&loaded(BULK, &["robot.X*.params.k=2"]).unwrap_err());
    assert!(error.contains("has a name that matches \"X*\""), "{error}");

    let change = |path: &str| {
        parse(&format!(
            "[[change]]\nat = \"10 s\"\nset = [\"{path}.params.k=2\"]\n{BULK}"
        ))
    };
    let scenario = change("robot.S*").unwrap();
    let s3 = "S3".parse().unwrap();
    assert_eq!(scenario.parameters_at(&s3, 19).unwrap()["k"], 1);
    assert_eq!(scenario.parameters_at(&s3, 20).unwrap()["k"], 2);
    let resolved = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(resolved.parameters_at(&s3, 20).unwrap()["k"], 2);
    assert_eq!(resolved.to_toml().unwrap(), scenario.to_toml().unwrap());
    let error = shown(&change("robot.S").unwrap_err());
    assert!(
        error.contains("none of the 4 elements is called or numbered \"S\""),
        "{error}"
    );
}

#[test]
fn robots_stand_at_random_places_where_nothing_else_stands() {
    let free = |a: protocol::messages::Point, b: protocol::messages::Point, body_m: f64| {
        (a.x - b.x).abs() >= body_m - 1e-9 || (a.y - b.y).abs() >= body_m - 1e-9
    };
    let place = |seed: u64, count: usize, more: &str| {
        let obstacle = "[[obstacle]]\nat = [\"3 m\", \"3 m\"]\n";
        let bulk = BULK.replace("count = 3", &format!("count = {count}"));
        parse(&format!("seed = {seed}\n{obstacle}{bulk}{more}")).unwrap()
    };

    for seed in 0..40 {
        // The hall has room for 625 bodies in rows; 150 at random places hinder each other often.
        let scenario = place(seed, 150, "");
        let places: Vec<_> = scenario.robots.values().map(|robot| robot.at).collect();
        let body_m = scenario.body_m;
        for (index, at) in places.iter().enumerate() {
            let half_m = body_m / 2.0 - 1e-9;
            let is_inside = |x: f64| (half_m..=15.24 - half_m).contains(&x);
            assert!(is_inside(at.x) && is_inside(at.y), "seed {seed}");
            assert!(free(*at, scenario.obstacles[0].at, body_m), "seed {seed}");
            for other in &places[..index] {
                assert!(free(*at, *other, body_m), "seed {seed}: {at:?}, {other:?}");
            }
        }

        // One more moves no other one, nor does a robot of another name that hinders none.
        let more = place(seed, 151, "");
        let mut moved = 0;
        for (name, robot) in &scenario.robots {
            moved += usize::from(more.robots[name].at != robot.at);
        }
        assert_eq!(moved, 0, "seed {seed}");
        let another = place(seed, 3, "[[robot]]\nname = \"A\"\nat = \"random\"\n");
        let alone = place(seed, 3, "");
        let a = another.robots["A"].at;
        for (name, robot) in &alone.robots {
            let is_same = another.robots[name].at == robot.at;
            assert!(is_same || !free(a, robot.at, body_m), "seed {seed}: {name}");
        }
    }

    let scenario = place(7, 20, "");
    assert_ne!(
        scenario.to_toml().unwrap().replace("seed = 7", "seed = 8"),
        place(8, 20, "").to_toml().unwrap(),
        "another seed, other places"
    );
    assert_eq!(
        scenario.clone().with_seed(8).unwrap().to_toml().unwrap(),
        place(8, 20, "").to_toml().unwrap(),
    );
    let resolved = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(resolved.to_toml().unwrap(), scenario.to_toml().unwrap());
}

#[test]
fn places_are_uniform() {
    // A robot alone: its mean is that of the field within four standard errors, L / sqrt(12 n).
    let mut scenario = parse("[[robot]]\nname = \"A\"\nat = \"random\"\n").unwrap();
    let seeds = 2000;
    let [mut x_m, mut y_m] = [0.0; 2];
    for seed in 1..=seeds {
        scenario = scenario.with_seed(seed).unwrap();
        let at = scenario.robots.values().next().unwrap().at;
        x_m += at.x / seeds as f64;
        y_m += at.y / seeds as f64;
    }
    let error_m = 4.0 * (15.24 - 0.6096) / (12.0 * seeds as f64).sqrt();
    assert!(
        (x_m - 7.62).abs() < error_m && (y_m - 7.62).abs() < error_m,
        "{x_m}, {y_m}"
    );
}

#[test]
fn robots_that_cannot_be_placed_are_refused() {
    for (text, line, reason) in [
        (
            BULK.replace("count = 3", "count = 600"),
            "[[robot]]",
            "no free place for robot S",
        ),
        (
            BULK.replace("at = \"random\"", "at = \"anywhere\""),
            "at = \"anywhere\"",
            "or \"random\"",
        ),
        (
            BULK.replace("at = \"random\"", "at = [\"3 m\", \"3 m\"]"),
            "[[robot]]",
            "robot S2 at (3, 3) m overlaps robot S1",
        ),
        (
            BULK.replace("at = [\"5 m\", \"5 m\"]", "at = [\"99 m\", \"5 m\"]"),
            "[[robot]]",
            "robot Butler at",
        ),
    ] {
        let error = shown(&parse(&text).unwrap_err());
        assert!(error.contains(line), "no {line:?} in\n{error}");
        assert!(error.contains(reason), "no {reason:?} in\n{error}");
    }
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
            "[guests]\ncount = -1\n",
            "2 │ count = -1",
            "expected a whole number of 0 or more",
        ),
        ("guests = 5\n", "1 │ guests = 5", "expected a table"),
        (
            "seed = 99999999999999999999\n",
            "1 │ seed",
            "is too large or too small",
        ),
        (
            "duration = \"-1 s\"\n",
            "1 │ duration",
            "must be more than zero",
        ),
        (
            "tick = \"0.5 s\"\nduration = \"0.2 s\"\n",
            "2 │ duration",
            "less than a tick, which lasts 0.5 s",
        ),
        (
            "tick = \"1000000 s\"\nduration = \"2e10 s\"\n",
            "2 │ duration",
            "at most 18446744073 s",
        ),
        ("tick = \"2000 s\"\n", "1 │ tick", "less than a tick"),
        (
            "duration = \"1e7 s\"\ntick = \"2e6 s\"\n",
            "2 │ tick",
            "from 1e-6 to 1000000.0",
        ),
        ("seed = 9007199254740992\n", "1 │ seed", "2^53"),
        (
            "[field]\nsize = [\"50 ft\", \"50 ft\", \"10 ft\"]\n",
            "[hall.toml:2:27]",
            "a list of exactly 2 elements",
        ),
        (
            "[[obstacle]]\nat = [\"10 ft\", \"10 ft\", \"0 ft\"]\n",
            "2 │ at",
            "a list of exactly 2 elements",
        ),
        (
            "[[robot]]\nname = \"A\"\nat = [\"4 ft\", \"4 ft\", \"1 ft\", \"garbage\"]\n",
            "3 │ at",
            "string \"1 ft\"",
        ),
        (
            "[[robot]]\nname = \"A\"\nat = [\"4 ft\"]\n",
            "3 │ at",
            "a list of exactly 2 elements",
        ),
        (
            "[[obstacle]]\nat = [\"9 m\", \"1 m\"]\n[[obstacle]]\nat = [\"99 m\", \"1 m\"]\n",
            "4 │ at",
            "obstacle 2",
        ),
        (
            "[[robot]]\nname = \"A\"\nat = [\"1 m\", \"1 m\"]\n[[robot]]\nname = \"B\"\nat = [\"99 m\", \"1 m\"]\n",
            "4 │ [[robot]]",
            "robot B",
        ),
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
                ..Changes::default()
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
    let text = scenario::roster::scenario_of(&source).unwrap();
    let scenario = Scenario::parse(&text, Path::new(".")).unwrap();
    let names: Vec<String> = scenario.roster().iter().map(ToString::to_string).collect();
    assert_eq!(names, ["Butler", "Leguin", "Vonda"]);
    assert_eq!(scenario.guests.count, 100);

    let refused = |text: &str| {
        let bad = Source {
            name: "CARSConfig.txt".into(),
            text: text.into(),
        };
        shown(&scenario::roster::scenario_of(&bad).unwrap_err())
    };
    let error = refused("Butler\nLe/guin\n");
    assert!(error.contains("2 │ Le/guin"), "{error}");
    let error = refused("Butler\nLeguin Laila the second\n");
    assert!(error.contains("2 │ Leguin Laila the second"), "{error}");
    let error = refused("Butler\nLeguin\nLeguin\n");
    assert!(error.contains("Leguin NAME"), "{error}");
}

#[test]
fn robots_of_one_class_have_different_names() {
    let source = Source {
        name: "CARSConfig.txt".into(),
        text: "Butler  Alfred\nLeguin\nLeguin\tLaila\n".into(),
    };
    let text = scenario::roster::scenario_of(&source).unwrap();
    let scenario = Scenario::parse(&text, Path::new(".")).unwrap();
    let robots = scenario.robots.iter();
    let robots: Vec<(&str, &str)> = robots
        .map(|(name, robot)| (name.as_str(), robot.class.as_str()))
        .collect();
    assert_eq!(
        robots,
        [
            ("Alfred", "Butler"),
            ("Laila", "Leguin"),
            ("Leguin", "Leguin")
        ]
    );
}

const TWO_ROBOTS: &str = "[[robot]]\nname = \"A\"\nat = [\"3 m\", \"3 m\"]\nparams = { wait = \"5 s\" }\n\
                          [[robot]]\nname = \"B\"\nat = [\"9 m\", \"9 m\"]\n";

fn with_changes(changes: &str) -> Result<Scenario, FileError> {
    parse(&format!("{changes}\n{TWO_ROBOTS}"))
}

#[test]
fn changes_are_in_effect_from_their_tick_on_and_one_builds_on_the_other() {
    let scenario = with_changes(
        "[[change]]\nat = \"20 s\"\nset = [\"network.commands.loss=0.0\"]\n\
         [[change]]\nat = \"10 s\"\nset = [\"network.commands.loss=0.5\", \"network.queries.loss=0.25\", \"robot.A.params.wait=7 s\"]\n\
         [parent]\nrun = \"first\"\ntick = 19\ndigest = \"abc\"\n",
    )
    .unwrap();
    let resolved = parse(&scenario.to_toml().unwrap()).unwrap();

    for scenario in [&scenario, &resolved] {
        let loss = |tick| {
            let network = scenario.network_at(tick);
            (network.commands.loss, network.queries.loss)
        };
        assert_eq!([loss(0), loss(19)], [(0.0, 0.0); 2]);
        assert_eq!([loss(20), loss(39)], [(0.5, 0.25); 2]);
        assert_eq!(loss(40), (0.0, 0.25));

        let a = "A".parse().unwrap();
        let wait = |tick| scenario.parameters_at(&a, tick).unwrap()["wait"].clone();
        assert_eq!([wait(19), wait(20), wait(41)], [5.0, 7.0, 7.0]);
        let restarts = |tick| scenario.restarts_at(tick).into_iter().collect::<Vec<_>>();
        assert_eq!(restarts(20), std::slice::from_ref(&a));
        assert!(restarts(19).is_empty() && restarts(40).is_empty());
        assert_eq!(scenario.parent.as_ref().unwrap().tick, 19);
    }
    assert_eq!(resolved.changes, scenario.changes);

    let mut setup = scenario.setup();
    setup.seed += 1;
    let changed = scenario.with_setup(&setup).unwrap();
    assert_eq!(changed.parent, None);
    assert_eq!(changed.changes, scenario.changes);
}

#[test]
fn a_robot_that_is_away_is_not_started_again_by_a_change() {
    for (fault, restarts) in [
        ("at = \"5 s\", until = \"10 s\"", false),
        ("at = \"5 s\", until = \"9.5 s\"", true),
        ("at = \"10 s\", until = \"12 s\"", false),
        ("at = \"10.5 s\", until = \"12 s\"", true),
        ("at = \"5 s\"", false),
    ] {
        let scenario = with_changes(&format!(
            "on_late = \"continue\"\n[[fault]]\nrobot = \"A\"\ndo = \"crash\"\n{}\n\
             [[change]]\nat = \"10 s\"\nset = [\"robot.A.params.wait=1\"]\n",
            fault.replace(", ", "\n")
        ));
        let restarted = scenario.unwrap().restarts_at(20);
        assert_eq!(restarted.len(), usize::from(restarts), "{fault}");
    }
}

#[test]
fn a_change_that_cannot_be_made_shows_its_place() {
    for (set, line, reason) in [
        ("seed=3", 1, "only the network, faults, rules"),
        ("guests.count=3", 1, "only the network, faults, rules"),
        ("robot.A.at=[\"4 m\", \"3 m\"]", 1, "only the network"),
        ("lose_after=3", 1, "only the network"),
        ("robot.C.params.x=1", 3, "none of the 2 elements"),
        ("change=[]", 3, "a further [[change]]"),
        ("parent.tick=1", 3, "a further [[change]]"),
        ("loss", 3, "not of the form path=value"),
        ("fault=[]", 1, "what a fault did before the change"),
    ] {
        let fault = "[[fault]]\nrobot = \"B\"\ndo = \"slow\"\nat = \"1 s\"\n";
        let error = with_changes(&format!(
            "[[change]]\nat = \"10 s\"\nset = ['{set}']\n{fault}"
        ))
        .unwrap_err();
        let text = shown(&error);
        assert!(text.contains(reason), "{set}: {text}");
        assert!(
            text.contains(&format!("hall.toml:{line}:")),
            "{set}: {text}"
        );
    }

    let error = with_changes("[[change]]\nat = \"0 s\"\nset = []\n").unwrap_err();
    assert!(shown(&error).contains("from the first tick on"));
    let error = with_changes("[[change]]\nat = \"3 s\"\nset = [\"network.commands.loss=2\"]\n");
    let text = shown(&error.unwrap_err());
    assert!(text.contains("its change at tick 6"), "{text}");
    let many = "[[change]]\nat = \"1 s\"\nset = []\n".repeat(1001);
    let error = with_changes(&many).unwrap_err();
    assert!(shown(&error).contains("more than 1000 changes"));
    assert!(with_changes(&"[[change]]\nat = \"1 s\"\nset = []\n".repeat(1000)).is_ok());
}

#[test]
fn an_untrusted_scenario_names_no_files_in_changes_either() {
    let text = format!(
        "[[change]]\nat = \"1 s\"\nset = ['robot.A.params_from=\"/dev/zero\"']\n{TWO_ROBOTS}"
    );
    let source = Source {
        name: "loaded".into(),
        text,
    };
    let error = Scenario::parse_alone(&source).unwrap_err();
    assert!(
        shown(&error).contains("of a scenario from outside"),
        "{}",
        shown(&error)
    );
}

#[test]
fn own_parameters_replace_single_keys_of_tables_of_the_file() {
    let text = "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams_from = \"robots/butler.toml\"\n\
                params = { dynamics = { th_frustrated = 0.9, label_cuts = [0.5] } }\n";
    let source = Source {
        name: "loaded".into(),
        text: text.to_owned(),
    };
    let scenario = Scenario::parse_alone(&source).unwrap();

    let robot = scenario.robots.values().next().unwrap();
    let dynamics = &robot.parameters["dynamics"];
    assert_eq!(dynamics["th_frustrated"], 0.9);
    assert_eq!(dynamics["th_concerned"], 0.45);
    assert_eq!(dynamics["label_cuts"], serde_json::json!([0.5]));
}

#[test]
fn a_quantity_is_of_the_kind_that_the_name_of_its_parameter_says() {
    let with = |parameters: &str| {
        parse(&format!(
            "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = {{ {parameters} }}\n"
        ))
    };
    let wrong = [
        ("patience_s = \"5 ft\"", "it is a time"),
        ("dynamics = { tau_s = \"1 m\" }", "it is a time"),
        ("table_m = [\"1 m\", \"1 s\"]", "it is a length"),
        ("v_mps = \"1 m/s2\"", "it is a speed"),
        ("a_mps2 = \"1 m/s\"", "it is an acceleration"),
        ("heading_rad = \"1 deg/s\"", "it is an angle"),
        ("turn_radps = \"1 deg\"", "it is a turn rate"),
        ("turn_radps2 = \"1 deg/s\"", "it is a turn acceleration"),
        ("band_hz = \"1 s\"", "it is a frequency"),
        ("rate_bps = \"1 Hz\"", "it is a bit rate"),
    ];
    for (parameters, reason) in wrong {
        let text = shown(&with(parameters).unwrap_err());
        assert!(text.contains(reason), "{parameters}: {text}");
    }

    let right = "patience_s = \"5 min\", a = \"5 ft\", note_s = \"soon\", other_s = 5, table_m = [\"1 m\", \"1 ft\"]";
    let scenario = with(right).unwrap();
    let robot = scenario.robots.values().next().unwrap();
    assert_eq!(robot.parameters["patience_s"], 300.0);
    assert_eq!(robot.parameters["note_s"], "soon");
}

/// A scenario with robot A and these expectations.
fn expecting(entries: &str) -> Result<Scenario, FileError> {
    parse(&format!(
        "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n{entries}"
    ))
}

#[test]
fn expectations_are_kept_in_the_resolved_file() {
    let entry = "[[expect]]\nname = \"it\"\nafter = { event = \"link_healed\", to = \"A\" }\neventually = [{ event = \"say\" }, { robot = \
                 \"A\", variable = \"x\", above = 2 }]\nwithin = \"1 min\"\n";
    let scenario = expecting(entry).unwrap();
    assert_eq!(scenario.expectations.len(), 1);
    let again = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(again.expectations, scenario.expectations);
}

#[test]
fn expectations_of_other_robots_of_one_name_and_too_many_are_refused() {
    let entry =
        |name: &str| format!("[[expect]]\nname = \"{name}\"\nnever = {{ event = \"say\" }}\n");
    let many: String = (0..64).map(|number| entry(&number.to_string())).collect();
    assert_eq!(expecting(&many).unwrap().expectations.len(), 64);

    for (entries, reason) in [
        (many + &entry("64"), "more than 64 expectations"),
        (
            entry("it") + &entry("it"),
            "a second expectation called \"it\"",
        ),
        (
            "[[expect]]\nname = \"it\"\nnever = { event = \"say\", robot = \"B\" }\n".to_owned(),
            "no robot of this scenario is called B",
        ),
    ] {
        let error = shown(&expecting(&entries).unwrap_err());
        assert!(error.contains(reason), "{error}");
        assert!(error.contains("[[expect]]"), "{error}");
    }
}

#[test]
fn expectations_do_not_change_while_a_run_goes_on() {
    let change = "[[change]]\nat = \"5 s\"\nset = [\"expect.0.name=other\"]\n";
    let entry = "[[expect]]\nname = \"it\"\nnever = { event = \"say\" }\n";
    let error = shown(&expecting(&format!("{change}{entry}")).unwrap_err());
    assert!(error.contains("only the network, faults, rules"), "{error}");
}

/// The remarks about a scenario as people see them.
fn remarks(text: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hall.toml");
    let robots = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"5 m\", \"5 m\"]\n";
    std::fs::write(&file, format!("{text}\n{robots}")).unwrap();
    Scenario::load(&file, &Changes::default()).unwrap();
    let remarks = Scenario::remarks(&file, &Changes::default()).unwrap();
    remarks.iter().map(shown).collect()
}

#[test]
fn people_are_told_what_is_rounded_and_what_never_begins() {
    let quiet = "duration = \"60 s\"\ntick = \"0.1 s\"\non_late = \"continue\"\n\
                 [[fault]]\nrobot = \"A\"\ndo = \"hang\"\nat = \"60 s\"\n\
                 [[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"0.3 s\"\nuntil = \"59.7 s\"\n\
                 [[change]]\nat = \"0.7 s\"\nset = [\"network.commands.loss=1\"]\n";
    assert_eq!(remarks(quiet), [""; 0]);

    for (text, place, words) in [
        ("duration = \"10.3 s\"", ":1:12", "the run lasts 10.5 s"),
        ("duration = \"10.2 s\"", ":1:12", "the run lasts 10 s"),
        (
            "duration = \"10 s\"\n[[fault]]\nrobot = \"A\"\ndo = \"restart\"\nat = \"10.5 s\"",
            ":5:6",
            "this fault never begins: the run ends at 10 s",
        ),
        (
            "[[fault]]\nrobot = \"A\"\ndo = \"restart\"\nat = \"10.1 s\"",
            ":4:6",
            "it counts as 10 s, tick 20",
        ),
        (
            "on_late = \"continue\"\n[[fault]]\nrobot = \"A\"\ndo = \"hang\"\nat = \"10 s\"\nuntil = \"10.8 s\"",
            ":6:9",
            "it counts as 11 s, tick 22",
        ),
        (
            "duration = \"10 s\"\n[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"11 s\"",
            ":4:8",
            "this partition never begins",
        ),
        (
            "duration = \"10 s\"\n[[change]]\nat = \"11 s\"\nset = [\"network.commands.loss=1\"]",
            ":3:6",
            "this change never begins",
        ),
    ] {
        let remarks = remarks(text);
        assert_eq!(remarks.len(), 1, "{text}: {remarks:?}");
        assert!(
            remarks[0].contains(&format!("hall.toml{place}")),
            "{}",
            remarks[0]
        );
        assert!(remarks[0].contains(words), "{}", remarks[0]);
    }
}

#[test]
fn what_lies_between_two_ticks_is_refused_with_the_reason() {
    let robots = "[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n[[robot]]\nname = \"B\"\nat = [\"5 m\", \"5 m\"]\n";
    let partition = |from: &str, until: &str| {
        let text = format!(
            "[[network.partition]]\ngroups = [[\"A\"], [\"B\"]]\nfrom = \"{from}\"\nuntil = \"{until}\"\n{robots}"
        );
        shown(&parse(&text).unwrap_err())
    };
    let between = partition("10.1 s", "10.2 s");
    assert!(
        between.contains("there is no tick from 10.1 s to 10.2 s"),
        "{between}"
    );
    assert!(between.contains("both count as tick 20"), "{between}");
    assert!(between.contains("hall.toml:4:9"), "{between}");
    let backwards = partition("10.2 s", "10.1 s");
    assert!(
        backwards.contains("it ends before it begins"),
        "{backwards}"
    );

    let fault = format!(
        "on_late = \"continue\"\n[[fault]]\nrobot = \"A\"\ndo = \"hang\"\nat = \"10.1 s\"\nuntil = \"10.2 s\"\n{robots}"
    );
    let fault = shown(&parse(&fault).unwrap_err());
    assert!(
        fault.contains("there is no tick from 10.1 s to 10.2 s"),
        "{fault}"
    );
}

/// A scenario whose robot A begins with the mood of a run.
fn in_the_mood_of(run: &str) -> Result<Scenario, FileError> {
    parse(&format!(
        "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = {{ mood = {{ start = 0.1, weight = 0.2, from = {run} }} }}\n"
    ))
}

#[test]
fn a_robot_begins_with_the_mood_in_which_it_ended_another_run() {
    let run = tempfile::tempdir().unwrap();
    let path = format!("{:?}", run.path().to_str().unwrap());
    let summary = run.path().join("summary.json");

    let missing = shown(&in_the_mood_of("\"no such run\"").unwrap_err());
    assert!(missing.contains("there is no run no such run"), "{missing}");
    let unfinished = shown(&in_the_mood_of(&path).unwrap_err());
    assert!(unfinished.contains("one that is not over"), "{unfinished}");
    let number = shown(&in_the_mood_of("3").unwrap_err());
    assert!(number.contains("in quotation marks"), "{number}");

    for (content, reason) in [
        ("{", "summary.json"),
        (
            r#"{"robots": {"B": {}}}"#,
            "no robot called A; its robots are B",
        ),
        (
            r#"{"robots": {"A": {"state_variables": {}}}}"#,
            "A has published no mood",
        ),
    ] {
        std::fs::write(&summary, content).unwrap();
        let error = shown(&in_the_mood_of(&path).unwrap_err());
        assert!(error.contains(reason), "{error}");
    }

    std::fs::write(
        &summary,
        r#"{"robots": {"A": {"state_variables": {"mood": -0.25}}}}"#,
    )
    .unwrap();
    let scenario = in_the_mood_of(&path).unwrap();
    let mood = &scenario.robots.values().next().unwrap().parameters["mood"];
    assert_eq!(*mood, serde_json::json!({"start": -0.25, "weight": 0.2}));
    std::fs::remove_file(&summary).unwrap();
    let text = scenario.to_toml().unwrap();
    assert!(parse(&text).is_ok(), "the record depends on no other run");
}

#[test]
fn the_mood_at_the_start_does_not_change_while_the_run_goes_on() {
    let refused = "mood.start is A's mood at the beginning of the run";
    for (set, is_refused) in [
        ("robot.A.params.mood.start=0.5", true),
        ("robot.*.params={ mood = { start = 0.5 } }", true),
        ("robot.A.params.mood.start=-0.25", false),
        ("robot.A.params.mood.weight=0.5", false),
        ("robot.A.params={}", false),
    ] {
        let robot = "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = { mood = { start = -0.25 } }\n";
        let change = format!("[[change]]\nat = \"1 s\"\nset = ['{set}']\n");
        let error = parse(&format!("{robot}{change}"))
            .err()
            .map(|error| shown(&error).replace("\n", " "))
            .unwrap_or_default();
        assert_eq!(error.contains(refused), is_refused, "{set}: {error}");
        assert_eq!(error.is_empty(), !is_refused, "{set}: {error}");
    }
}

#[test]
fn neither_a_change_nor_a_scenario_from_outside_names_a_run() {
    for set in [
        "robot.A.params.mood.from=\"r\"",
        "robot.A.params.mood={ from = \"r\" }",
        "robot.*.params={ mood = { from = \"r\" } }",
    ] {
        let text = format!("[[change]]\nat = \"1 s\"\nset = ['{set}']\n{TWO_ROBOTS}");
        let error = shown(&parse(&text).unwrap_err());
        assert!(error.contains("from the start on"), "{set}: {error}");
    }

    let source = Source {
        name: "loaded".into(),
        text: "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nparams = { mood = { from = \"r\" } }\n".into(),
    };
    let error = shown(&Scenario::parse_alone(&source).unwrap_err());
    assert!(error.contains("of a scenario from outside"), "{error}");
}

#[test]
fn the_condition_that_ends_a_run_is_kept_in_the_resolved_file() {
    for condition in [
        "{ robot = \"A\", variable = \"x\", at_least = 3, for = \"10 s\" }",
        "[{ event = \"judged\", verdict = \"fail\" }, { robot = \"A\", behavior = \"DONE\" }]",
    ] {
        let text =
            format!("end_when = {condition}\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n");
        let scenario = parse(&text).unwrap();
        assert!(scenario.end_when.is_some());
        let again = parse(&scenario.to_toml().unwrap()).unwrap();
        assert_eq!(again.end_when, scenario.end_when);
    }
}

#[test]
fn a_condition_that_no_run_ends_by_is_refused() {
    for (condition, reason) in [
        (
            "{ robot = \"B\", behavior = \"X\" }",
            "no robot of this scenario is called B",
        ),
        (
            "{ event = \"end\" }",
            "`end_when` cannot name the event \"end\"",
        ),
        ("{ robot = \"A\" }", "a condition is an event"),
    ] {
        let text =
            format!("end_when = {condition}\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n");
        let error = parse(&text).unwrap_err();
        assert!(error.reason().contains(reason), "{condition}: {error}");
    }

    let change = "[[change]]\nat = \"10 s\"\nset = ['end_when={ event = \"say\" }']\n";
    let error = expecting(change).unwrap_err();
    assert!(
        error.reason().contains("holds for the whole run"),
        "{error}"
    );
}

#[test]
fn a_run_is_re_seeded_by_kinds_of_chance() {
    let text = format!(
        "seed = 5\n[[reseed]]\nat = \"20 s\"\nseed = 9\nof = [\"network\", \"robot.A*\"]\n\
         [[reseed]]\nat = \"10 s\"\nseed = 8\n{TWO_ROBOTS}"
    );
    let scenario = parse(&text).unwrap();
    let [a, b] = ["A", "B"].map(|name| RobotName::new(name).unwrap());
    let [first, second] = [&scenario.reseeds[0], &scenario.reseeds[1]];
    assert_eq!((first.at, second.at), (20, 40));
    assert!(first.of_guests().is_some() && first.of_sensing().is_some());
    assert!(second.of_guests().is_none() && second.of_network().is_some());

    assert_eq!(scenario.stream_seed(&a, 19), 5);
    assert_eq!(
        scenario.stream_seed(&a, 20),
        first.of_robot(&a).unwrap().seed
    );
    assert_eq!(
        scenario.stream_seed(&a, 40),
        second.of_robot(&a).unwrap().seed
    );
    assert_eq!(scenario.stream_seed(&b, 40), scenario.stream_seed(&b, 20));
    assert_eq!(scenario.stream_reseeds(&a, 20).len(), 1);
    assert_eq!(scenario.stream_reseeds(&b, 20).len(), 0);
    assert_ne!(scenario.sensing_seed(40), 5);

    let again = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(again.reseeds, scenario.reseeds);

    for (entry, line, reason) in [
        ("at = \"0 s\"\nseed = 1", 2, "from the first tick on"),
        ("at = \"1 s\"\nseed = 9007199254740992", 3, "seed"),
        (
            "at = \"1 s\"\nseed = 1\nof = [\"nets\"]",
            4,
            "the kinds are network, guests",
        ),
        (
            "at = \"1 s\"\nseed = 1\nof = [\"robot.Zed\"]",
            4,
            "no robot is called Zed",
        ),
    ] {
        let error = shown(&parse(&format!("[[reseed]]\n{entry}\n{TWO_ROBOTS}")).unwrap_err());
        assert!(error.contains(reason), "{entry}: {error}");
        assert!(
            error.contains(&format!("hall.toml:{line}:")),
            "{entry}: {error}"
        );
    }
}
