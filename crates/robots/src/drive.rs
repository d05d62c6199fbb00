//! How a robot moves: a random walk, straight drives around whoever stands in the way, standing still.
//!
//! What reaches the wire is made by + - * / and the square root alone, which are the same on every machine and in every
//! language; a heading is a unit vector and never an angle. The seed leaves to the robots what they do about a
//! collision; the ways here are chosen \[I\].

use robot::{Cars, Percept, Point};
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

/// How deep two bodies may overlap and still count as touching, meters; as the collision rule has it.
const TOUCH_M: f64 = 1e-9;

/// New headings tried in a tick before a walker stays where it is \[I\].
const WALK_TRIES: u32 = 8;

/// Where a robot is heading, and how it got past the last obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Legs {
    heading: (f64, f64),
    speed_mps: f64,
    /// The side on which it last found a way: 1 for left, -1 for right.
    side: f64,
    /// For how long it goes on looking around before each step, seconds.
    careful_s: f64,
    /// When the walk turns next, seconds.
    turn_s: f64,
}

impl Default for Legs {
    fn default() -> Self {
        Self {
            heading: (1.0, 0.0),
            speed_mps: 0.0,
            side: 1.0,
            careful_s: 0.0,
            turn_s: 0.0,
        }
    }
}

/// A straight drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Where to.
    pub goal: Point,
    /// How near is near enough, meters.
    pub stop_m: f64,
    /// How fast, m/s.
    pub speed_mps: f64,
    /// For how long to look around before each step after one was refused, seconds.
    pub look_s: f64,
}

impl Legs {
    /// Magnitude of the motion that was decided last, m/s.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Its direction, radians.
    #[must_use]
    pub fn direction_rad(&self) -> f64 {
        libm::atan2(self.heading.1, self.heading.0)
    }

    /// Stands still.
    pub fn stay(&mut self, at: Point) -> Point {
        self.speed_mps = 0.0;
        at
    }

    /// A step of a random walk: straight on, with a new heading when its time has come, when the last step was refused,
    /// or where the field ends.
    pub fn walk(
        &mut self,
        cars: &Cars<'_>,
        at: Point,
        speed_mps: f64,
        turn_mean_s: f64,
        chance: &mut Chance,
    ) -> Point {
        self.turn_s -= cars.tick_s();
        let mut turns = self.turn_s <= 0.0 || cars.was_blocked();
        let step_m = speed_mps * cars.tick_s();
        for _ in 0..WALK_TRIES {
            if turns {
                self.heading = chance.direction();
                self.turn_s = chance.around(turn_mean_s);
            }
            let there = stepped(at, self.heading, step_m);
            if is_on_field(cars, there) {
                self.speed_mps = speed_mps;
                return there;
            }
            turns = true;
        }
        self.stay(at)
    }

    /// A step of a straight drive; for a while after a refused step it looks around first and steps aside where
    /// somebody stands in the way.
    pub fn drive(&mut self, cars: &mut Cars<'_>, at: Point, course: Course) -> Point {
        let tick_s = cars.tick_s();
        if cars.was_blocked() {
            self.careful_s = course.look_s.max(tick_s);
        }
        let away_m = at.distance_m(course.goal);
        let step_m = (course.speed_mps * tick_s).min(away_m - course.stop_m);
        if step_m <= 0.0 {
            return self.stay(at);
        }
        let straight = (
            (course.goal.x - at.x) / away_m,
            (course.goal.y - at.y) / away_m,
        );
        let free = if self.careful_s > 0.0 {
            self.careful_s -= tick_s;
            // Without an answer the epoch is over, and nobody will use the step.
            let percept = cars.percept().unwrap_or_default();
            // A narrow gap may take a short step where a long one does not fit.
            let shorter = SHARES.iter().map(|share| step_m * share);
            shorter.into_iter().find_map(|step_m| {
                let heading = self.free_heading(cars, &percept, at, straight, step_m)?;
                Some((heading, step_m))
            })
        } else {
            Some((straight, step_m))
        };
        let Some((heading, step_m)) = free else {
            return self.stay(at);
        };
        self.heading = heading;
        self.speed_mps = step_m / tick_s;
        stepped(at, heading, step_m)
    }

    /// The heading nearest to the straight one whose step is free, on the side that worked last before the other.
    fn free_heading(
        &mut self,
        cars: &Cars<'_>,
        percept: &Percept,
        at: Point,
        straight: (f64, f64),
        step_m: f64,
    ) -> Option<(f64, f64)> {
        let is_free = |heading| {
            let there = stepped(at, heading, step_m);
            let apart_m = cars.welcome().body_m - TOUCH_M;
            let overlaps = |body: Point| {
                (body.x - there.x).abs() < apart_m && (body.y - there.y).abs() < apart_m
            };
            is_on_field(cars, there) && !percept.bodies.iter().any(|body| overlaps(body.location))
        };
        if is_free(straight) {
            return Some(straight);
        }
        for (cos, sin) in OFFSETS {
            for side in [self.side, -self.side] {
                let heading = turned(straight, cos, side * sin);
                if is_free(heading) {
                    self.side = side;
                    return Some(heading);
                }
            }
        }
        None
    }
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
