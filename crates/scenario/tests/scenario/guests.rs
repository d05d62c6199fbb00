//! Recorded guests: formats of files, how they lie in the hall, errors with file, line and caret, and the record.

use std::fs;
use std::path::Path;

use config::{Changes, FileError, Source};
use scenario::{GuestMotion, Scenario, WantGoal};
use world::{Point, Track};

use super::source;

const ROBOT: &str = "[[robot]]\nname = \"A\"\nat = [\"8 m\", \"8 m\"]\n";
/// A hall of 10 m by 10 m.
const FIELD: &str = "[field]\nsize = [\"10 m\", \"10 m\"]\n";

/// Reads a scenario whose `[guests]` has these keys beside `from`, with this file.
fn load(file: &str, keys: &str) -> Result<Scenario, FileError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("people.txt"), file).unwrap();
    let text = format!("{FIELD}[guests]\nfrom = \"people.txt\"\n{keys}\n{ROBOT}");
    let path = folder.path().join("hall.toml");
    fs::write(&path, text).unwrap();
    Scenario::load(&path, &Changes::default())
}

fn parse(text: &str) -> Result<Scenario, FileError> {
    Scenario::parse_alone(&source(text))
}

/// What people are shown of an error.
fn shown(result: Result<Scenario, FileError>) -> String {
    match result {
        Ok(_) => panic!("this was not refused"),
        Err(error) => config::render_plain(&error, None, 200),
    }
}

fn tracks(scenario: &Scenario) -> &[Track] {
    &scenario.guest_motion.recorded().unwrap().tracks
}

/// Times in ms and places of a track.
fn points(track: &Track) -> Vec<(u64, f64, f64)> {
    let points = track.points().iter();
    points
        .map(|point| (point.at_us / 1000, point.at.x, point.at.y))
        .collect()
}

#[test]
fn all_formats_are_read_into_the_same_tracks() {
    let expected = [
        vec![(0, 1.0, 2.0), (400, 1.5, 2.25)],
        vec![(400, 4.0, 4.0), (800, 4.0, 5.0)],
    ];
    let ucy = "780\t1\t1.0\t2.0\n790\t1\t1.5\t2.25\n790\t2\t4\t4\n800\t2\t4\t5\n";
    // By person, not by frame, and with numbers as MATLAB writes them.
    let obsmat = "  7.8000000e+02   1.0000000e+00   1.0   0.0   2.0   0.1 0 0.1\n\
                  7.9000000e+02 1 1.5 0 2.25 0 0 0\n\
                  8.0000000e+02 2 4 0 5 0 0 0\n\
                  7.9000000e+02 2 4 0 4 0 0 0\n";
    let juelich = "# description: two people\n# framerate: 25.0 fps\n# id frame x/cm y/cm z/cm\n\
                   1 780 100 200 160\n1 790 150 225 160\n2 790 400 400 160\n2 800 400 500 160\n";
    let jupedsim = "#framerate: 25.00\n#id\tframe\tx/m\ty/m\n1\t780\t1\t2\n1\t790\t1.5\t2.25\n2\t790\t4\t4\n2\t800\t4\t5\n";
    for (text, keys) in [
        (ucy, "rate = 25"),
        (obsmat, "rate = 25.0"),
        (obsmat, "rate = 25.0\nformat = \"obsmat\""),
        (juelich, ""),
        (jupedsim, ""),
        (&ucy.replace('\t', ","), "rate = 25"),
    ] {
        let scenario = load(text, keys).unwrap();
        let read: Vec<_> = tracks(&scenario).iter().map(points).collect();
        assert_eq!(read, expected, "{text}");
        assert_eq!(scenario.guests.count, 2);
        let recorded = scenario.guest_motion.recorded().unwrap();
        assert_eq!(recorded.length_ms.get(), 1200);
        assert_eq!(recorded.catch_up_mps, 2.0);
        // They are no part of the hall that is placed.
        assert_eq!(scenario.hall().guests.count, 0);
    }
}

#[test]
fn a_record_is_scaled_then_turned_then_moved() {
    let text = "0 1 100 0\n1 1 200 0\n";
    let keys = "rate = 1\nunit = \"1 cm\"\nrotate = \"90 deg\"\noffset = [\"3 m\", \"2 m\"]";
    let scenario = load(text, keys).unwrap();
    assert_eq!(
        points(&tracks(&scenario)[0]),
        [(0, 3.0, 3.0), (1000, 3.0, 4.0)]
    );

    // What the scenario says counts more than what the file says.
    let text = "# framerate: 10\n# id frame x/cm y/cm\n1 0 100 0\n1 1 200 0\n";
    let scenario = load(
        text,
        "rate = 1\nunit = \"0.1 cm\"\noffset = [\"3 m\", \"2 m\"]",
    )
    .unwrap();
    assert_eq!(
        points(&tracks(&scenario)[0]),
        [(0, 3.1, 2.0), (1000, 3.2, 2.0)]
    );
}

#[test]
fn errors_of_a_file_have_its_name_the_line_and_a_caret() {
    let fine = "0 1 5 5\n10 1 5 6\n";
    for (text, keys, place, reason) in [
        (
            format!("{fine}20 1 5 six\n"),
            "rate = 25",
            ":3:8",
            "this is not a number",
        ),
        (
            format!("{fine}20 1 5\n"),
            "rate = 25",
            ":3:1",
            "3 columns, where the first observation has 4",
        ),
        (
            format!("{fine}20 -1 5 5\n"),
            "rate = 25",
            ":3:4",
            "whole numbers, 0 or more",
        ),
        (
            format!("{fine}20.5 1 5 5\n"),
            "rate = 25",
            ":3:1",
            "whole numbers, 0 or more",
        ),
        (
            format!("{fine}10 1 5 5\n"),
            "rate = 25",
            ":3:1",
            "person 1 is in frame 10 twice",
        ),
        (
            format!("{fine}20 1 inf 5\n"),
            "rate = 25",
            ":3:6",
            "this is not a number",
        ),
        (
            format!("{fine}20 1 1e7 5\n"),
            "rate = 25",
            ":3:1",
            "more than 1000 km",
        ),
        (fine.to_owned(), "", ":1:1", "set `rate` of [guests]"),
        (
            "0 1 5\n".to_owned(),
            "rate = 25",
            ":1:1",
            "3 columns: observations are",
        ),
        (
            fine.to_owned(),
            "rate = 25\nformat = \"obsmat\"",
            ":1:1",
            "4 columns, which is not the eight columns",
        ),
        (
            "# framerate: fast\n1 1 5 5\n".to_owned(),
            "",
            ":1:1",
            "a frame rate is a number above 0",
        ),
        (
            "# framerate: 1001\n1 1 5 5\n".to_owned(),
            "",
            ":1:1",
            "a frame rate is a number above 0, and at most 1000",
        ),
        (
            "# framerate: 25\n".to_owned(),
            "",
            ":1:1",
            "there is no observation",
        ),
    ] {
        let error = shown(load(&text, keys));
        assert!(error.contains(reason), "{error}");
        assert!(error.contains(&format!("people.txt{place}")), "{error}");
    }
    load("# framerate: 1000\n1 1 5 5\n1 2 5 5\n", "").unwrap();
}

#[test]
fn what_cannot_be_of_a_record_is_refused_in_the_scenario() {
    let fine = "0 1 5 5\n10 1 5 6\n";
    for (text, keys, reason) in [
        (fine, "rate = 0", "a frame rate is a number above 0"),
        (
            fine,
            "rate = 25\nunit = \"0 m\"",
            "a unit must be more than zero",
        ),
        (fine, "rate = 25\nstart = \"-1 s\"", "must be 0 or more"),
        (fine, "rate = 25\nstart = \"random\"", "set `loop = true`"),
        (fine, "rate = 25\nstart = \"soon\"", "is not a time"),
        (fine, "rate = 25\ncatch_up = \"0 m/s\"", "more than zero"),
        (fine, "rate = 25\nformat = \"vadere\"", "unknown variant"),
        (
            fine,
            "rate = 25\nstart = \"1 s\"",
            "none of these people is ever on the field",
        ),
        (
            fine,
            "rate = 25\noffset = [\"20 m\", \"0 m\"]",
            "they are from (25, 5) m to (25, 6) m",
        ),
        (fine, "rate = 0.000001", "more than a hundred days"),
    ] {
        let error = shown(load(text, keys));
        assert!(error.contains(reason), "{error}");
        assert!(
            error.contains("hall.toml") || error.contains("people.txt"),
            "{error}"
        );
    }
    // It begins again, so there is somebody.
    load(fine, "rate = 25\nstart = \"1 s\"\nloop = true").unwrap();

    let error = shown(parse(&format!("[guests]\nmodel = \"recorded\"\n{ROBOT}")));
    assert!(error.contains("set `from` to a file"), "{error}");
    let error = shown(parse(&format!(
        "[guests]\nspeed = {{ min = \"1 m/s\", mode = \"1 m/s\", max = \"1 m/s\" }}\n{ROBOT}"
    )));
    assert!(error.contains("missing field `count`"), "{error}");
    let error = shown(parse(&format!("[guests]\nfrom = \"people.txt\"\n{ROBOT}")));
    assert!(error.contains("names no record of guests"), "{error}");
    let error = shown(load(fine, "rate = 25").and_then(|_| {
        Scenario::parse(
            &Source {
                name: "hall.toml".into(),
                text: format!("[guests]\nfrom = \"none.txt\"\n{ROBOT}"),
            },
            Path::new("."),
        )
    }));
    assert!(error.contains("none.txt"), "{error}");
}

#[test]
fn a_start_that_is_drawn_stays_drawn_in_the_record() {
    let keys = "rate = 25\nstart = \"random\"\nloop = true";
    let scenario = load("0 1 5 5\n10 1 5 6\n", keys).unwrap();
    assert_eq!(scenario.guest_motion.recorded().unwrap().start_ms, None);
    let read = parse(&scenario.to_toml().unwrap()).unwrap();
    assert_eq!(read.guest_motion, scenario.guest_motion);
}

#[test]
fn a_random_model_reads_no_record() {
    let scenario = load(
        "not a file of trajectories",
        "count = 3\nmodel = \"random\"",
    )
    .unwrap();
    assert_eq!(scenario.guest_motion, GuestMotion::Random);
    assert_eq!(scenario.guests.count, 3);
}

#[test]
fn the_record_has_the_tracks_and_finds_that_they_were_changed() {
    let text = "0 1 5 5\n10 1 5.1234 6\n10 7 -3 2\n30 7 4 2\n";
    let keys = "rate = 25\nstart = \"0.4 s\"\nloop = true\ncatch_up = \"1 m/s\"";
    let scenario = load(text, keys).unwrap();
    let written = scenario.to_toml().unwrap();
    let read = parse(&written).unwrap();
    assert_eq!(read.guest_motion, scenario.guest_motion);
    assert_eq!(read.to_toml().unwrap(), written);
    // Millimeters.
    assert_eq!(points(&tracks(&read)[0])[1], (400, 5.123, 6.0), "{written}");
    assert_eq!(tracks(&read)[1].at(800_000), Some(Point::new(0.5, 2.0)));

    for changed in [
        written.replace("5000 5000", "5000 5001"),
        written.replace("length = \"1.6 s\"", "length = \"1.7 s\""),
    ] {
        assert_ne!(changed, written);
        let error = shown(parse(&changed));
        assert!(error.contains("not those that the run had"), "{error}");
    }
    let moved = written.replace(
        "model = \"recorded\"",
        "model = \"recorded\"\nunit = \"1 m\"",
    );
    let error = shown(parse(&moved));
    assert!(error.contains("in the hall already"), "{error}");
}

#[test]
fn texts_of_tracks_that_no_run_writes_are_refused() {
    let tracks = |people: &str| {
        let digest = "0".repeat(32);
        let text = format!(
            "{FIELD}[guests]\nmodel = \"recorded\"\n{ROBOT}[tracks]\ndigest = \"{digest}\"\nlength = \"9 s\"\npeople = [{people}]\n"
        );
        let error = shown(parse(&text));
        let found = error.split("their digest is ").nth(1).unwrap()[..32].to_owned();
        parse(&text.replace(&digest, &found))
    };
    assert!(tracks("\"0 5000 5000 400 1 0\"").is_ok());
    for (people, reason) in [
        ("\"\"", "a time and a place"),
        ("\"0 1\"", "a time and a place"),
        ("\"0 1 x\"", "is not a whole number"),
        ("\"0 1 1 0 1 1\"", "times of a track rise"),
        ("\"0 1 1 400 1 1 -400 1 1\"", "times of a track rise"),
        ("\"-1 5 5\"", "times of a track rise"),
        ("\"0 1000000001 5\"", "within 1000 km"),
        ("\"9223372036854775807 5 5\"", "times of a track rise"),
        ("", "none of these people is ever on the field"),
    ] {
        let error = shown(tracks(people));
        assert!(error.contains(reason), "{people}: {error}");
    }
}

/// The people of `configs/people/reception.txt`: a formula, so that no record of real people is in the project.
///
/// Person k of 120 comes at 3 k seconds by one of two doors, goes to three places in turn, stays at each, and leaves by the other
/// door. Places, times and speeds follow from the fractional parts of multiples of irrational numbers, which are spread evenly.
fn reception() -> String {
    const RATE_HZ: f64 = 10.0;
    const HEAD: &str = "\
# description: people at a reception, made by a formula: no record of real people
#   Person k = 0 ... 119 comes at 3 k s, at door k mod 2 of (14.9, 7.6) and (7.6, 14.9), and leaves by the other one. It walks
#   straight, at 0.6 + 0.7 frac(0.5698402910 k) m/s, to the places j = 0, 1, 2 at 1.8 + 12.8 frac(0.7548776662 k + 0.37 j) and
#   1.8 + 12.8 frac(0.5698402910 k + 0.73 j), and stays at each for 12 + 24 frac(0.7548776662 k + 0.61 j) s.
# framerate: 10 fps
# id frame x/m y/m
";
    let fraction = |number: f64| number - number.floor();
    let mut text = HEAD.to_owned();
    for k in 0..120_u32 {
        let number = f64::from(k);
        let doors = [(14.9, 7.6), (7.6, 14.9)];
        let speed_mps = 0.6 + 0.7 * fraction(0.569_840_291 * number);
        let mut time_s = 3.0 * number;
        let mut at: (f64, f64) = doors[k as usize % 2];
        let mut observe = |time_s: f64, at: (f64, f64)| {
            let frame = (time_s * RATE_HZ).round();
            text += &format!("{k} {frame} {:.2} {:.2}\n", at.0, at.1);
        };

        observe(time_s, at);
        for j in 0..=3 {
            let step = f64::from(j);
            let to = match j {
                3 => doors[(k as usize + 1) % 2],
                _ => (
                    1.8 + 12.8 * fraction(0.754_877_666_2 * number + 0.37 * step),
                    1.8 + 12.8 * fraction(0.569_840_291 * number + 0.73 * step),
                ),
            };
            let (x, y) = (to.0 - at.0, to.1 - at.1);
            time_s += (x * x + y * y).sqrt() / speed_mps;
            observe(time_s, to);
            if j < 3 {
                time_s += 12.0 + 24.0 * fraction(0.754_877_666_2 * number + 0.61 * step);
                observe(time_s, to);
            }
            at = to;
        }
    }
    text
}

#[test]
fn the_record_that_is_shipped_is_that_of_its_formula() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = root.join("configs/people/reception.txt");
    if std::env::var_os("CARS_UPDATE").is_some() {
        fs::write(&path, reception()).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap(), reception());

    let scenario = Scenario::load(
        &root.join("configs/recorded_hall.toml"),
        &Changes::default(),
    );
    let scenario = scenario.unwrap();
    assert_eq!(tracks(&scenario).len(), 120);
    // How many are there at once.
    let present = |time_s: u64| {
        let tracks = tracks(&scenario).iter();
        tracks
            .filter_map(|track| track.at(time_s * 1_000_000))
            .count()
    };
    assert_eq!(present(0), 1);
    assert!((25..60).contains(&present(150)), "{}", present(150));
}

#[test]
fn models_of_walking_are_written_and_read() {
    for model in ["collision-free", "social-force"] {
        let text = format!("[guests]\ncount = 5\nmodel = \"{model}\"\n{ROBOT}");
        let scenario = parse(&text).unwrap();
        assert_eq!(scenario.guests.count, 5);
        assert_eq!(scenario.hall().guests.count, 5);
        let written = scenario.to_toml().unwrap();
        assert!(
            written.contains(&format!("model = \"{model}\"")),
            "{written}"
        );
        assert_eq!(parse(&written).unwrap().guest_motion, scenario.guest_motion);
    }
    let error = shown(parse(&format!(
        "[guests]\ncount = 5\nmodel = \"boids\"\n{ROBOT}"
    )));
    assert!(error.contains("unknown variant"), "{error}");

    let large = format!(
        "[field]\nsize = [\"40 m\", \"40 m\"]\nbody = \"2 m\"\n[guests]\ncount = 5\nmodel = \"social-force\"\n{ROBOT}"
    );
    let error = shown(parse(&large));
    assert!(
        error.contains("the size in meters of bodies, [field] body"),
        "{error}"
    );
}

#[test]
fn what_guests_want_is_written_and_read() {
    let text = format!(
        "[guests]\ncount = 5\n\
         wants = [{{ site = \"bar\", weight = 2 }}, {{ at = [\"3 m\", \"4 m\"], within = \"2 m\", stay = {{ min = \"1 s\", mode = \"2 s\", max = \"3 s\" }} }}, \
         {{ exit = [\"0 m\", \"7 m\"], give_up = \"30 s\" }}, {{ treat = \"A\" }}]\n\
         [guests.requests]\n[[site]]\nname = \"bar\"\nat = [\"9 m\", \"9 m\"]\n{ROBOT}"
    );
    let scenario = parse(&text).unwrap();
    let GuestMotion::Crowd(guests) = &scenario.guest_motion else {
        panic!("{:?}", scenario.guest_motion);
    };
    assert_eq!(guests.wants.len(), 4);
    assert_eq!(guests.wants[0].goal, WantGoal::Site("bar".to_owned()));
    assert_eq!(guests.wants[2].stay_s, None);
    assert_eq!(guests.wants[2].give_up, 60);
    let written = scenario.to_toml().unwrap();
    let read = parse(&written).unwrap();
    assert_eq!(read.guest_motion, scenario.guest_motion, "{written}");
    assert_eq!(read.to_toml().unwrap(), written);

    // In the environment bodies are within the edge.
    let world::GuestWalk::Crowd(walk) = scenario.guest_walk() else {
        panic!("they walk by a model");
    };
    assert_eq!(
        walk.wants[0].goal,
        world::WantTarget::Place(Point::new(9.0, 9.0))
    );
    assert_eq!(
        walk.wants[2].goal,
        world::WantTarget::Exit(Point::new(0.3048, 7.0))
    );
    assert_eq!(walk.wants[3].goal, world::WantTarget::Robot(0));
}

#[test]
fn what_guests_cannot_want_is_refused() {
    let of = |want: &str| {
        let text = format!("[guests]\ncount = 5\nwants = [{{ {want} }}]\n{ROBOT}");
        shown(parse(&text))
    };
    for (want, reason) in [
        ("weight = 1", "has exactly one of these"),
        ("site = \"bar\", treat = \"A\"", "has exactly one of these"),
        ("site = \"bar\"", "there is no [[site]] called \"bar\""),
        ("treat = \"B\"", "there is no robot called B"),
        ("treat = \"A\"", "add that table"),
        ("at = [\"3 m\", \"99 m\"]", "not on the field"),
        (
            "exit = [\"1 m\", \"1 m\"], weight = 0",
            "a weight must be more than zero",
        ),
        (
            "exit = [\"1 m\", \"1 m\"], weight = 1e7",
            "a weight is at most",
        ),
        (
            "exit = [\"1 m\", \"1 m\"], within = \"0 m\"",
            "more than zero",
        ),
        ("exit = [\"1 m\", \"1 m\"], color = 1", "unknown field"),
    ] {
        let error = of(want);
        assert!(error.contains(reason), "{want}: {error}");
    }

    let many = vec!["{ at = [\"3 m\", \"3 m\"] }"; 65].join(", ");
    let error = shown(parse(&format!(
        "[guests]\ncount = 5\nwants = [{many}]\n{ROBOT}"
    )));
    assert!(error.contains("more than 64 things to want"), "{error}");

    let random = "[guests]\ncount = 5\nmodel = \"random\"\nwants = [{ at = [\"3 m\", \"3 m\"] }]\n";
    let error = shown(parse(&format!("{random}{ROBOT}")));
    assert!(error.contains("walk by a model"), "{error}");

    let stay = "stay = { min = \"1 s\", mode = \"2 s\", max = \"3 s\" }";
    let text = format!(
        "[guests]\ncount = 5\nwants = [{{ treat = \"A\", {stay} }}]\n[guests.requests]\n{ROBOT}"
    );
    let error = shown(parse(&text));
    assert!(error.contains("waits at the robot"), "{error}");
}
