//! What a robot senses of what is within range: where it looks, what walls hide, what it misses, and where it errs.

use std::f64::consts::TAU;
use std::fmt::Arguments;

use protocol::RobotName;
use protocol::Tick;
use protocol::random::{stream, unit};
use scenario::{Scenario, Sensing};
use world::{Opaque, Point, World, is_hidden};

/// Ranges are sensed in steps of 0.1 mm, so that they are short in messages.
const RANGE_STEPS_PER_M: f64 = 10_000.0;

/// A robot that looks around in a tick.
pub(crate) struct Viewpoint<'a> {
    sensing: &'a Sensing,
    seed: u64,
    tick: Tick,
    robot: &'a RobotName,
    at: Point,
    /// Where it looks, radians.
    heading_rad: f64,
    /// What may hide something from it; obstacles by index.
    opaque: Vec<(Option<usize>, Opaque)>,
}

impl<'a> Viewpoint<'a> {
    /// A robot at a place. Nothing that it senses is farther away than `reach_m`.
    pub(crate) fn new<R>(
        scenario: &'a Scenario,
        world: &World<R>,
        tick: Tick,
        robot: &'a RobotName,
        at: Point,
        heading_rad: f64,
        reach_m: f64,
    ) -> Self {
        let sensing = &scenario.sensing;
        let opaque = if sensing.walls_hide {
            world.opaque_near(at, reach_m)
        } else {
            Vec::new()
        };
        Self {
            sensing,
            seed: scenario.sensing_seed(tick),
            tick,
            robot,
            at,
            heading_rad,
            opaque,
        }
    }

    /// Where it senses something that is within range; `None` if it does not. `what` is unique among all that is sensed. An
    /// obstacle does not hide itself.
    pub(crate) fn senses(
        &self,
        what: Arguments<'_>,
        at: Point,
        obstacle: Option<usize>,
    ) -> Option<Point> {
        let all = self.opaque.iter();
        let others = all.filter(|(index, _)| index.is_none() || *index != obstacle);
        let others = others.map(|(_, opaque)| opaque);
        if !self.looks_at(at) || is_hidden(self.at, at, others) {
            return None;
        }
        if self.sensing.misses == 0.0 && self.sensing.noise_m == 0.0 {
            return Some(at);
        }

        // A stream for each tick, robot and thing: none changes what another one draws.
        let name = format!("sensing/{}/{}/{what}", self.tick, self.robot);
        let mut stream = stream(self.seed, &name);
        if unit(&mut stream) < self.sensing.misses {
            return None;
        }
        // The sum of two uniform numbers is triangular.
        let mut error_m = || (unit(&mut stream) + unit(&mut stream) - 1.0) * self.sensing.noise_m;
        let x = at.x + error_m();
        let y = at.y + error_m();
        Some(Point::new(x, y))
    }

    /// Whether a place is within its field of view.
    fn looks_at(&self, at: Point) -> bool {
        let Some(field_rad) = self.sensing.field_of_view_rad else {
            return true;
        };
        // Rounding would hide some of what is exactly behind it.
        if field_rad >= TAU {
            return true;
        }
        let offset = at - self.at;
        let distance_m = offset.length();
        let ahead = direction(self.heading_rad);
        let forward_m = offset.x * ahead.x + offset.y * ahead.y;
        forward_m >= libm::cos(field_rad * 0.5) * distance_m
    }
}

/// The ranges of a robot's rays, meters.
pub(crate) fn ranges_m<R>(
    sensing: &Sensing,
    world: &World<R>,
    robot: usize,
    heading_rad: f64,
) -> Vec<f64> {
    let Some(rays) = sensing.rays else {
        return Vec::new();
    };

    let mut directions = Vec::new();
    for index in 0..rays.count as usize {
        directions.push(direction(heading_rad + rays.bearing_rad(index)));
    }
    let mut ranges = world.ranges_m(robot, &directions, rays.range_m);
    for range_m in &mut ranges {
        // A ray that meets nothing is as long as the scenario says, so that robots can tell.
        if *range_m < rays.range_m {
            let rounded_m = (*range_m * RANGE_STEPS_PER_M + 0.5).floor() / RANGE_STEPS_PER_M;
            *range_m = rounded_m.min(rays.range_m);
        }
    }
    ranges
}

fn direction(angle_rad: f64) -> Point {
    Point::new(libm::cos(angle_rad), libm::sin(angle_rad))
}
