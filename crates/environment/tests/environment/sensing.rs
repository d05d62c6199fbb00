//! Sensing: field of view, walls that hide, misses, noise, and rays.

use environment::Simulation;
use protocol::messages::{Point, SensedKind, TickUpdate};
use scenario::Scenario;
use scenario::diagnostic::FileError;

use crate::actors::Actors;
use crate::common::parse;

/// A at 2 m, 2 m looks around; B is 2 m to its right, behind an obstacle; C is 2 m above it; a site is at C.
const FILE: &str = r#"
duration = "1000 s"
[field]
size = ["10 m", "10 m"]
body = "0.5 m"
[[obstacle]]
at = ["3 m", "2 m"]
[[robot]]
name = "A"
at = ["2 m", "2 m"]
[[robot]]
name = "B"
at = ["4 m", "2 m"]
[[robot]]
name = "C"
at = ["2 m", "4 m"]
[[site]]
name = "T"
at = ["2 m", "4 m"]
[sensing]
range = "3 m"
"#;

fn scenario(sensing: &str) -> Result<Scenario, FileError> {
    parse(&format!("{FILE}{sensing}\n"))
}

/// The news of A in ticks 0 to `ticks`, while it looks in a direction.
fn news(sensing: &str, heading_rad: f64, ticks: usize) -> Vec<TickUpdate> {
    news_of(&format!("{FILE}{sensing}\n"), heading_rad, ticks)
}

/// The same of another file.
fn news_of(file: &str, heading_rad: f64, ticks: usize) -> Vec<TickUpdate> {
    played(file, heading_rad, ticks).1
}

/// The same, and the simulation after them.
fn played(file: &str, heading_rad: f64, ticks: usize) -> (Simulation, Vec<TickUpdate>) {
    let mut simulation = Simulation::new(parse(file).unwrap(), 1).unwrap();
    let names = simulation.names().to_vec();
    let a = names[0].clone();
    simulation.list_bodies(&a, true);
    simulation.list_ranges(&a, true);
    let mut watchers = Actors::of(&simulation, |report, headings: Vec<f64>| {
        report.direction_rad = headings[0];
    });
    for tick in 0..=ticks as u64 {
        for name in &names {
            watchers
                .actions
                .insert((tick, name.clone()), vec![heading_rad]);
        }
    }
    simulation.init(&mut watchers).unwrap();
    for _ in 0..ticks {
        simulation.step(&mut watchers).unwrap();
    }
    let news = watchers.news.into_iter();
    let news = news.map(|mut news| news.remove(&a).unwrap_or_default());
    (simulation, news.collect())
}

/// The names of robots and sites that A senses, and how many obstacles.
fn seen(news: &TickUpdate) -> String {
    let mut seen = String::new();
    for robot in &news.sensed {
        seen += robot.name.as_str();
    }
    for site in &news.sites {
        seen += &site.name;
    }
    let obstacles = news.bodies.iter();
    let obstacles = obstacles.filter(|body| body.kind == SensedKind::Obstacle);
    format!("{seen}{}", obstacles.count())
}

#[test]
fn a_robot_senses_where_it_looks_and_what_no_wall_hides() {
    const UP: f64 = std::f64::consts::FRAC_PI_2;
    for (sensing, heading_rad, expected) in [
        ("", 0.0, "BCT1"),
        ("walls_hide = true", 0.0, "CT1"),
        ("field_of_view = \"120 deg\"", 0.0, "B1"),
        ("field_of_view = \"120 deg\"", UP, "CT0"),
        ("field_of_view = \"120 deg\"", -UP, "0"),
        // 90 deg to the side is within 181 deg, and not within 179 deg.
        ("field_of_view = \"181 deg\"", 0.0, "BCT1"),
        ("field_of_view = \"179 deg\"", 0.0, "B1"),
        ("field_of_view = \"360 deg\"", 2.0, "BCT1"),
        ("field_of_view = \"120 deg\"\nwalls_hide = true", 0.0, "1"),
        ("misses = 1.0", 0.0, "0"),
    ] {
        let news = news(sensing, heading_rad, 1);
        assert_eq!(seen(&news[1]), expected, "{sensing}, {heading_rad}");
    }
}

#[test]
fn misses_come_as_often_as_they_should_and_noise_stays_within_its_bounds() {
    const TICKS: usize = 2000;
    let all = news("misses = 0.25\nnoise = \"0.2 m\"", 0.0, TICKS);
    let mut errors_m = Vec::new();
    for news in &all[1..] {
        // What is sensed twice is missed twice, and at the same place.
        let bodies = news.bodies.iter();
        let robots = bodies.filter(|body| body.kind == SensedKind::Robot);
        let places: Vec<Point> = robots.map(|body| body.location).collect();
        let sensed: Vec<Point> = news.sensed.iter().map(|robot| robot.location).collect();
        assert_eq!(places, sensed);
        for robot in news
            .sensed
            .iter()
            .filter(|robot| robot.name.as_str() == "B")
        {
            errors_m.push(robot.location.x - 4.0);
            assert!((robot.location.y - 2.0).abs() <= 0.2);
        }
    }

    // Binomial: 1500 with a standard deviation of 19; five of them.
    assert!((1403..1597).contains(&errors_m.len()), "{}", errors_m.len());
    assert!(errors_m.iter().all(|error_m| error_m.abs() <= 0.2));
    let count = errors_m.len() as f64;
    let mean = errors_m.iter().sum::<f64>() / count;
    let square = errors_m
        .iter()
        .map(|error_m| error_m * error_m)
        .sum::<f64>()
        / count;
    // A triangular distribution on -0.2 to 0.2 has the variance 0.04 / 6.
    assert!(mean.abs() < 0.011, "{mean}");
    assert!((square / (0.04 / 6.0) - 1.0).abs() < 0.15, "{square}");
    assert_eq!(
        all,
        news("misses = 0.25\nnoise = \"0.2 m\"", 0.0, TICKS),
        "by the seed"
    );
}

#[test]
fn one_more_robot_changes_no_other_ones_chance() {
    let sensing = "misses = 0.5\nnoise = \"0.1 m\"";
    let more = format!("{sensing}\n[[robot]]\nname = \"Aa\"\nat = [\"3 m\", \"3 m\"]");
    for (few, many) in news(sensing, 0.0, 50).iter().zip(news(&more, 0.0, 50)) {
        let others = many.sensed.into_iter();
        let others: Vec<_> = others.filter(|robot| robot.name.as_str() != "Aa").collect();
        assert_eq!(few.sensed, others);
        assert_eq!(few.sites, many.sites);
    }
}

#[test]
fn rays_begin_in_the_direction_of_motion_and_go_counter_clockwise() {
    let rays = "rays = { count = 4, range = \"5 m\" }";
    // To the right: the obstacle's face at 2.75 m. Up: the face of C at 3.75 m. Then the edges.
    let ahead = news(rays, 0.0, 1);
    assert_eq!(ahead[1].ranges, [0.75, 1.75, 2.0, 2.0]);
    let turned = news(rays, std::f64::consts::FRAC_PI_2, 1);
    assert_eq!(turned[1].ranges, [1.75, 2.0, 2.0, 0.75]);
    let short = news("rays = { count = 4, range = \"1 m\" }", 0.0, 1);
    assert_eq!(short[1].ranges, [0.75, 1.0, 1.0, 1.0]);
    assert!(news("", 0.0, 1)[1].ranges.is_empty());
}

#[test]
fn rules_of_sensing_are_kept_and_checked() {
    let text = "field_of_view = \"120 deg\"\nwalls_hide = true\nmisses = 0.1\nnoise = \"0.1 m\"\nrays = { count = 720 }";
    let first = scenario(text).unwrap();
    assert_eq!(first.sensing.rays.unwrap().range_m, 3.0);
    let again = parse(&first.to_toml().unwrap()).unwrap();
    assert_eq!(again.sensing, first.sensing);
    // What is not used is not written: the records of older scenarios keep their bytes.
    let plain = scenario("").unwrap().to_toml().unwrap();
    assert!(!plain.contains("walls_hide") && !plain.contains("rays"));

    for (wrong, reason) in [
        ("field_of_view = \"0 deg\"", "more than 0"),
        ("field_of_view = \"361 deg\"", "at most 360 deg"),
        ("field_of_view = 120", "an angle such as"),
        ("misses = 1.5", "between 0 and 1"),
        ("misses = nan", "between 0 and 1"),
        ("noise = \"-1 m\"", "less than 0 m"),
        ("rays = { count = 721 }", "more than 720 rays"),
        ("rays = { count = 0 }", "more than zero"),
    ] {
        let error = scenario(wrong).unwrap_err();
        let shown = config::render_plain(&error, None, 200);
        assert!(shown.contains(reason), "{shown}");
    }
}

#[test]
fn a_field_of_view_all_around_has_what_is_exactly_behind() {
    // B is 2 m to the right of A, which looks to the left of it by angles whose sine and cosine are rounded.
    for step in 0..2000 {
        let angle_rad = 0.001 * f64::from(step);
        let behind = Point::new(
            5.0 - 2.0 * libm::cos(angle_rad),
            5.0 - 2.0 * libm::sin(angle_rad),
        );
        let text = format!(
            "duration = \"10 s\"\n[field]\nsize = [\"10 m\", \"10 m\"]\nbody = \"0.5 m\"\n\
             [[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\ndrive = {{ heading = \"{angle_rad} rad\" }}\n\
             [[robot]]\nname = \"B\"\nat = [\"{} m\", \"{} m\"]\n\
             [sensing]\nrange = \"3 m\"\nfield_of_view = \"360 deg\"\n",
            behind.x, behind.y
        );
        let news = news_of(&text, 0.0, 0);
        assert_eq!(news[0].sensed.len(), 1, "{angle_rad} rad");
    }
}

#[test]
fn a_ray_that_meets_nothing_is_as_long_as_the_rays() {
    // Not a whole number of steps of 0.1 mm, above and below the next one.
    for range in ["1.00004 m", "1.00006 m", "0.33333333 m", "3.3 ft", "1 m"] {
        let news = news(
            &format!("rays = {{ count = 4, range = \"{range}\" }}"),
            0.0,
            1,
        );
        let range_m = scenario(&format!("rays = {{ range = \"{range}\" }}")).unwrap();
        let range_m = range_m.sensing.rays.unwrap().range_m;
        // The first ray ends at the obstacle, 0.75 m ahead; the third and the fourth meet nothing.
        let ranges = &news[1].ranges;
        assert_eq!(ranges[0], range_m.min(0.75), "{range}");
        assert_eq!(ranges[2..], [range_m; 2], "{range}");
    }
}

/// Guests on a field with room for one on each square meter.
fn many_guests(count: usize, model: &str) -> String {
    let side_m = (count as f64).sqrt();
    let middle_m = side_m / 2.0;
    format!(
        "duration = \"10 s\"\ntick = \"0.1 s\"\n[field]\nsize = [\"{side_m} m\", \"{side_m} m\"]\nbody = \"0.4 m\"\n\
         [guests]\ncount = {count}\nmodel = \"{model}\"\n[sensing]\nrange = \"5 m\"\n\
         [[robot]]\nname = \"A\"\nat = [\"{middle_m} m\", \"{middle_m} m\"]\n"
    )
}

/// A robot senses all guests around it, and frames have so many of all.
fn check_many_guests(count: usize, model: &str, shown: usize, step: u32) {
    let (simulation, news) = played(&many_guests(count, model), 0.0, 2);
    let world = simulation.world();
    let near = world.near(world.robots()[0], 5.0).into_iter();
    let near = near.filter(|near| matches!(near.body, world::Body::Guest(_)));
    let near: Vec<Point> = near.map(|near| scenario::to_wire(near.center)).collect();
    let bodies = news[2].bodies.iter();
    let sensed: Vec<Point> = bodies.map(|body| body.location).collect();
    assert_eq!(sensed, near);
    assert!(sensed.len() > 40, "{}", sensed.len());

    assert_eq!(simulation.shown_guests().count(), shown);
    let numbers = simulation.guest_numbers();
    assert_eq!(numbers.get(1).copied().unwrap_or(1), step);
    assert!(numbers.is_empty() || numbers.len() == shown);
    assert!(
        simulation
            .shown_guests()
            .all(|(guest, at)| world.guests()[guest] == at)
    );
}

#[test]
fn frames_have_a_sample_of_very_many_guests() {
    check_many_guests(20_000, "random", 20_000, 1);
    check_many_guests(20_001, "random", 10_001, 2);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_robot_among_a_million_guests_senses_those_around_it() {
    for model in ["random", "collision-free"] {
        check_many_guests(1_000_000, model, 20_000, 50);
    }
}
