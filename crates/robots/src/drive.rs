//! How a robot moves: a random walk, straight drives around bodies in the way, standing still.
//!
//! Locations are computed with + - * / and square roots only, which give the same result on every machine and in every
//! language; a heading is a unit vector and never an angle. The paper leaves open what a robot does about a collision;
//! the ways here are chosen \[I\].

use robot::{Action, Cars, Point, SensedBody};
use serde::{Deserialize, Serialize};

use crate::chance::Chance;

/// Cosine and sine of the headings tried around the straight one, 20 to 120 degrees \[I\].
const OFFSETS: [(f64, f64); 6] = [
    (0.939_692_620_785_908_4, 0.342_020_143_325_668_7),
    (0.766_044_443_118_978, 0.642_787_609_686_539_3),
    (0.5, 0.866_025_403_784_438_6),
    (0.173_648_177_666_930_41, 0.984_807_753_012_208),
    (-0.173_648_177_666_930_41, 0.984_807_753_012_208),
    (-0.5, 0.866_025_403_784_438_6),
];

/// Shares of a step that are tried, the longest first \[I\].
const SHARES: [f64; 2] = [1.0, 0.5];

/// How deep two bodies may overlap and still count as touching, meters; as in the simulator's collision rule.
const TOUCH_M: f64 = 1e-9;

/// Time for which a robot looks around before each step after it was blocked, seconds \[I\].
pub const LOOK_S: f64 = 2.0;

/// New headings tried in a tick of a random walk before the robot stays where it is \[I\].
const WALK_TRIES: u32 = 8;

/// A robot's drive: its heading, and how it got past the last obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    heading: (f64, f64),
    /// The side on which it last found a way: 1 for left, -1 for right.
    side: f64,
    /// Time for which it still looks around before each step, seconds.
    careful_s: f64,
    /// Time until the random walk turns, seconds.
    turn_s: f64,
}

impl Default for Drive {
    fn default() -> Self {
        Self {
            heading: (1.0, 0.0),
            side: 1.0,
            careful_s: 0.0,
            turn_s: 0.0,
        }
    }
}

/// A straight drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StraightDrive {
    /// Where to, meters.
    pub goal: Point,
    /// Distance from the goal at which the drive stops, meters.
    pub stop_m: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Time for which the robot looks around before each step after it was blocked, seconds.
    pub look_s: f64,
}

impl StraightDrive {
    /// A drive right to this goal, which looks around for [`LOOK_S`] after it was blocked.
    #[must_use]
    pub fn to(goal: Point, speed_mps: f64) -> Self {
        Self {
            goal,
            stop_m: 0.0,
            speed_mps,
            look_s: LOOK_S,
        }
    }
}

impl Drive {
    /// Stands still.
    #[must_use]
    pub fn stay(&self, cars: &Cars<'_>) -> Action {
        self.move_to(cars.location(), 0.0)
    }

    /// A step of a random walk: straight on, with a new heading when its time has come, after the robot was blocked, and
    /// at the edge of the field.
    pub fn wander(
        &mut self,
        cars: &Cars<'_>,
        speed_mps: f64,
        turn_mean_s: f64,
        chance: &mut Chance,
    ) -> Action {
        self.turn_s -= cars.tick_s();
        let mut turns = self.turn_s <= 0.0 || cars.was_blocked();
        let step_m = speed_mps * cars.tick_s();

        for _ in 0..WALK_TRIES {
            if turns {
                self.heading = chance.direction();
                self.turn_s = chance.around(turn_mean_s);
            }
            let target = stepped(cars.location(), self.heading, step_m);
            if is_on_field(cars, target) {
                return self.move_to(target, speed_mps);
            }
            turns = true;
        }
        self.stay(cars)
    }

    /// A step of a straight drive. For a while after it was blocked the robot looks around first, and steps aside if a
    /// body is in the way.
    pub fn follow(&mut self, cars: &mut Cars<'_>, course: StraightDrive) -> Action {
        let here = cars.location();
        let tick_s = cars.tick_s();
        if cars.was_blocked() {
            self.careful_s = course.look_s.max(tick_s);
        }

        let distance_m = here.distance_m(course.goal);
        let step_m = (course.speed_mps * tick_s).min(distance_m - course.stop_m);
        if step_m <= 0.0 {
            return self.stay(cars);
        }
        let straight = (
            (course.goal.x - here.x) / distance_m,
            (course.goal.y - here.y) / distance_m,
        );
        if self.careful_s <= 0.0 {
            return self.step(here, straight, step_m, tick_s);
        }

        self.careful_s -= tick_s;
        let bodies = cars.bodies();
        // A narrow gap may take a short step where a long one does not fit.
        for share in SHARES {
            let short_m = step_m * share;
            if let Some(heading) = self.free_heading(cars, bodies, straight, short_m) {
                return self.step(here, heading, short_m, tick_s);
            }
        }
        self.stay(cars)
    }

    fn step(&mut self, here: Point, heading: (f64, f64), step_m: f64, tick_s: f64) -> Action {
        self.heading = heading;
        self.move_to(stepped(here, heading, step_m), step_m / tick_s)
    }

    /// A move along the present heading.
    fn move_to(&self, proposal: Point, speed_mps: f64) -> Action {
        Action {
            proposal,
            speed_mps,
            direction_rad: libm::atan2(self.heading.1, self.heading.0),
            ..Action::default()
        }
    }

    /// The heading nearest to the straight one whose step is free. Of two that are equally near, the one on the side
    /// that was free last.
    fn free_heading(
        &mut self,
        cars: &Cars<'_>,
        bodies: &[SensedBody],
        straight: (f64, f64),
        step_m: f64,
    ) -> Option<(f64, f64)> {
        let here = cars.location();
        if is_free(cars, bodies, stepped(here, straight, step_m)) {
            return Some(straight);
        }

        for (cos, sin) in OFFSETS {
            for side in [self.side, -self.side] {
                let heading = turned(straight, cos, side * sin);
                if is_free(cars, bodies, stepped(here, heading, step_m)) {
                    self.side = side;
                    return Some(heading);
                }
            }
        }

        None
    }
}

/// Whether a body with this center is on the field and overlaps no other.
fn is_free(cars: &Cars<'_>, bodies: &[SensedBody], center: Point) -> bool {
    let apart_m = cars.welcome().body_m - TOUCH_M;
    is_on_field(cars, center)
        && bodies.iter().all(|body| {
            (body.location.x - center.x).abs() >= apart_m
                || (body.location.y - center.y).abs() >= apart_m
        })
}

fn stepped(at: Point, heading: (f64, f64), step_m: f64) -> Point {
    Point::new(at.x + heading.0 * step_m, at.y + heading.1 * step_m)
}

fn turned((x, y): (f64, f64), cos: f64, sin: f64) -> (f64, f64) {
    (x * cos - y * sin, x * sin + y * cos)
}

/// Whether a body with this center lies inside the field.
fn is_on_field(cars: &Cars<'_>, center: Point) -> bool {
    let welcome = cars.welcome();
    let margin_m = welcome.body_m / 2.0 - TOUCH_M;
    let [width_m, height_m] = welcome.field_m;
    (margin_m..=width_m - margin_m).contains(&center.x)
        && (margin_m..=height_m - margin_m).contains(&center.y)
}
