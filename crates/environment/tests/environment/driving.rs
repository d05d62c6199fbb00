//! Robots that drive like wheels: what they are told, what stops them, and what does not count.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

use environment::{Event, Simulation, TickRecord};
use lockstep::{Bulletin, Exchange, IncarnationNotice, TickOutcome};
use protocol::Tick;
use protocol::event::Blocker;
use protocol::messages::{CommandText, Point, Pose, Report, TickUpdate, Velocity};

use crate::common::{name, report, scenario};

/// Robots A and B that propose what a closure says, and the news of A. `None` is a tick without a report.
struct Robots<F> {
    act: F,
    news: Vec<TickUpdate>,
}

impl<F: FnMut(&str, Tick, &mut Report) -> bool> Exchange<TickUpdate, Arc<Report>, CommandText>
    for Robots<F>
{
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: Tick,
        bulletin: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        let mut outcome = TickOutcome::default();
        for robot in ["A", "B"] {
            let name = name(robot);
            let news = bulletin.compose(&name, IncarnationNotice::default());
            let here = news.pose.map_or(B_AT, |pose| pose.location);
            if robot == "A" {
                self.news.push(news);
            }
            let mut report = report(tick, here);
            if (self.act)(robot, tick, &mut report) {
                outcome.reports.insert(name, (Arc::new(report), Vec::new()));
            }
        }
        Ok(outcome)
    }
}

/// Where B stands, which does not drive.
const B_AT: Point = Point { x: 8.0, y: 2.0 };

/// A hall with a wall at x = 5 m, toward which A looks.
fn hall(drive: &str) -> String {
    format!(
        "tick = \"0.5 s\"\n[field]\nmax_speed = \"1 m/s\"\n[sensing]\nrange = \"9 m\"\nfield_of_view = \"80 deg\"\n\
         [[wall]]\npoints = [[\"5 m\", \"0 m\"], [\"5 m\", \"9 m\"]]\n\
         [[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\nsize = [\"0.8 m\", \"0.4 m\"]\ndrive = {drive}\n\
         [[robot]]\nname = \"B\"\nat = [\"8 m\", \"2 m\"]\n"
    )
}

const LIMITS: &str = "{ max_turn = \"90 deg/s\", max_acceleration = \"0.5 m/s2\" }";

fn velocity(linear_mps: f64, angular_radps: f64) -> Option<Velocity> {
    Some(Velocity {
        linear_mps,
        angular_radps,
    })
}

/// Plays some ticks. The closure sets what a robot reports in a tick, and returns whether it reports.
fn play(
    text: &str,
    ticks: Tick,
    act: impl FnMut(&str, Tick, &mut Report) -> bool,
) -> (Simulation, Vec<TickUpdate>, Vec<TickRecord>) {
    let mut simulation = Simulation::new(scenario(text), 1).unwrap();
    let mut robots = Robots {
        act,
        news: Vec::new(),
    };
    let mut records = vec![simulation.init(&mut robots).unwrap()];
    for _ in 0..ticks {
        records.push(simulation.step(&mut robots).unwrap());
    }
    (simulation, robots.news, records)
}

/// A drives as a closure says in each tick, and B stays.
fn drive(
    ticks: Tick,
    wanted: impl Fn(Tick) -> Option<Velocity>,
) -> (Simulation, Vec<Pose>, Vec<TickRecord>) {
    let (simulation, news, records) = play(&hall(LIMITS), ticks, |robot, tick, report| {
        if robot == "A" {
            report.velocity = wanted(tick);
        }
        true
    });
    let poses = news.iter().map(|news| news.pose.unwrap());
    (simulation, poses.collect(), records)
}

fn warnings(records: &[TickRecord]) -> Vec<(String, String)> {
    let events = records.iter().flat_map(|record| record.events.iter());
    let warned = events.filter_map(|event| match event {
        Event::Warned { robot, text } => Some((robot.to_string(), text.clone())),
        _ => None,
    });
    warned.collect()
}

#[test]
fn a_robot_is_told_its_pose_in_every_tick_and_moves_within_its_limits() {
    let (simulation, poses, records) = drive(5, |_| velocity(5.0, 0.0));
    let speeds_mps: Vec<f64> = poses.iter().map(|pose| pose.velocity.linear_mps).collect();
    assert_eq!(speeds_mps, [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]);
    // Half of 0.5 m/s² times the square of 2 s, and half a second at 1 m/s.
    assert_eq!(poses[4].location, Point::new(3.0, 2.0));
    assert_eq!(poses[5].location, Point::new(3.5, 2.0));
    assert_eq!(simulation.location(&name("A")), Some(poses[5].location));
    assert_eq!(simulation.pose(&name("A")), Some(poses[5]));
    assert_eq!(simulation.pose(&name("B")), None);

    let (simulation, poses, _) = drive(3, |_| velocity(0.0, 9.0));
    let headings_rad: Vec<f64> = poses.iter().map(|pose| pose.heading_rad).collect();
    let eighths_of_a_turn = [0.0, 1.0, 2.0, 3.0].map(|n| (n * FRAC_PI_4 * 1e6).round() / 1e6);
    assert_eq!(headings_rad, eighths_of_a_turn);
    let frame = environment::recorded::frame(&simulation, &records[3]);
    let headings = frame.robots.iter().map(|robot| robot.heading_rad);
    assert_eq!(headings.collect::<Vec<_>>(), [Some(2.356_194), None]);
}

#[test]
fn a_wall_stops_it_and_it_starts_again_within_its_limits() {
    let (_, poses, records) = drive(20, |tick| velocity(if tick < 10 { 5.0 } else { -5.0 }, 0.0));
    let blocked_at = records.iter().position(|record| {
        record.events.iter().any(|event| {
            matches!(
                event,
                Event::Blocked {
                    by: Blocker::Wall,
                    ..
                }
            )
        })
    });
    let stopped = poses[blocked_at.unwrap()];
    assert_eq!(stopped.velocity, Velocity::default());
    assert!((4.0..=4.6).contains(&stopped.location.x), "{stopped:?}");
    for pose in &poses {
        assert!(
            pose.location.x <= 4.6 && pose.velocity.linear_mps.abs() <= 1.0,
            "{pose:?}"
        );
    }
    assert!(poses[20].location.x < 3.0, "{:?}", poses[20]);
}

#[test]
fn it_looks_where_its_heading_is_and_not_where_it_reports() {
    let sees_b = |turn_radps: f64| {
        let (_, news, _) = play(&hall(LIMITS), 2, |robot, _, report| {
            if robot == "A" {
                report.velocity = velocity(0.0, turn_radps);
                report.direction_rad = 1.5;
            }
            true
        });
        news.iter()
            .map(|news| !news.sensed.is_empty())
            .collect::<Vec<_>>()
    };
    assert_eq!(sees_b(0.0), [true, true, true]);
    // Half of the field of view is 40 deg, and it turns by 45 deg in a tick.
    assert_eq!(sees_b(2.0), [true, false, false]);
}

#[test]
fn without_a_report_or_a_velocity_it_brakes() {
    for is_silent in [true, false] {
        let (_, news, records) = play(&hall(LIMITS), 8, |robot, tick, report| {
            if robot == "A" && tick < 3 {
                report.velocity = velocity(1.0, 0.0);
            }
            !(is_silent && robot == "A" && tick >= 3)
        });
        let speeds_mps = news
            .iter()
            .map(|news| news.pose.unwrap().velocity.linear_mps);
        let expected = [0.0, 0.25, 0.5, 0.75, 0.5, 0.25, 0.0, 0.0, 0.0];
        assert_eq!(speeds_mps.collect::<Vec<_>>(), expected, "{is_silent}");
        assert_eq!(warnings(&records), []);
        // To 0.75 m/s and back at 0.5 m/s²: its square over that.
        let stopped = news[8].pose.unwrap().location.x;
        assert!((stopped - 2.0 - 0.5625 / 0.5).abs() < 1e-12, "{stopped}");
    }
}

#[test]
fn what_does_not_count_is_ignored_and_warned_of_once() {
    let (simulation, _, records) = play(&hall(LIMITS), 4, |robot, tick, report| {
        match robot {
            "A" => report.proposal = Point::new(2.1, 2.0),
            _ => {
                report.velocity = velocity(1.0, 0.0);
                report.proposal = Point::new(8.0, 2.0 + 0.1 * tick.min(1) as f64);
            }
        }
        true
    });
    assert_eq!(simulation.location(&name("A")), Some(Point::new(2.0, 2.0)));
    assert_eq!(simulation.location(&name("B")), Some(Point::new(8.0, 2.1)));
    let warned: BTreeMap<String, String> = warnings(&records).into_iter().collect();
    assert_eq!(warnings(&records).len(), 2);
    assert!(
        warned["A"].contains("must propose a velocity"),
        "{warned:?}"
    );
    assert!(warned["B"].contains("no `drive`"), "{warned:?}");

    // A velocity beside a place is no mistake of a robot that drives.
    let (_, _, records) = play(&hall(LIMITS), 2, |robot, _, report| {
        if robot == "A" {
            report.velocity = velocity(0.1, 0.0);
            report.proposal = Point::new(9.0, 9.0);
        }
        true
    });
    assert_eq!(warnings(&records), []);
}

#[test]
fn velocities_and_headings_are_part_of_what_runs_are_compared_by() {
    let digest = |angular_radps: f64| drive(3, |_| velocity(0.0, angular_radps)).0.digest();
    assert_eq!(digest(0.5), digest(0.5));
    assert_ne!(digest(0.5), digest(0.6));
    // Beyond the limit the motion is the same, and the report is not.
    assert_ne!(digest(2.0), digest(3.0));
}
