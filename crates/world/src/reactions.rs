//! What guests near a robot do instead of walking on: they make way for it, or come to it.
//!
//! Not documented in the paper, whose guests only walk \[chosen here\]. A reaction takes the place of a step, not of a
//! course: the course goes on underneath and its duration counts down, so that the guests' draws do not depend on robots.

use crate::bodies::{Bodies, Body};
use crate::limits::TOLERANCE_M;
use crate::point::Point;

/// What guests near a robot do in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction {
    /// The robot, by index.
    pub robot: usize,
    /// Guests whose centers are at most this far from the robot's center react, m.
    pub range_m: f64,
    /// What they do.
    pub response: Response,
    /// Only this guest reacts; all in the range without it.
    pub guest: Option<usize>,
}

/// What a guest does at a robot, at the speed of its course.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Steps aside, at a right angle to where the robot means to move, if it stands in the robot's way: ahead of it, and less
    /// than two bodies from its line. From a robot that means to stay, it steps straight away.
    MakeWay,
    /// Stays where it is.
    Stay,
    /// Comes straight to the robot, until the centers are two bodies apart, and stays there.
    Approach,
}

/// The direction in which each guest steps, as a vector of length 1, or 0 where it stays; `None` for those that walk on.
///
/// `headings` are the displacements that the robots propose. A guest in the range of several robots reacts to the nearest
/// one, and among equally near ones to the first in the list.
pub(crate) fn directions(
    bodies: &Bodies,
    reactions: &[Reaction],
    headings: &[Point],
) -> Vec<Option<Point>> {
    let mut nearest: Vec<Option<(f64, Reaction)>> = vec![None; bodies.guests().len()];
    for &reaction in reactions {
        let center = bodies.robots()[reaction.robot];
        for near in bodies.near(center, reaction.range_m) {
            let Body::Guest(guest) = near.body else {
                continue;
            };
            if reaction.guest.is_some_and(|only| only != guest) {
                continue;
            }
            let distance_m2 = (near.center - center).length_squared();
            if nearest[guest].is_none_or(|(least_m2, _)| distance_m2 < least_m2) {
                nearest[guest] = Some((distance_m2, reaction));
            }
        }
    }

    let reacting = nearest.into_iter().enumerate();
    let directions = reacting.map(|(guest, reaction)| {
        let (
            _,
            Reaction {
                robot, response, ..
            },
        ) = reaction?;
        let offset = bodies.guests()[guest] - bodies.robots()[robot];
        response.direction(offset, headings[robot], bodies.field().body_m)
    });
    directions.collect()
}

impl Response {
    /// `offset` is where the guest stands as seen from the robot, m.
    fn direction(self, offset: Point, heading: Point, body_m: f64) -> Option<Point> {
        match self {
            Self::Stay => Some(Point::default()),
            Self::Approach => {
                let is_there = offset.length_squared() <= 4.0 * body_m * body_m;
                if is_there {
                    Some(Point::default())
                } else {
                    unit(offset).map(|away| away * -1.0)
                }
            }
            Self::MakeWay => {
                let Some(ahead) = unit(heading) else {
                    return unit(offset);
                };
                let left = Point::new(-ahead.y, ahead.x);
                let ahead_m = offset.dot(ahead);
                let left_m = offset.dot(left);
                let is_in_the_way = ahead_m > 0.0 && left_m.abs() < 2.0 * body_m;
                is_in_the_way.then(|| left * if left_m < 0.0 { -1.0 } else { 1.0 })
            }
        }
    }
}

/// The vector of length 1 in a direction; `None` for a displacement that is too short to have one.
fn unit(displacement: Point) -> Option<Point> {
    let length_m = displacement.length();
    (length_m > TOLERANCE_M).then(|| displacement * (1.0 / length_m))
}
