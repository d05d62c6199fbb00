//! Guests who avoid each other, robots and what stands in their way as people do \[chosen here\]: the models of crate `crowd`.
//!
//! What a guest wants is what the random walk of the paper has it do, drawn as ever: a direction and a speed for a while. How it
//! gets there is the model's. Guests are discs that fit into the squares of the hall; robots, obstacles, walls and the edge are
//! tested as for all bodies, so a model cannot lead a guest into one.

use crate::bodies::Body;
use crate::error::HallError;
use crate::guests::RandomWalk;
use crate::hall::Hall;
use crate::point::Point;
use crate::walk::{GuestFloor, GuestWalker};
use crowd::{
    CollisionFree, CrowdError, Disc, Itinerary, Pedestrian, Pedestrians, Premises, SocialForce,
    Surroundings, Vector, WalkingModel, WallLine,
};
use rand::Rng;

/// Directions in which guests want to walk: whole degrees.
const DIRECTIONS: u16 = 360;
/// Largest side of a body, m: larger people the models do not have.
const BODY_MAX_M: f64 = 1.8;

/// A model of how people walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrowdModel {
    /// The collision-free speed model (Tordeux, Chraibi, Seyfried 2016).
    CollisionFree,
    /// The social force model (Helbing, Farkas, Vicsek 2000).
    SocialForce,
}

/// Either model, so that a crowd has one type.
#[derive(Clone, Debug)]
enum EitherModel {
    CollisionFree(CollisionFree),
    SocialForce(SocialForce),
}

impl EitherModel {
    fn chosen(&self) -> &dyn WalkingModel {
        match self {
            Self::CollisionFree(model) => model,
            Self::SocialForce(model) => model,
        }
    }
}

impl WalkingModel for EitherModel {
    fn reach_m(&self) -> f64 {
        self.chosen().reach_m()
    }

    fn longest_step_s(&self) -> f64 {
        self.chosen().longest_step_s()
    }

    fn body_radius_m(&self) -> f64 {
        self.chosen().body_radius_m()
    }

    fn velocity(&self, seen: &Surroundings<'_>) -> Vector {
        self.chosen().velocity(seen)
    }
}

/// The guests of a run whose walking is a model's.
#[derive(Clone, Debug)]
pub(crate) struct SocialWalk {
    wishes: RandomWalk,
    crowd: Pedestrians<EitherModel>,
    /// Where the robots were in the tick before.
    robots: Vec<Point>,
}

impl PartialEq for SocialWalk {
    /// What a model depends on are its people; their places are those of the bodies.
    fn eq(&self, other: &Self) -> bool {
        let people = |walk: &Self| -> Vec<Option<Pedestrian>> {
            let ids = 0..walk.wishes.courses().len() as u32;
            ids.map(|id| walk.crowd.get(id).copied()).collect()
        };
        self.wishes == other.wishes && self.robots == other.robots && people(self) == people(other)
    }
}

impl SocialWalk {
    /// Guests who have been placed, and their first wishes.
    pub(crate) fn new(
        model: CrowdModel,
        hall: &Hall,
        wishes: RandomWalk,
        floor: &GuestFloor<'_>,
    ) -> Result<Self, HallError> {
        let body_m = hall.field.body_m;
        if body_m > BODY_MAX_M {
            return Err(HallError::OutOfRange {
                name: "body_m of guests who walk by a model",
                value: body_m,
                min: 0.0,
                max: BODY_MAX_M,
            });
        }

        let model = match model {
            CrowdModel::CollisionFree => EitherModel::CollisionFree(CollisionFree::default()),
            CrowdModel::SocialForce => EitherModel::SocialForce(SocialForce::default()),
        };
        let crowd = people(model, floor).map_err(|error| HallError::NoCrowd {
            reason: reason(&error),
        })?;
        Ok(Self {
            wishes,
            crowd,
            robots: floor.robots().to_vec(),
        })
    }

    /// The robots as discs, with the velocities of the tick.
    fn robots(&self, floor: &GuestFloor<'_>) -> Vec<Disc> {
        let mut discs = Vec::with_capacity(self.robots.len());
        for (index, (&now, &before)) in floor.robots().iter().zip(&self.robots).enumerate() {
            let (half_x_m, half_y_m) = floor.half_m(Body::Robot(index));
            discs.push(Disc {
                center: vector(now),
                radius_m: half_x_m.max(half_y_m),
                velocity: vector((now - before) * (1.0 / floor.tick_s())),
            });
        }
        discs
    }
}

impl GuestWalker for SocialWalk {
    fn advance(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng) {
        let robots = self.robots(floor);
        // Robots are where they can be: their coordinates are finite, and so are those of the guests.
        let _are_finite = self.crowd.set_robots(&robots);
        self.robots = floor.robots().to_vec();

        for index in 0..self.wishes.courses().len() {
            let course = self.wishes.next(index, rng);
            let (degrees, desired_mps) = match floor.direction(index) {
                Some(direction) if direction == Point::default() => (0, 0.0),
                Some(direction) => (degrees(direction), course.speed_mps),
                None => (degrees(course.step_m), course.speed_mps),
            };
            let _is_valid = self.crowd.change(index as u32, |person| {
                person.itinerary = degrees;
                person.desired_mps = desired_mps.min(10.0);
            });
        }

        self.crowd.advance(floor.tick_s(), 1);
        for index in 0..self.wishes.courses().len() {
            let Some(person) = self.crowd.get(index as u32) else {
                continue;
            };
            let to = Point::new(person.position.x, person.position.y);
            if !floor.go(index, to) {
                let here = vector(floor.guest(index));
                let _is_valid = self.crowd.change(index as u32, |person| {
                    person.position = here;
                    person.velocity = Vector::ZERO;
                });
            }
        }
    }
}

impl SocialWalk {
    pub(crate) fn wishes(&self) -> &RandomWalk {
        &self.wishes
    }
}

/// The guests who stand on the floor, and what they walk around.
fn people(
    model: EitherModel,
    floor: &GuestFloor<'_>,
) -> Result<Pedestrians<EitherModel>, CrowdError> {
    let half_m = floor.field().body_m / 2.0;
    let (width_m, height_m) = floor.field().size_m;

    // A disc of this radius that does not touch these lines is a square within the edge, and beside the obstacles.
    let mut walls = rectangle(Point::default(), Point::new(width_m, height_m)).to_vec();
    for (index, &at) in floor.obstacles().iter().enumerate() {
        let (half_x_m, half_y_m) = floor.half_m(Body::Obstacle(index));
        let half = Point::new(half_x_m, half_y_m);
        walls.extend(rectangle(at - half, at + half));
    }
    for wall in floor.walls() {
        walls.push(WallLine::new(vector(wall.from), vector(wall.to)));
    }

    let premises = Premises {
        walls,
        ..Premises::default()
    };
    let mut crowd = Pedestrians::new(model, &premises)?;
    for degrees in 0..DIRECTIONS {
        let angle_rad = f64::from(degrees) * std::f64::consts::PI / 180.0;
        let (sin, cos) = libm::sincos(angle_rad);
        crowd.add_itinerary(Itinerary::along(Vector::new(cos, sin)))?;
    }
    for &at in floor.guests() {
        crowd.add(Pedestrian {
            radius_m: half_m,
            desired_mps: 0.0,
            ..Pedestrian::at(vector(at))
        })?;
    }
    Ok(crowd)
}

/// The sides of a rectangle between two corners.
fn rectangle(low: Point, high: Point) -> [WallLine; 4] {
    let corners = [
        Vector::new(low.x, low.y),
        Vector::new(high.x, low.y),
        Vector::new(high.x, high.y),
        Vector::new(low.x, high.y),
    ];
    [0, 1, 2, 3].map(|side| WallLine::new(corners[side], corners[(side + 1) % 4]))
}

/// The whole degrees of a direction, counter-clockwise from +x.
fn degrees(direction: Point) -> u16 {
    let angle_rad = libm::atan2(direction.y, direction.x);
    let degrees = (angle_rad * 180.0 / std::f64::consts::PI).round();
    let positive = if degrees < 0.0 { degrees + 360.0 } else { degrees };
    (positive as u16) % DIRECTIONS
}

fn vector(at: Point) -> Vector {
    Vector::new(at.x, at.y)
}

fn reason(error: &CrowdError) -> &'static str {
    match error {
        CrowdError::TooMany => "there are too many guests, obstacles or walls for it",
        _ => "a place is not a number",
    }
}
