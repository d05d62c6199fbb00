//! The way of a body from one place to another, on which it may turn.

use std::f64::consts::PI;

use crate::footprint::Footprint;
use crate::point::Point;
use crate::shape::Shape;

/// Most that a body turns in a part of its way, rad. The parts of a way are tested a little wider than the body is: 4 mm for a body
/// whose corners are half a meter from its center.
const PART_RAD: f64 = 1.0 / 64.0;

/// A straight way on which a body turns evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    /// Its beginning.
    pub(crate) from: Point,
    /// Its end.
    pub(crate) to: Point,
    /// The body at its end.
    pub(crate) footprint: Footprint,
    /// How far the body turns, rad; less than 0 clockwise.
    pub(crate) turn_rad: f64,
}

impl Sweep {
    /// The way of a body that keeps its heading.
    pub(crate) fn straight(footprint: Footprint, from: Point, to: Point) -> Self {
        Self {
            from,
            to,
            footprint,
            turn_rad: 0.0,
        }
    }

    /// Calls `visit` with parts of the way that contain all of it, in which the body keeps its heading: the body, and where it moves
    /// from and to.
    pub(crate) fn visit_parts(&self, mut visit: impl FnMut(Footprint, Point, Point)) {
        let radius_m = self.footprint.radius_m();
        let turn_rad = self.turn_rad.abs();
        let is_disc = matches!(self.footprint.shape(), Shape::Disc { .. });
        if turn_rad == 0.0 || is_disc {
            visit(self.footprint, self.from, self.to);
            return;
        }
        // Half a turn has a rectangle in every direction.
        if turn_rad >= PI {
            visit(Shape::Disc { radius_m }.into(), self.from, self.to);
            return;
        }

        let parts = (turn_rad / PART_RAD).ceil();
        let part_rad = self.turn_rad / parts;
        // No point of the body is farther from where it is in the middle of a part.
        let margin_m = radius_m * part_rad.abs() * 0.5;
        let path = self.to - self.from;
        for index in 0..parts as u32 {
            let done = f64::from(index);
            let back_rad = part_rad * (parts - done - 0.5);
            let middle = self.footprint.rotated(-back_rad).grown(margin_m);
            let from = self.from + path * (done / parts);
            let to = self.from + path * ((done + 1.0) / parts);
            visit(middle, from, to);
        }
        visit(self.footprint, self.to, self.to);
    }
}
