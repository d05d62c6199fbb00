//! The world and its step function.

use crate::bodies::{Blocker, Bodies, Body, Near};
use crate::error::HallError;
use crate::footprint::Footprint;
use crate::guests::{Course, RandomWalk};
use crate::hall::{Field, Hall};
use crate::limits::TOLERANCE_M;
use crate::placing::{place, place_absent};
use crate::point::Point;
use crate::reactions::{Reaction, directions};
use crate::shape::{Shape, Wall};
use crate::social::{CrowdGuests, SocialWalk};
use crate::tracks::{Recorded, RecordedWalk};
use crate::walk::{GuestFloor, GuestOutcomes, GuestWalker, Passage};
use crate::wheels::{DriveStep, Pose, Velocity, Wheels};
use rand::Rng;
use std::collections::BTreeMap;

/// The outcome of a robot's proposal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoveOutcome {
    /// The robot is at the location it proposed.
    Advanced,
    /// The robot proposed no location and has not moved.
    Stayed,
    /// The proposed location collides, so the robot has not moved (paper, "Obstacles").
    Blocked {
        /// What occupies the proposed location.
        by: Blocker,
    },
    /// The proposed location is farther away than the speed limit allows, so the robot has not moved \[chosen here\].
    TooFast,
    /// A coordinate of the proposed location is NaN or infinite, so the robot has not moved \[chosen here\].
    NotFinite,
}

/// The environment during a run: all bodies, the guests' courses and the guests' random stream.
///
/// `R` is the generator of that stream. A clone is independent, and evolves identically when given the same
/// proposals; cloning saves and restores a world.
#[derive(Clone, Debug, PartialEq)]
pub struct World<R> {
    bodies: Bodies,
    crowd: Crowd,
    outcomes: GuestOutcomes,
    /// Robots with wheels, by index.
    driven: BTreeMap<usize, Driven>,
    tick_s: f64,
    stride_m: f64,
    rng: R,
}

/// What moves the guests.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum GuestWalk {
    /// The random walk of the paper, by [`Hall::guests`].
    #[default]
    Random,
    /// Recorded people, in the place of [`Hall::guests`].
    Recorded(Recorded),
    /// Guests of [`Hall::guests`] who walk by a model.
    Crowd(CrowdGuests),
}

/// The guests, as what moves them has them.
#[derive(Clone, Debug, PartialEq)]
enum Crowd {
    Random(RandomWalk),
    Recorded(RecordedWalk),
    Social(Box<SocialWalk>),
}

impl Crowd {
    fn walk(&mut self) -> &mut dyn GuestWalker {
        match self {
            Self::Random(walk) => walk,
            Self::Recorded(walk) => walk,
            Self::Social(walk) => walk.as_mut(),
        }
    }
}

/// A robot with wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Driven {
    wheels: Wheels,
    shape: Shape,
    pose: Pose,
    /// The velocity that it wants.
    wanted: Velocity,
}

impl<R: Rng> World<R> {
    /// Validates the hall, places its bodies and draws the guests' first courses.
    ///
    /// The [crate] documentation gives the order of the random draws.
    ///
    /// # Errors
    ///
    /// Returns the first [`HallError`] found. Numbers and counts are checked first, then obstacles, robots and
    /// guests.
    pub fn new(hall: &Hall, rng: R) -> Result<Self, HallError> {
        Self::with_guests(hall, GuestWalk::Random, rng)
    }

    /// As [`Self::new`], with guests who are moved by something else than the random walk. For recorded ones at most their start is drawn.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn with_guests(hall: &Hall, walk: GuestWalk, mut rng: R) -> Result<Self, HallError> {
        hall.check()?;

        let (mut bodies, mut crowd) = match walk {
            GuestWalk::Random => {
                let bodies = place(hall, &mut rng)?;
                let walk = RandomWalk::new(hall.guests, hall.tick_s, &mut rng);
                (bodies, Crowd::Random(walk))
            }
            GuestWalk::Crowd(guests) => {
                let mut bodies = place(hall, &mut rng)?;
                let wishes = RandomWalk::new(hall.guests, hall.tick_s, &mut rng);
                let mut outcomes = GuestOutcomes::default();
                let floor = GuestFloor::new(&mut bodies, &[], &mut outcomes, hall.tick_s);
                let walk = SocialWalk::new(guests, hall, wishes, &floor, &mut rng)?;
                (bodies, Crowd::Social(Box::new(walk)))
            }
            GuestWalk::Recorded(recorded) => {
                let count = recorded.tracks.len();
                let bodies = place_absent(hall, count)?;
                (bodies, Crowd::Recorded(RecordedWalk::new(recorded)))
            }
        };

        let mut driven = BTreeMap::new();
        for (&index, wheels) in &hall.shapes.wheels {
            let Some(&center) = hall.robots.get(index) else {
                continue;
            };
            let robot = Driven {
                wheels: wheels.within(hall.max_speed_mps),
                shape: bodies.footprint(Body::Robot(index)).shape(),
                pose: Pose::at_rest(center, wheels.heading_rad),
                wanted: Velocity::default(),
            };
            driven.insert(index, robot);
        }

        let mut outcomes = GuestOutcomes {
            blockers: vec![None; bodies.guests().len()],
            ..GuestOutcomes::default()
        };
        let mut floor = GuestFloor::new(&mut bodies, &[], &mut outcomes, hall.tick_s);
        crowd.walk().begin(&mut floor, &mut rng);

        Ok(Self {
            bodies,
            crowd,
            outcomes,
            driven,
            tick_s: hall.tick_s,
            stride_m: hall.max_speed_mps * hall.tick_s,
            rng,
        })
    }

    /// Has guests draw from another stream from the next tick on. The courses that they are on, and what they want now, stay.
    pub fn reseed(&mut self, rng: R) {
        self.rng = rng;
        self.crowd.walk().reseed(&mut self.rng);
    }

    /// Advances the world by one tick, in which no guest reacts to a robot. See [`World::advance_with`].
    ///
    /// # Panics
    ///
    /// Panics unless there is exactly one proposal for each robot.
    pub fn advance(&mut self, proposals: &[Option<Point>]) -> Vec<MoveOutcome> {
        self.advance_with(proposals, &[])
    }

    /// Advances the world by one tick and returns one verdict for each robot.
    ///
    /// Robots attempt to move to their proposed locations in index order; then guests attempt the next step of
    /// their courses in index order. A proposal of `None` keeps the robot in place. A body can take a location that
    /// another one leaves in the same tick, provided that the other one moves first.
    ///
    /// Guests react to robots where these stand after their moves.
    ///
    /// A robot with [`Wheels`] drives as [`World::drive`] says, whatever its proposal. A blocked one stands still, and turns as far
    /// as it has room to turn: all of the turn, or nothing.
    ///
    /// # Panics
    ///
    /// Panics unless there is exactly one proposal for each robot, and on a reaction to a robot that does not exist.
    pub fn advance_with(
        &mut self,
        proposals: &[Option<Point>],
        reactions: &[Reaction],
    ) -> Vec<MoveOutcome> {
        assert_eq!(
            proposals.len(),
            self.robots().len(),
            "there is one proposal for each robot"
        );

        let drives = self.drives();
        // A robot that is blocked means to move all the same, so where it heads is known before the moves only.
        let headings = match reactions {
            [] => Vec::new(),
            _ => self.headings(proposals, &drives),
        };
        let mut verdicts = Vec::with_capacity(proposals.len());
        for (index, &proposal) in proposals.iter().enumerate() {
            verdicts.push(match drives.get(&index) {
                Some(drive) => self.drive_robot(index, drive),
                None => self.advance_robot(index, proposal),
            });
        }

        let directions = match reactions {
            [] => Vec::new(),
            _ => directions(&self.bodies, reactions, &headings),
        };
        self.outcomes.passages.clear();
        let mut floor = GuestFloor::new(
            &mut self.bodies,
            &directions,
            &mut self.outcomes,
            self.tick_s,
        );
        self.crowd.walk().advance(&mut floor, &mut self.rng);

        verdicts
    }

    /// Where the robots with wheels drive in the tick.
    fn drives(&self) -> BTreeMap<usize, DriveStep> {
        let drive = |driven: &Driven| {
            driven
                .pose
                .drive(&driven.wheels, driven.wanted, self.tick_s)
        };
        let robots = self.driven.iter();
        robots
            .map(|(&index, driven)| (index, drive(driven)))
            .collect()
    }

    /// The displacement that each robot means; none where it proposes no place.
    fn headings(
        &self,
        proposals: &[Option<Point>],
        drives: &BTreeMap<usize, DriveStep>,
    ) -> Vec<Point> {
        let mut headings = Vec::with_capacity(proposals.len());
        for (index, (&at, &proposal)) in self.robots().iter().zip(proposals).enumerate() {
            let to = drives
                .get(&index)
                .map_or(proposal, |drive| Some(drive.pose.center));
            let to = to.filter(|to| to.is_finite());
            headings.push(to.map_or_else(Point::default, |to| to - at));
        }
        headings
    }

    fn drive_robot(&mut self, index: usize, drive: &DriveStep) -> MoveOutcome {
        let Some(driven) = self.driven.get_mut(&index) else {
            return MoveOutcome::Stayed;
        };
        let before = driven.pose;
        if drive.pose.center == before.center && drive.turn_rad == 0.0 {
            driven.pose = drive.pose;
            return MoveOutcome::Stayed;
        }

        let footprint = Footprint::turned(driven.shape, drive.pose.heading_rad);
        let bodies = &mut self.bodies;
        let blocked = bodies.turn_robot(index, drive.pose.center, footprint, drive.turn_rad);
        let Err(by) = blocked else {
            driven.pose = drive.pose;
            return MoveOutcome::Advanced;
        };

        let has_room = bodies.turn_robot(index, before.center, footprint, drive.turn_rad);
        driven.pose = match has_room {
            Ok(()) => Pose {
                center: before.center,
                velocity: Velocity {
                    linear_mps: 0.0,
                    ..drive.pose.velocity
                },
                ..drive.pose
            },
            Err(_) => Pose {
                velocity: Velocity::default(),
                ..before
            },
        };
        MoveOutcome::Blocked { by }
    }

    fn advance_robot(&mut self, index: usize, proposal: Option<Point>) -> MoveOutcome {
        let Some(to) = proposal else {
            return MoveOutcome::Stayed;
        };
        if !to.is_finite() {
            return MoveOutcome::NotFinite;
        }

        let distance_m = self.robots()[index].distance_m(to);
        if distance_m > self.stride_m + TOLERANCE_M {
            return MoveOutcome::TooFast;
        }

        match self.bodies.advance_robot(index, to) {
            Ok(()) => MoveOutcome::Advanced,
            Err(by) => MoveOutcome::Blocked { by },
        }
    }
}

impl<R> World<R> {
    /// Has a robot with [`Wheels`] want a velocity from the next tick on. At first it wants none. Without effect on other robots.
    pub fn drive(&mut self, robot: usize, wanted: Velocity) {
        if let Some(driven) = self.driven.get_mut(&robot) {
            driven.wanted = wanted;
        }
    }

    /// A guest has got something from a robot. One that [wants](crate::WantTarget::Robot) that wants something else from the next tick on.
    pub fn satisfy(&mut self, guest: usize, robot: usize) {
        if let Crowd::Social(walk) = &mut self.crowd {
            walk.satisfy(guest, robot);
        }
    }

    /// How many threads walk large crowds of guests by a model, 1 at first. Nothing else depends on it.
    pub fn set_threads(&mut self, threads: usize) {
        if let Crowd::Social(walk) = &mut self.crowd {
            walk.set_threads(threads);
        }
    }

    /// The field and the size of bodies.
    #[must_use]
    pub fn field(&self) -> &Field {
        self.bodies.field()
    }

    /// Length of a tick, in simulated seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.tick_s
    }

    /// Maximum distance that a robot can move in one tick, m, within [`TOLERANCE_M`].
    #[must_use]
    pub fn stride_m(&self) -> f64 {
        self.stride_m
    }

    /// Centers of the fixed obstacles, m, in the hall's order.
    #[must_use]
    pub fn obstacles(&self) -> &[Point] {
        self.bodies.obstacles()
    }

    /// Centers of the robots, m, in the hall's order.
    #[must_use]
    pub fn robots(&self) -> &[Point] {
        self.bodies.robots()
    }

    /// Centers of the guests, m, by index. One that [`Self::is_present`] denies is where it has been last.
    #[must_use]
    pub fn guests(&self) -> &[Point] {
        self.bodies.guests()
    }

    /// Whether a guest is on the field.
    #[must_use]
    pub fn is_present(&self, guest: usize) -> bool {
        self.bodies.is_present(guest)
    }

    /// Whether guests enter and leave; otherwise all are on the field all the time.
    #[must_use]
    pub fn has_passages(&self) -> bool {
        match &self.crowd {
            Crowd::Random(_) => false,
            Crowd::Social(walk) => walk.has_exits(),
            Crowd::Recorded(_) => true,
        }
    }

    /// The guests that are on the field and their centers, m, in index order.
    pub fn present_guests(&self) -> impl Iterator<Item = (usize, Point)> + '_ {
        let all = self.guests().iter().copied().enumerate();
        all.filter(|(guest, _)| self.is_present(*guest))
    }

    /// Who has entered the field or left it in the last tick, or entered before the first one, in the order in which it happened.
    #[must_use]
    pub fn passages(&self) -> &[Passage] {
        &self.outcomes.passages
    }

    /// In how many ticks so far recorded people were kept from where the record has them, summed over people.
    #[must_use]
    pub fn held_ticks(&self) -> u64 {
        self.outcomes.held_ticks
    }

    /// The walls, in the hall's order.
    #[must_use]
    pub fn walls(&self) -> &[Wall] {
        self.bodies.walls()
    }

    /// The shape of a body. One that does not exist is a square of the field.
    #[must_use]
    pub fn shape(&self, body: Body) -> Shape {
        self.footprint(body).shape()
    }

    /// The shape of a body as it lies.
    #[must_use]
    pub fn footprint(&self, body: Body) -> Footprint {
        self.bodies.footprint(body)
    }

    /// The pose of a robot with [`Wheels`]; `None` for another robot.
    #[must_use]
    pub fn pose(&self, robot: usize) -> Option<Pose> {
        Some(self.driven.get(&robot)?.pose)
    }

    /// The largest half extent of a body that moves, or of an obstacle without a shape of its own, m.
    pub(crate) fn half_max_m(&self) -> f64 {
        self.bodies.half_max_m()
    }

    /// The guests' courses, by index; none of guests that are not on a random walk.
    #[must_use]
    pub fn courses(&self) -> &[Course] {
        match &self.crowd {
            Crowd::Random(walk) => walk.courses(),
            Crowd::Social(walk) => walk.wishes().courses(),
            Crowd::Recorded(_) => &[],
        }
    }

    /// What blocked each guest in the last tick, by index.
    ///
    /// `None` if the guest advanced, or if no tick has run yet.
    #[must_use]
    pub fn guest_blockers(&self) -> &[Option<Blocker>] {
        &self.outcomes.blockers
    }

    /// All bodies whose center is at most `range_m` from `point`, in the order of [`Body`](crate::Body): by kind,
    /// then by index.
    ///
    /// An obstacle with a shape of its own is near where any part of it is.
    ///
    /// The result includes a body centered at `point` itself. It is empty if `point` is not finite or if `range_m`
    /// is negative or NaN. An infinite range returns every body.
    #[must_use]
    pub fn near(&self, point: Point, range_m: f64) -> Vec<Near> {
        self.bodies.near(point, range_m)
    }
}
