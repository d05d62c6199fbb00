//! Places: patterns, regions, sizes and walls, as written in a file, drawn from the seed, and written out.

use std::f64::consts::{FRAC_PI_2, PI};

use config::{Changes, Source};
use protocol::messages::Point;
use scenario::Scenario;
use world::{Region, Shape, Wheels};

use super::parse;

/// What people are shown.
fn shown(text: &str) -> String {
    match parse(text) {
        Ok(_) => panic!("this was not refused:\n{text}"),
        Err(error) => config::render_plain(&error, None, 200),
    }
}

fn bulk(at: &str, count: usize) -> String {
    format!("[[robot]]\nname = \"S\"\ncount = {count}\nat = {at}\n")
}

/// The places of the robots S1, S2, … in the order of their numbers.
fn places(scenario: &Scenario) -> Vec<Point> {
    let mut named: Vec<_> = scenario.robots.iter().collect();
    named.sort_by_key(|(name, _)| (name.as_str().len(), (*name).clone()));
    named.into_iter().map(|(_, robot)| robot.at).collect()
}

fn points(list: &[(f64, f64)]) -> Vec<Point> {
    list.iter().map(|(x, y)| Point::new(*x, *y)).collect()
}

const GRID: &str = r#"{ grid = { from = ["1 m", "2 m"], step = "2 m", columns = 2 } }"#;
const LINE: &str = r#"{ line = { from = ["1 m", "1 m"], to = ["1 m", "9 m"] } }"#;
const CIRCLE: &str = r#"{ circle = { center = ["5 m", "5 m"], radius = "2 m" } }"#;
const CLUSTER: &str = r#"{ cluster = { center = ["5 m", "5 m"], radius = "3 m" } }"#;
const REGION: &str = r#"{ random = { from = ["4 m", "4 m"], to = ["9 m", "8 m"] } }"#;

#[test]
fn robots_in_bulk_stand_on_grids_lines_and_circles() {
    let at = |at: &str, count| places(&parse(&bulk(at, count)).unwrap());

    assert_eq!(
        at(GRID, 5),
        points(&[(1.0, 2.0), (3.0, 2.0), (1.0, 4.0), (3.0, 4.0), (1.0, 6.0)])
    );
    let steps = GRID.replace("\"2 m\", columns", "[\"3 m\", \"1 m\"], columns");
    assert_eq!(at(&steps, 3), points(&[(1.0, 2.0), (4.0, 2.0), (1.0, 3.0)]));
    assert_eq!(
        at(LINE, 5),
        points(&[(1.0, 1.0), (1.0, 3.0), (1.0, 5.0), (1.0, 7.0), (1.0, 9.0)])
    );
    assert_eq!(at(LINE, 1), points(&[(1.0, 1.0)]));

    let circle = at(CIRCLE, 4);
    let expected = points(&[(7.0, 5.0), (5.0, 7.0), (3.0, 5.0), (5.0, 3.0)]);
    for (at, expected) in circle.iter().zip(expected) {
        assert!(at.distance_m(expected) < 1e-12, "{circle:?}");
    }
}

#[test]
fn one_of_a_table_in_bulk_keeps_its_place_when_another_is_changed() {
    for at in [GRID, LINE, CIRCLE] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hall.toml");
        std::fs::write(&path, bulk(at, 4)).unwrap();
        let plain = Scenario::load(&path, &Changes::default()).unwrap();

        let changes = Changes {
            set: vec!["robot.S3.params.k=2".parse().unwrap()],
            ..Changes::default()
        };
        let changed = Scenario::load(&path, &changes).unwrap();
        assert_eq!(places(&changed), places(&plain), "{at}");
        assert_eq!(changed.robots["S3"].parameters["k"], 2);
    }
}

#[test]
fn places_are_drawn_within_their_region_and_anew_for_another_seed() {
    let jitter = GRID.replace("columns = 2 } }", "columns = 2 }, jitter = \"0.3 m\" }");
    let is_in = |at: &str, index: usize, place: Point| match at {
        CLUSTER => place.distance_m(Point::new(5.0, 5.0)) <= 3.0,
        REGION => (4.0..=9.0).contains(&place.x) && (4.0..=8.0).contains(&place.y),
        _ => {
            let x_m = 1.0 + 2.0 * (index % 2) as f64;
            let y_m = 2.0 + 2.0 * (index / 2) as f64;
            (place.x - x_m).abs() <= 0.3 && (place.y - y_m).abs() <= 0.3
        }
    };

    for at in [CLUSTER, REGION, &jitter] {
        let file = bulk(at, 6);
        let mut seen = Vec::new();
        for seed in 1..40 {
            let scenario = parse(&format!("seed = {seed}\n{file}")).unwrap();
            let drawn = places(&scenario);
            for (index, place) in drawn.iter().enumerate() {
                assert!(is_in(at, index, *place), "{at} of seed {seed}: {place:?}");
            }
            assert!(!seen.contains(&drawn), "{at}: seed {seed} is as another");
            seen.push(drawn.clone());

            // Another seed draws anew, and this one again the same, also through the file for any seed.
            let other = scenario.clone().with_seed(seed + 1000).unwrap();
            assert_ne!(places(&other), drawn);
            let again = other.clone().with_seed(seed).unwrap();
            assert_eq!(places(&again), drawn);
            let without = scenario.to_toml_without_seed().unwrap();
            let read = parse(&format!("seed = {seed}\n{without}")).unwrap();
            assert_eq!(places(&read), drawn, "{without}");
            assert_eq!(without, other.to_toml_without_seed().unwrap());
        }

        // One more moves none, and the record has the places.
        let few = parse(&file).unwrap();
        let text = few.to_toml().unwrap();
        let written = parse(&text).unwrap();
        assert_eq!(places(&written), places(&few));
        assert_eq!(written.to_toml().unwrap(), text);
        // And where they were drawn, for other seeds.
        let other = few.clone().with_seed(77).unwrap();
        assert_eq!(
            places(&written.with_seed(77).unwrap()),
            places(&other),
            "{text}"
        );
        if at != jitter {
            let more = parse(&bulk(at, 7)).unwrap();
            assert_eq!(places(&more)[..6], places(&few)[..]);
        }
    }
}

#[test]
fn obstacles_are_placed_by_patterns_too() {
    let text = format!(
        "[[obstacle]]\nat = [\"14 m\", \"14 m\"]\n[[obstacle]]\ncount = 4\nat = {CIRCLE}\nradius = \"0.2 m\"\n\
         [[obstacle]]\ncount = 3\nat = {REGION}\nsize = [\"1 m\", \"0.2 m\"]\n{}",
        bulk("\"random\"", 3)
    );
    let scenario = parse(&text).unwrap();
    assert_eq!(scenario.obstacles.len(), 8);
    assert_eq!(scenario.obstacles[0].shape, None);
    let disc = Some(Shape::Disc { radius_m: 0.2 });
    let slab = Some(Shape::Rectangle {
        width_m: 1.0,
        height_m: 0.2,
    });
    assert!(
        scenario.obstacles[1..5]
            .iter()
            .all(|obstacle| obstacle.shape == disc)
    );
    for obstacle in &scenario.obstacles[5..] {
        assert_eq!(obstacle.shape, slab);
        assert!(matches!(obstacle.drawn, Some(Region::Rectangle(..))));
        assert!((4.0..=9.0).contains(&obstacle.at.x));
    }

    let written = parse(&scenario.to_toml().unwrap()).unwrap();
    let obstacle_places = |scenario: &Scenario| -> Vec<_> {
        let obstacles = scenario.obstacles.iter();
        obstacles
            .map(|obstacle| (obstacle.at, obstacle.shape))
            .collect()
    };
    assert_eq!(obstacle_places(&written), obstacle_places(&scenario));
    let without = scenario.to_toml_without_seed().unwrap();
    assert_eq!(
        obstacle_places(&parse(&without).unwrap()),
        obstacle_places(&scenario)
    );
    let other = scenario.clone().with_seed(2).unwrap();
    assert_ne!(obstacle_places(&other), obstacle_places(&scenario));
    assert_eq!(
        obstacle_places(&other)[..5],
        obstacle_places(&scenario)[..5]
    );

    // Robots are drawn beside obstacles that are, and from streams of their own.
    let alone = parse(&bulk("\"random\"", 3)).unwrap();
    assert_eq!(places(&alone)[0], places(&scenario)[0]);
}

#[test]
fn sizes_and_walls_are_read_and_written() {
    let text = "[[wall]]\npoints = [[\"1 m\", \"1 m\"], [\"9 m\", \"1 m\"], [\"9 m\", \"9 m\"]]\n\
                [[wall]]\npoints = [[\"2 m\", \"2 m\"], [\"2 m\", \"3 m\"]]\n\
                [[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\nsize = \"0.5 m\"\n\
                [[robot]]\nname = \"B\"\nat = [\"7 m\", \"5 m\"]\nradius = \"0.25 m\"\n\
                [[robot]]\nname = \"C\"\nat = [\"3 m\", \"5 m\"]\n";
    let scenario = parse(text).unwrap();
    assert_eq!(scenario.walls.len(), 3);
    assert_eq!(scenario.robots["A"].shape, Some(Shape::square(0.5)));
    assert_eq!(
        scenario.robots["B"].shape,
        Some(Shape::Disc { radius_m: 0.25 })
    );
    assert_eq!(scenario.robots["C"].shape, None);

    let hall = scenario.hall();
    assert_eq!(hall.shapes.walls, scenario.walls);
    assert_eq!(hall.shapes.robots.len(), 2);

    let written = scenario.to_toml().unwrap();
    assert_eq!(written.matches("[[wall]]").count(), 2, "{written}");
    let read = parse(&written).unwrap();
    assert_eq!(read.hall(), hall);
    assert_eq!(read.to_toml().unwrap(), written);
}

#[test]
fn a_floor_plan_becomes_walls_and_obstacles_of_the_record() {
    let folder = tempfile::tempdir().unwrap();
    let plan = "<svg viewBox='0 0 1000 1000'><rect x='100' y='100' width='200' height='50'/>\n\
                <rect width='1000' height='1000' fill='none'/></svg>";
    std::fs::write(folder.path().join("plan.svg"), plan).unwrap();
    let file = "[floor_plan]\nfile = \"plan.svg\"\nscale = \"1 cm\"\n[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n";
    let path = folder.path().join("hall.toml");
    let load = |text: &str| {
        std::fs::write(&path, text).unwrap();
        Scenario::load(&path, &Changes::default())
    };

    let scenario = load(file).unwrap();
    assert_eq!(scenario.walls.len(), 4);
    assert_eq!(scenario.obstacles.len(), 1);
    let at = scenario.obstacles[0].at;
    assert!(at.distance_m(Point::new(2.0, 8.75)) < 1e-12, "{at:?}");

    // The record is read without the drawing, as a text from outside, and is the same.
    let written = scenario.to_toml().unwrap();
    let source = Source {
        name: "record".into(),
        text: written.clone(),
    };
    let read = Scenario::parse_alone(&source).unwrap();
    assert_eq!(read.hall(), scenario.hall());
    assert_eq!(read.to_toml().unwrap(), written);
    let outside = Source {
        name: "outside".into(),
        text: file.to_owned(),
    };
    let error = Scenario::parse_alone(&outside).unwrap_err();
    assert!(error.reason().contains("names no drawing"), "{error}");

    // Moved off the field, and one that is not there.
    let moved = file.replace("scale", "at = [\"8 m\", \"0 m\"]\nscale");
    let error = load(&moved).unwrap_err();
    assert!(error.reason().contains("is not on the field"), "{error}");
    let error = load(&file.replace("plan.svg", "none.svg")).unwrap_err();
    assert!(error.reason().contains("none.svg"), "{error}");
}

#[test]
fn what_cannot_be_placed_is_refused_with_line_and_reason() {
    let robot = "[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n";
    for (text, line, reason) in [
        (
            bulk(&CLUSTER.replace("3 m", "0.3 m"), 9),
            "[[robot]]",
            "no free place for robot S",
        ),
        (
            bulk(&REGION.replace("9 m", "99 m").replace("4 m", "98 m"), 1),
            "[[robot]]",
            "the region of its place is too small, too full, or off the field",
        ),
        (
            bulk(&LINE.replace("9 m", "1.1 m"), 3),
            "[[robot]]",
            "robot S2 at (1, 1.05) m overlaps robot S1",
        ),
        (
            format!("{robot}[[obstacle]]\ncount = 2\nat = {CLUSTER}\nsize = \"9 m\"\n"),
            "at = {",
            "no free place for obstacle 1",
        ),
        (
            format!("{robot}[[obstacle]]\nat = [\"1 m\", \"1 m\"]\nradius = \"3 m\"\n"),
            "at = [\"1 m\", \"1 m\"]",
            "obstacle 1 at (1, 1) m is not entirely inside the field",
        ),
        (
            format!("{robot}[[wall]]\npoints = [[\"5 m\", \"1 m\"], [\"5 m\", \"9 m\"]]\n"),
            "[[robot]]",
            "robot A at (5, 5) m stands on wall 1",
        ),
        (
            format!("{robot}[[wall]]\npoints = [[\"1 m\", \"1 m\"], [\"5 m\", \"99 m\"]]\n"),
            "points = ",
            "wall 1 has an end at (5, 99) m, which is not on the field",
        ),
        (
            format!("{robot}[[wall]]\npoints = [[\"1 m\", \"1 m\"]]\n"),
            "points = ",
            "at least two points",
        ),
        (
            format!("{robot}size = \"1 m\"\nradius = \"1 m\"\n"),
            "radius = ",
            "a size or a radius, not both",
        ),
        (
            format!("{robot}radius = \"-1 m\"\n"),
            "radius = ",
            "this body is -2 m wide or high",
        ),
        (
            format!("{}radius = \"-1 m\"\n", bulk("\"random\"", 2)),
            "radius = ",
            "this body is -2 m wide or high",
        ),
        (
            format!("[[obstacle]]\nat = \"random\"\nsize = [\"1 m\", \"0.05 cm\"]\n{robot}"),
            "size = ",
            "this body is 0.0005 m wide or high: bodies are from 0.001 m to 1000000 m",
        ),
        (
            bulk(&GRID.replace("columns = 2", "columns = 0"), 2),
            "at = {",
            "at least one column",
        ),
        (
            bulk("{ jitter = \"1 m\" }", 2),
            "at = {",
            "exactly one of place, grid, line, circle, cluster and random",
        ),
        (
            bulk(&CLUSTER.replace("} }", "}, jitter = \"1 m\" }"), 2),
            "at = {",
            "leave jitter out",
        ),
        (
            bulk(&CIRCLE.replace("circle", "cirkle"), 2),
            "cirkle",
            "unknown field `cirkle`",
        ),
        (
            format!("[[obstacle]]\ncount = 4097\nat = {CIRCLE}\n{robot}"),
            "at = {",
            "more than 4096 obstacles",
        ),
    ] {
        let error = shown(&text);
        assert!(error.contains(line), "no {line:?} in\n{error}\n{text}");
        assert!(error.contains(reason), "no {reason:?} in\n{error}");
    }
}

#[test]
fn drives_are_read_and_written() {
    let file = |drive: &str| {
        format!("[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\ndrive = {drive}\n")
    };
    let limits = "{ max_speed = \"36 km/h\", max_turn = \"90 deg/s\", max_acceleration = \"0.5 m/s2\", \
                  max_turn_acceleration = \"180 deg/s2\", heading = \"180 deg\" }";
    let scenario = parse(&file(limits)).unwrap();
    let expected = Wheels {
        max_speed_mps: 10.0,
        max_turn_radps: FRAC_PI_2,
        max_acceleration_mps2: 0.5,
        max_turn_acceleration_radps2: PI,
        heading_rad: PI,
    };
    assert_eq!(scenario.robots["A"].wheels, Some(expected));

    let free = parse(&file("{}")).unwrap();
    let unlimited = free.robots["A"].wheels.unwrap();
    assert!(unlimited.max_speed_mps.is_infinite() && unlimited.max_turn_radps.is_infinite());
    let plain = parse(&bulk("\"random\"", 2)).unwrap();
    assert_eq!(plain.robots["S1"].wheels, None);
    for scenario in [scenario, free] {
        let written = scenario.to_toml().unwrap();
        let read = parse(&written).unwrap();
        assert_eq!(read.robots["A"].wheels, scenario.robots["A"].wheels);
        assert_eq!(read.to_toml().unwrap(), written);
    }

    // All of a table in bulk drive, and one lies where it has room with its heading.
    let bulk = bulk("\"random\"", 3);
    let bulk = format!("{bulk}size = [\"8 m\", \"0.2 m\"]\ndrive = {{ heading = \"90 deg\" }}\n");
    let scenario = parse(&format!("[field]\nsize = [\"9 m\", \"9 m\"]\n{bulk}")).unwrap();
    for robot in scenario.robots.values() {
        assert!((4.0..5.0).contains(&robot.at.y), "{:?}", robot.at);
        assert_eq!(robot.wheels.unwrap().heading_rad, FRAC_PI_2);
    }

    for (drive, reason) in [
        (
            "{ max_turn = \"0 deg/s\" }",
            "max_turn must be more than zero",
        ),
        (
            "{ max_turn = \"90 deg\" }",
            "is not a turn rate such as \"90 deg/s\"",
        ),
        (
            "{ max_acceleration = \"-1 m/s2\" }",
            "max_acceleration must be more than zero",
        ),
        (
            "{ max_turn_acceleration = 3 }",
            "a turn acceleration such as \"180 deg/s2\"",
        ),
        ("{ max_sped = \"1 m/s\" }", "unknown field `max_sped`"),
    ] {
        let error = shown(&file(drive));
        assert!(error.contains(reason), "no {reason:?} in\n{error}");
        assert!(error.contains("drive = {"), "no place in\n{error}");
    }
}

#[test]
fn more_bodies_than_there_is_room_for_are_refused_before_anything_starts() {
    let hall = |more: &str| {
        format!(
            "[field]\nsize = [\"100 m\", \"100 m\"]\nbody = \"1 m\"\n{more}[[robot]]\nname = \"A\"\nat = [\"0.5 m\", \"0.5 m\"]\n"
        )
    };
    // The field has room for 10,000 squares.
    assert!(parse(&hall("[guests]\ncount = 9999\n")).is_ok());
    let error = shown(&hall("[guests]\ncount = 10000\n"));
    assert!(
        error.contains("10000 guests do not fit: obstacles and robots leave room for 9999"),
        "{error}"
    );

    // Obstacles may overlap one another where their places are given, and not where they are drawn.
    let full = |count: usize, size: &str| {
        let random = format!("[[obstacle]]\ncount = {count}\nat = \"random\"\nsize = \"{size}\"\n");
        hall(&random)
    };
    let error = shown(&full(4096, "2 m"));
    assert!(error.contains("the field is too full"), "{error}");
    assert!(parse(&full(4096, "0.5 m")).is_ok());
    let error = shown(&full(2, "99.5 m"));
    assert!(error.contains("no free place for obstacle"), "{error}");
    let error = shown(&full(1, "200 m"));
    assert!(error.contains("obstacle 1"), "{error}");

    // Bodies much larger than a square of the field, which is what their neighbors are looked for by.
    let large = "[field]\nsize = [\"10 m\", \"10 m\"]\nbody = \"0.1 cm\"\n[[robot]]\nname = \"S\"\ncount = 64\nat = \"random\"\nradius = \"1 m\"\n";
    let error = shown(large);
    assert!(error.contains("no free place for robot S"), "{error}");

    // As many sites as there may be, on a field of a million squares.
    let sites = "[field]\nsize = [\"1000 m\", \"1000 m\"]\nbody = \"1 m\"\n[[site]]\nname = \"T\"\ncount = 1024\nat = \"random\"\n";
    assert_eq!(parse(sites).unwrap().sites.len(), 1024);
    let region = "{ random = { from = [\"-5 m\", \"0 m\"], to = [\"-4 m\", \"9 m\"] } }";
    let error = shown(&sites.replace("\"random\"", region));
    assert!(
        error.contains("no free place for site T1 in 1000 draws: the region of its place"),
        "{error}"
    );
}

#[test]
fn regions_without_an_area_and_jitter_over_the_edge_have_places() {
    // A point and a line.
    let spot = REGION.replace("9 m", "4 m").replace("8 m", "4 m");
    assert_eq!(
        places(&parse(&bulk(&spot, 1)).unwrap()),
        points(&[(4.0, 4.0)])
    );
    let error = shown(&bulk(&spot, 2));
    assert!(error.contains("no free place for robot S2"), "{error}");
    let line = REGION.replace("8 m", "4 m");
    let on_line = places(&parse(&bulk(&line, 4)).unwrap());
    assert!(
        on_line
            .iter()
            .all(|at| at.y == 4.0 && (4.0..=9.0).contains(&at.x))
    );
    let dot = CLUSTER.replace("3 m", "0 m");
    assert_eq!(
        places(&parse(&bulk(&dot, 1)).unwrap()),
        points(&[(5.0, 5.0)])
    );
    // Corners in any order.
    let corners = REGION
        .replace("from", "x")
        .replace("to", "from")
        .replace("x", "to");
    assert_eq!(
        places(&parse(&bulk(&corners, 3)).unwrap()).len(),
        places(&parse(&bulk(REGION, 3)).unwrap()).len()
    );

    // Most of where the jitter would lead is off the field.
    let corner = "{ place = [\"0.2 m\", \"0.2 m\"], jitter = \"1 m\" }";
    for seed in 1..50 {
        let scenario = parse(&format!("seed = {seed}\n{}", bulk(corner, 1))).unwrap();
        let at = places(&scenario)[0];
        assert!(
            (0.3048..=1.2).contains(&at.x) && (0.3048..=1.2).contains(&at.y),
            "{at:?}"
        );
    }
    let off = corner.replace("1 m", "0.05 m");
    let error = shown(&bulk(&off, 1));
    assert!(
        error.contains("too small, too full, or off the field"),
        "{error}"
    );
}

#[test]
fn what_else_is_in_a_scenario_changes_no_draw() {
    let text = |more: &str| {
        format!(
            "{}[[site]]\nname = \"T\"\ncount = 4\nat = \"random\"\n[[obstacle]]\nat = \"random\"\nradius = \"0.2 m\"\n\
             [[layer]]\nname = \"dust\"\ncell = \"1 m\"\npeaks = [{{ at = \"random\", radius = \"1 m\", height = 1 }}]\n{more}",
            bulk("\"random\"", 5)
        )
    };
    let plain = parse(&text("")).unwrap();
    for more in [
        "[[site]]\nname = \"U\"\nat = \"random\"\n",
        "[[layer]]\nname = \"mist\"\ncell = \"1 m\"\npeaks = [{ at = \"random\", radius = \"1 m\", height = 1 }]\n",
        "[guests]\ncount = 40\n",
        "[network]\ncommands = { loss = 0.5 }\n",
        "[[robot]]\nname = \"Z12\"\nat = \"random\"\n",
        "[sensing]\nmisses = 0.5\nrange = \"2 m\"\n",
    ] {
        let scenario = parse(&text(more)).unwrap();
        assert_eq!(places(&scenario)[..5], places(&plain)[..], "{more}");
        assert_eq!(scenario.obstacles, plain.obstacles, "{more}");
        assert_eq!(scenario.layers["dust"], plain.layers["dust"], "{more}");
        for (name, site) in &plain.sites {
            assert_eq!(scenario.sites[name].at, site.at, "{more}");
        }
    }
}

#[test]
fn a_record_says_of_all_places_where_they_were_drawn() {
    let text = format!(
        "{}[[site]]\nname = \"T\"\nat = \"random\"\n[[site]]\nname = \"U\"\nat = [\"1 m\", \"1 m\"]\n\
         [[obstacle]]\nat = [\"14 m\", \"14 m\"]\n[[obstacle]]\nat = {REGION}\nradius = \"0.2 m\"\n\
         [[layer]]\nname = \"dust\"\ncell = \"1 m\"\n\
         peaks = [{{ at = [\"1 m\", \"1 m\"], radius = \"1 m\", height = 1 }}, {{ at = \"random\", radius = \"1 m\", height = 1 }}]\n",
        bulk(CLUSTER, 2)
    );
    let scenario = parse(&text).unwrap();
    let written = scenario.to_toml().unwrap();
    let read = parse(&written).unwrap();
    assert_eq!(read.to_toml().unwrap(), written);
    assert_eq!(places(&read), places(&scenario));
    assert_eq!(read.sites, scenario.sites);
    assert_eq!(read.obstacles, scenario.obstacles);
    assert_eq!(read.layers, scenario.layers);

    let fresh = parse(&format!("seed = 5\n{text}")).unwrap();
    let other = read.with_seed(5).unwrap();
    assert_eq!(other.to_toml().unwrap(), fresh.to_toml().unwrap());
    assert_ne!(places(&other), places(&scenario));

    for (wrong, reason) in [
        ("[drawn.robot]\nX = \"random\"\n", "there is no robot X"),
        (
            "[drawn.obstacle]\n0 = \"random\"\n",
            "there is no obstacle 0",
        ),
        ("[drawn.layer.dust]\n3 = \"random\"\n", "there is no peak 3"),
        (
            "[drawn.site]\nT = [\"1 m\", \"1 m\"]\n",
            "the place of site T is no region",
        ),
    ] {
        let error = shown(&format!("{text}{wrong}"));
        assert!(error.contains(reason), "{error}");
    }
}
