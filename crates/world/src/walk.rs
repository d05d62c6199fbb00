//! What moves the guests of a run: one trait, and what it is done to.

use crate::bodies::{Blocker, Bodies, Body};
use crate::hall::Field;
use crate::point::Point;
use crate::shape::Wall;
use rand::Rng;

/// Moves the guests, tick by tick. What a walk does is a function of its state, the floor and what it draws.
///
/// A walk that needs finer steps than a tick takes them by itself, and moves each guest once.
pub(crate) trait GuestWalker {
    /// Has the guests enter that are on the field at the beginning. By default guests are placed already, and stay.
    fn begin(&mut self, _floor: &mut GuestFloor<'_>, _rng: &mut dyn Rng) {}

    /// Draws anew what follows from numbers that were drawn before. By default nothing does.
    fn reseed(&mut self, _rng: &mut dyn Rng) {}

    /// Moves every guest by one tick, in index order. Robots have moved.
    fn advance(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng);
}

/// What became of the guests in the last tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GuestOutcomes {
    /// What blocked each guest, by index.
    pub(crate) blockers: Vec<Option<Blocker>>,
    /// Who entered and who left, in the order in which that happened.
    pub(crate) passages: Vec<Passage>,
    /// In all ticks so far: how often a guest was kept from where its walk has it.
    pub(crate) held_ticks: u64,
}

/// A guest that has entered the field or left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Which guest, by index.
    pub guest: usize,
    /// Whether it entered; otherwise it left.
    pub enters: bool,
    /// Where, m.
    pub at: Point,
}

/// The field as a [`GuestWalker`] sees it, and all that a walk can do there.
pub(crate) struct GuestFloor<'a> {
    bodies: &'a mut Bodies,
    directions: &'a [Option<Point>],
    outcomes: &'a mut GuestOutcomes,
    tick_s: f64,
}

impl<'a> GuestFloor<'a> {
    /// `directions` are those of guests that react to a robot; guests without an entry do not.
    pub(crate) fn new(
        bodies: &'a mut Bodies,
        directions: &'a [Option<Point>],
        outcomes: &'a mut GuestOutcomes,
        tick_s: f64,
    ) -> Self {
        Self {
            bodies,
            directions,
            outcomes,
            tick_s,
        }
    }

    pub(crate) fn tick_s(&self) -> f64 {
        self.tick_s
    }

    pub(crate) fn field(&self) -> &Field {
        self.bodies.field()
    }

    pub(crate) fn obstacles(&self) -> &[Point] {
        self.bodies.obstacles()
    }

    pub(crate) fn walls(&self) -> &[Wall] {
        self.bodies.walls()
    }

    pub(crate) fn robots(&self) -> &[Point] {
        self.bodies.robots()
    }

    pub(crate) fn guests(&self) -> &[Point] {
        self.bodies.guests()
    }

    /// Half extents of a body along x and y, m.
    pub(crate) fn half_m(&self, body: Body) -> (f64, f64) {
        self.bodies.footprint(body).half_m()
    }

    /// Where a guest stands, or has stood last.
    pub(crate) fn guest(&self, index: usize) -> Point {
        self.bodies.guests()[index]
    }

    pub(crate) fn is_present(&self, index: usize) -> bool {
        self.bodies.is_present(index)
    }

    /// The direction in which a guest reacts to a robot, of length 1, or 0 if it stays; `None` if it walks on.
    pub(crate) fn direction(&self, index: usize) -> Option<Point> {
        self.directions.get(index).copied().flatten()
    }

    /// Moves a guest by a step if no body is in its way, guests included.
    pub(crate) fn step(&mut self, index: usize, step_m: Point) {
        let moved = self.bodies.advance_guest(index, step_m);
        self.outcomes.blockers[index] = moved.err();
    }

    /// Moves a guest to a place if no body but guests is in its way. Returns whether it is there.
    pub(crate) fn go(&mut self, index: usize, to: Point) -> bool {
        let moved = self.bodies.move_guest_among_guests(index, to);
        self.outcomes.blockers[index] = moved.err();
        moved.is_ok()
    }

    /// Has a guest enter at a place, if no body but guests is there. Returns whether it has.
    pub(crate) fn enter(&mut self, guest: usize, at: Point) -> bool {
        let is_free = self.bodies.enter_guest(guest, at).is_ok();
        if is_free {
            self.pass(guest, true, at);
        }
        is_free
    }

    /// Has a guest leave.
    pub(crate) fn leave(&mut self, guest: usize) {
        let at = self.guest(guest);
        self.bodies.leave_guest(guest);
        self.pass(guest, false, at);
    }

    /// Counts a tick in which a guest was kept from where its walk has it.
    pub(crate) fn hold(&mut self) {
        self.outcomes.held_ticks += 1;
    }

    fn pass(&mut self, guest: usize, enters: bool, at: Point) {
        self.outcomes.blockers[guest] = None;
        self.outcomes.passages.push(Passage { guest, enters, at });
    }
}
