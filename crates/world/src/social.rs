//! Guests who avoid each other, robots and what stands in their way as people do \[chosen here\]: the models of crate `crowd`.
//!
//! What a guest wants is what the random walk of the paper has it do, drawn as ever: a direction and a speed for a while. With
//! [`Want`]s it is a place, at the speed of that walk. How it gets there is the model's. Guests are discs that fit into the squares of the hall; robots, obstacles, walls and the edge are
//! tested as for all bodies, so a model cannot lead a guest into one.

use crate::bodies::Body;
use crate::error::HallError;
use crate::guests::RandomWalk;
use crate::hall::Hall;
use crate::point::Point;
use crate::walk::{GuestFloor, GuestWalker};
use crate::wants::{GuestStep, Want, Wants};
use crowd::{
    CollisionFree, CrowdError, Disc, Itinerary, Pedestrian, Pedestrians, Premises, SocialForce,
    Surroundings, WalkingModel, WallLine,
};
use rand::Rng;

/// Directions in which guests want to walk: whole degrees.
const DIRECTIONS: u16 = 360;
/// Fewer guests than these are walked by one thread: starting more takes longer than their steps.
const PARALLEL_GUESTS: usize = 20_000;
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

    fn velocity(&self, seen: &Surroundings<'_>) -> Point {
        self.chosen().velocity(seen)
    }
}

/// Guests who walk by a model.
#[derive(Clone, Debug, PartialEq)]
pub struct CrowdGuests {
    /// How they walk.
    pub model: CrowdModel,
    /// What they want, one thing after the other. Without any they want what the random walk by [`Hall::guests`] has them do.
    pub wants: Vec<Want>,
}

/// The guests of a run whose walking is a model's.
#[derive(Clone, Debug)]
pub(crate) struct SocialWalk {
    wishes: RandomWalk,
    wants: Option<Wants>,
    crowd: Pedestrians<EitherModel>,
    /// The number of each guest in the crowd; none of those who are not on the field.
    ids: Vec<Option<u32>>,
    /// Where the robots were in the tick before.
    robots: Vec<Point>,
    /// Threads for large crowds, on which nothing depends but the time that a tick takes.
    threads: usize,
}

impl PartialEq for SocialWalk {
    /// What a model depends on are its people; their places are those of the bodies.
    fn eq(&self, other: &Self) -> bool {
        let are_people_equal = self.ids.iter().zip(&other.ids).all(|(id, other_id)| {
            id.and_then(|id| self.crowd.get(id)) == other_id.and_then(|id| other.crowd.get(id))
        });
        self.wishes == other.wishes
            && self.wants == other.wants
            && self.ids == other.ids
            && self.robots == other.robots
            && are_people_equal
    }
}

impl SocialWalk {
    /// Guests who have been placed, with their first wishes. What they want is drawn, if they want something.
    pub(crate) fn new(
        guests: CrowdGuests,
        hall: &Hall,
        wishes: RandomWalk,
        floor: &GuestFloor<'_>,
        rng: &mut dyn Rng,
    ) -> Result<Self, HallError> {
        let body_m = hall.field.body_m;
        if body_m > BODY_MAX_M {
            return Err(HallError::OutOfRange {
                name: "the size in meters of bodies, [field] body, where guests walk by a model,",
                value: body_m,
                min: 0.0,
                max: BODY_MAX_M,
            });
        }

        let model = match guests.model {
            CrowdModel::CollisionFree => EitherModel::CollisionFree(CollisionFree::default()),
            CrowdModel::SocialForce => EitherModel::SocialForce(SocialForce::default()),
        };
        let crowd = people(model, floor).map_err(|error| HallError::NoCrowd {
            reason: reason(&error),
        })?;
        let count = floor.guests().len();
        Ok(Self {
            wishes,
            wants: Wants::new(guests.wants, count, hall.tick_s, rng),
            crowd,
            ids: (0..count as u32).map(Some).collect(),
            robots: floor.robots().to_vec(),
            threads: 1,
        })
    }

    pub(crate) fn wishes(&self) -> &RandomWalk {
        &self.wishes
    }

    pub(crate) fn has_exits(&self) -> bool {
        self.wants.as_ref().is_some_and(Wants::has_exits)
    }

    pub(crate) fn satisfy(&mut self, guest: usize, robot: usize) {
        if let Some(wants) = &mut self.wants {
            wants.satisfy(guest, robot);
        }
    }

    pub(crate) fn set_threads(&mut self, threads: usize) {
        self.threads = threads;
    }

    /// The robots as discs, with the velocities of the tick.
    fn robots(&self, floor: &GuestFloor<'_>) -> Vec<Disc> {
        let mut discs = Vec::with_capacity(self.robots.len());
        for (index, (&now, &before)) in floor.robots().iter().zip(&self.robots).enumerate() {
            let (half_x_m, half_y_m) = floor.half_m(Body::Robot(index));
            discs.push(Disc {
                center: now,
                radius_m: half_x_m.max(half_y_m),
                velocity: (now - before) * (1.0 / floor.tick_s()),
            });
        }
        discs
    }

    /// Has every guest want what it wants in this tick.
    fn decide(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng) {
        for index in 0..self.ids.len() {
            let course = self.wishes.next(index, rng);
            let step = self.wants.as_mut().map(|wants| wants.step(index, floor));
            let wanted = match step {
                None => course.step_m,
                Some(GuestStep::Go(at)) => at - floor.guest(index),
                Some(GuestStep::Stand) => Point::default(),
                Some(GuestStep::Leave) => {
                    self.leave(index, floor);
                    continue;
                }
                Some(GuestStep::Return(at)) => {
                    self.come_back(index, at, floor);
                    continue;
                }
                Some(GuestStep::Away) => continue,
            };
            let direction = floor.direction(index).unwrap_or(wanted);
            self.head(index, direction, course.speed_mps);
        }
    }

    /// Has a guest walk in a direction; it stands without one.
    fn head(&mut self, index: usize, direction: Point, speed_mps: f64) {
        let is_standing = direction == Point::default();
        self.change(index, |person| {
            person.itinerary = degrees(direction);
            person.desired_mps = if is_standing {
                0.0
            } else {
                speed_mps.min(10.0)
            };
        });
    }

    fn leave(&mut self, index: usize, floor: &mut GuestFloor<'_>) {
        if let Some(id) = self.ids[index].take() {
            self.crowd.remove(id);
        }
        floor.leave(index);
    }

    /// Has a guest be on the field again, if its place is free.
    fn come_back(&mut self, index: usize, at: Point, floor: &mut GuestFloor<'_>) {
        if !floor.enter(index, at) {
            return;
        }
        // After ten million returns a crowd takes nobody more: guests stand where they came in.
        let person = person(at, floor.field().body_m);
        self.ids[index] = self.crowd.add(person).ok();
        if let Some(wants) = &mut self.wants {
            wants.has_returned(index);
        }
    }

    fn change(&mut self, index: usize, change: impl FnOnce(&mut Pedestrian)) {
        if let Some(id) = self.ids[index] {
            // Speeds are at most 10 m/s, and bodies are on the field: such a person can be.
            let _is_valid = self.crowd.change(id, change);
        }
    }
}

impl GuestWalker for SocialWalk {
    fn reseed(&mut self, rng: &mut dyn Rng) {
        if let Some(wants) = &mut self.wants {
            wants.rekey(rng);
        }
    }

    fn advance(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng) {
        let robots = self.robots(floor);
        // Robots are where they can be: their coordinates are finite, and so are those of the guests.
        let _are_finite = self.crowd.set_robots(&robots);
        self.robots = floor.robots().to_vec();

        self.decide(floor, rng);
        let is_large = self.ids.len() >= PARALLEL_GUESTS;
        self.crowd
            .advance(floor.tick_s(), if is_large { self.threads } else { 1 });

        for index in 0..self.ids.len() {
            let Some(person) = self.ids[index].and_then(|id| self.crowd.get(id)) else {
                continue;
            };
            if !floor.go(index, person.position) {
                let here = floor.guest(index);
                self.change(index, |person| {
                    person.position = here;
                    person.velocity = Point::ZERO;
                });
            }
        }
    }
}

/// The guests who stand on the floor, and what they walk around.
fn people(
    model: EitherModel,
    floor: &GuestFloor<'_>,
) -> Result<Pedestrians<EitherModel>, CrowdError> {
    let body_m = floor.field().body_m;
    let (width_m, height_m) = floor.field().size_m;

    // A disc of this radius that does not touch these lines is a square within the edge, and beside the obstacles.
    let mut walls = rectangle(Point::default(), Point::new(width_m, height_m)).to_vec();
    for (index, &at) in floor.obstacles().iter().enumerate() {
        let (half_x_m, half_y_m) = floor.half_m(Body::Obstacle(index));
        let half = Point::new(half_x_m, half_y_m);
        walls.extend(rectangle(at - half, at + half));
    }
    for wall in floor.walls() {
        walls.push(WallLine::new(wall.from, wall.to));
    }

    let premises = Premises {
        walls,
        ..Premises::default()
    };
    let mut crowd = Pedestrians::new(model, &premises)?;
    for degrees in 0..DIRECTIONS {
        let angle_rad = f64::from(degrees) * std::f64::consts::PI / 180.0;
        let (sin, cos) = libm::sincos(angle_rad);
        crowd.add_itinerary(Itinerary::along(Point::new(cos, sin)))?;
    }
    for &at in floor.guests() {
        crowd.add(person(at, body_m))?;
    }
    Ok(crowd)
}

/// A guest who stands at a place.
fn person(at: Point, body_m: f64) -> Pedestrian {
    Pedestrian {
        radius_m: body_m / 2.0,
        desired_mps: 0.0,
        ..Pedestrian::at(at)
    }
}

/// The sides of a rectangle between two corners.
fn rectangle(low: Point, high: Point) -> [WallLine; 4] {
    let corners = [
        Point::new(low.x, low.y),
        Point::new(high.x, low.y),
        Point::new(high.x, high.y),
        Point::new(low.x, high.y),
    ];
    [0, 1, 2, 3].map(|side| WallLine::new(corners[side], corners[(side + 1) % 4]))
}

/// The whole degrees of a direction, counter-clockwise from +x.
fn degrees(direction: Point) -> u16 {
    let angle_rad = libm::atan2(direction.y, direction.x);
    let degrees = (angle_rad * 180.0 / std::f64::consts::PI).round();
    let positive = if degrees < 0.0 {
        degrees + 360.0
    } else {
        degrees
    };
    (positive as u16) % DIRECTIONS
}

fn reason(error: &CrowdError) -> &'static str {
    match error {
        CrowdError::TooMany => "there are too many guests, obstacles or walls for it",
        _ => "a place is not a number",
    }
}
