//! What a hall has beside squares of one size: walls, and bodies of a shape of their own.
//!
//! A hall without any has no [`Solids`], and its bodies are tested by their centers alone.

use std::collections::BTreeMap;

use crate::footprint::Footprint;
use crate::hall::Field;
use crate::point::Point;
use crate::shape::{Shape, Wall};
use crate::shapes::Shapes;
use crate::sweep::Sweep;

/// Cells along each side of the index of what stands still.
const CELLS: usize = 64;

/// Walls and shapes, indexed for a hall whose bodies are numbered as in [`Bodies`](crate::bodies::Bodies).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Solids {
    field: Field,
    walls: Vec<Wall>,
    /// Footprints by number of the body; all others are squares.
    footprints: BTreeMap<usize, Footprint>,
    /// The obstacles with a shape of their own.
    obstacles: Vec<(usize, Footprint, Point)>,
    /// The largest half extent of a body that is not among [`Self::obstacles`], m.
    half_max_m: f64,
    /// For each cell, row by row: walls, then obstacles, by their index in one sequence.
    cells: Vec<Vec<u32>>,
}

impl Solids {
    /// `obstacles` are the centers of all obstacles; robots are numbered after them.
    pub(crate) fn new(field: Field, shapes: &Shapes, obstacles: &[Point]) -> Self {
        let mut solids = Self {
            field,
            walls: shapes.walls.clone(),
            footprints: BTreeMap::new(),
            obstacles: Vec::new(),
            half_max_m: field.body_m * 0.5,
            cells: vec![Vec::new(); CELLS * CELLS],
        };
        for (&index, &shape) in &shapes.obstacles {
            let footprint = Footprint::from(shape);
            solids.footprints.insert(index, footprint);
            let at = obstacles.get(index).copied().unwrap_or_default();
            solids.obstacles.push((index, footprint, at));
        }
        for &index in shapes.robots.keys().chain(shapes.wheels.keys()) {
            if let Some(footprint) = shapes.robot(index, field.body_m) {
                solids.set_footprint(obstacles.len() + index, footprint);
            }
        }
        solids.fill_cells();
        solids
    }

    /// Gives a body that is no obstacle a footprint.
    pub(crate) fn set_footprint(&mut self, id: usize, footprint: Footprint) {
        // Whatever its heading becomes.
        self.half_max_m = self.half_max_m.max(footprint.radius_m());
        self.footprints.insert(id, footprint);
    }

    fn fill_cells(&mut self) {
        let cell_m = (
            self.field.size_m.0 / CELLS as f64,
            self.field.size_m.1 / CELLS as f64,
        );
        let half_m = (cell_m.0 * 0.5, cell_m.1 * 0.5);

        for (index, wall) in self.walls.iter().enumerate() {
            for cell in cells_between(&self.field, wall.from, wall.to) {
                let column = (cell % CELLS) as f64;
                let row = (cell / CELLS) as f64;
                let center = Point::new((column + 0.5) * cell_m.0, (row + 0.5) * cell_m.1);
                if wall.is_in(center, half_m) {
                    self.cells[cell].push(index as u32);
                }
            }
        }

        for (index, (_, footprint, at)) in self.obstacles.iter().enumerate() {
            let (half_x_m, half_y_m) = footprint.half_m();
            let half = Point::new(half_x_m, half_y_m);
            for cell in cells_between(&self.field, *at - half, *at + half) {
                self.cells[cell].push((self.walls.len() + index) as u32);
            }
        }
    }

    pub(crate) fn walls(&self) -> &[Wall] {
        &self.walls
    }

    pub(crate) fn half_max_m(&self) -> f64 {
        self.half_max_m
    }

    /// The footprint of a body.
    pub(crate) fn footprint(&self, id: usize) -> Footprint {
        let footprint = self.footprints.get(&id).copied();
        footprint.unwrap_or(Shape::square(self.field.body_m).into())
    }

    /// How far the center of a body that moves can be from that of a body of this footprint that it overlaps, m.
    pub(crate) fn reach_m(&self, footprint: Footprint) -> f64 {
        let (half_x_m, half_y_m) = footprint.half_m();
        half_x_m.max(half_y_m) + self.half_max_m
    }

    /// The first wall, or else the first obstacle of a shape of its own, that a body meets on its way.
    pub(crate) fn blocker(&self, way: &Sweep) -> Option<SolidBlocker> {
        let mut first = usize::MAX;
        way.visit_parts(|footprint, from, to| {
            let (half_x_m, half_y_m) = footprint.half_m();
            let half = Point::new(half_x_m, half_y_m);
            let low = Point::new(from.x.min(to.x), from.y.min(to.y)) - half;
            let high = Point::new(from.x.max(to.x), from.y.max(to.y)) + half;

            for cell in cells_between(&self.field, low, high) {
                for &index in &self.cells[cell] {
                    let index = index as usize;
                    if index < first && self.is_met(index, footprint, from, to) {
                        first = index;
                    }
                }
            }
        });

        if first == usize::MAX {
            None
        } else if first < self.walls.len() {
            Some(SolidBlocker::Wall(first))
        } else {
            Some(SolidBlocker::Obstacle(
                self.obstacles[first - self.walls.len()].0,
            ))
        }
    }

    fn is_met(&self, index: usize, footprint: Footprint, from: Point, to: Point) -> bool {
        if let Some(wall) = self.walls.get(index) {
            return footprint.meets(from, to, wall);
        }
        let (_, other, at) = self.obstacles[index - self.walls.len()];
        footprint.overlaps(to, other, at) || footprint.sweeps(from, to, other, at)
    }

    /// The largest x of the walls and of the obstacles of a shape of their own that a square of the field at this center
    /// overlaps, m.
    pub(crate) fn rightmost_x_m(&self, center: Point) -> Option<f64> {
        let square = Footprint::from(Shape::square(self.field.body_m));
        let half_m = self.field.body_m * 0.5;
        let half = Point::new(half_m, half_m);
        let mut rightmost_x_m: Option<f64> = None;

        for cell in cells_between(&self.field, center - half, center + half) {
            for &index in &self.cells[cell] {
                let index = index as usize;
                if !self.is_met(index, square, center, center) {
                    continue;
                }

                let x_m = match self.walls.get(index) {
                    Some(wall) => wall.rightmost_x_m(center.y - half_m, center.y + half_m),
                    None => {
                        let (_, footprint, at) = self.obstacles[index - self.walls.len()];
                        Some(at.x + footprint.half_m().0)
                    }
                };
                // `None` is less than any number.
                if rightmost_x_m < x_m {
                    rightmost_x_m = x_m;
                }
            }
        }
        rightmost_x_m
    }

    /// The numbers of the obstacles of a shape of their own whose bodies are within `range_m` of a point.
    pub(crate) fn obstacles_near(&self, point: Point, range_m: f64) -> Vec<usize> {
        let near = self
            .obstacles
            .iter()
            .filter(|(_, footprint, at)| footprint.distance_m(*at, point) <= range_m);
        near.map(|(id, ..)| *id).collect()
    }
}

/// What [`Solids::blocker`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SolidBlocker {
    /// A wall, by index.
    Wall(usize),
    /// An obstacle, by the number of its body.
    Obstacle(usize),
}

/// The cells of a rectangle between two of its corners.
fn cells_between(field: &Field, one: Point, other: Point) -> impl Iterator<Item = usize> {
    let cell = |at_m: f64, side_m: f64| ((at_m / side_m * CELLS as f64) as usize).min(CELLS - 1);
    let (width_m, height_m) = field.size_m;
    let columns = (
        cell(one.x.min(other.x), width_m),
        cell(one.x.max(other.x), width_m),
    );
    let rows = (
        cell(one.y.min(other.y), height_m),
        cell(one.y.max(other.y), height_m),
    );

    (rows.0..=rows.1)
        .flat_map(move |row| (columns.0..=columns.1).map(move |column| row * CELLS + column))
}
