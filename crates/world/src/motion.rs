//! The world and its one step.

use crate::bodies::{Blocker, Bodies, Near};
use crate::error::HallError;
use crate::guests::{Course, Crowd};
use crate::hall::{Field, Hall, TOLERANCE_M};
use crate::placing::place;
use crate::point::Point;
use rand::Rng;

/// What became of a robot's proposal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is at the location it proposed.
    Advanced,
    /// It proposed nothing and is where it was.
    Stayed,
    /// It collided and is where it was (seed, "Obstacles").
    Blocked {
        /// With what.
        by: Blocker,
    },
    /// It proposed a location farther than its speed limit allows, and is where it was \[chosen here\].
    TooFast,
    /// It proposed a location that is not a pair of numbers, and is where it was \[chosen here\].
    NotFinite,
}

/// The environment during a run: all bodies, the guests' courses and the guests' random stream.
///
/// `R` is the generator of that stream. A clone is an independent world that goes on alike, given the same
/// proposals; it serves to save and to restore.
#[derive(Clone, Debug, PartialEq)]
pub struct World<R> {
    bodies: Bodies,
    crowd: Crowd,
    tick_s: f64,
    stride_m: f64,
    rng: R,
}

impl<R: Rng> World<R> {
    /// Checks the hall, places its bodies and draws the guests' first courses (see the [crate] for the order).
    ///
    /// # Errors
    ///
    /// The first [`HallError`] found: numbers and counts first, then obstacles, then robots, then guests.
    pub fn new(hall: &Hall, mut rng: R) -> Result<Self, HallError> {
        hall.check()?;
        let bodies = place(hall, &mut rng)?;
        let crowd = Crowd::new(hall.guests, hall.tick_s, &mut rng);
        let stride_m = hall.max_speed_mps * hall.tick_s;
        Ok(Self {
            bodies,
            crowd,
            tick_s: hall.tick_s,
            stride_m,
            rng,
        })
    }

    /// One tick: robots in index order attempt the locations they propose, then guests in index order the next
    /// step of their courses. Returns one verdict for each robot.
    ///
    /// `None` means that a robot does not move. A place may be taken in the tick in which its owner leaves it,
    /// if the owner comes first in the order.
    ///
    /// # Panics
    ///
    /// If there is not exactly one proposal for each robot.
    pub fn advance(&mut self, proposals: &[Option<Point>]) -> Vec<Verdict> {
        assert_eq!(
            proposals.len(),
            self.robots().len(),
            "there is one proposal for each robot"
        );
        let verdicts = proposals
            .iter()
            .enumerate()
            .map(|(index, to)| self.advance_robot(index, *to))
            .collect();
        self.crowd.advance(&mut self.bodies, &mut self.rng);
        verdicts
    }

    fn advance_robot(&mut self, index: usize, proposal: Option<Point>) -> Verdict {
        let Some(to) = proposal else {
            return Verdict::Stayed;
        };
        if !to.is_finite() {
            return Verdict::NotFinite;
        }
        if self.robots()[index].distance_m(to) > self.stride_m + TOLERANCE_M {
            return Verdict::TooFast;
        }
        match self.bodies.advance_robot(index, to) {
            Ok(()) => Verdict::Advanced,
            Err(by) => Verdict::Blocked { by },
        }
    }
}

impl<R> World<R> {
    /// The field and the size of bodies.
    #[must_use]
    pub fn field(&self) -> &Field {
        self.bodies.field()
    }

    /// Length of a tick, simulated seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.tick_s
    }

    /// How far a robot may go in one tick, m (within [`TOLERANCE_M`]).
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

    /// Centers of the guests, m, by index.
    #[must_use]
    pub fn guests(&self) -> &[Point] {
        self.bodies.guests()
    }

    /// The guests' courses, by index.
    #[must_use]
    pub fn courses(&self) -> &[Course] {
        self.crowd.courses()
    }

    /// For each guest, what blocked it in the last tick; `None` if it advanced, and before the first tick.
    #[must_use]
    pub fn guest_blockers(&self) -> &[Option<Blocker>] {
        self.crowd.blockers()
    }

    /// All bodies whose center is at most `range_m` from `point`, in the order of [`Body`](crate::Body): by
    /// kind, then by index.
    ///
    /// A body that stands at `point` itself is among them. A `point` that is not finite, or a `range_m` that is
    /// negative or NaN, finds nothing; an infinite range finds everything.
    #[must_use]
    pub fn near(&self, point: Point, range_m: f64) -> Vec<Near> {
        self.bodies.near(point, range_m)
    }
}
