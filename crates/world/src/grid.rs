//! A uniform grid over the field that finds the bodies near a place.
//!
//! It exists so that the cost of a tick grows with the number of bodies and not with its square. A cell holds a
//! chain of body numbers, kept in two flat vectors, so that a move allocates nothing. The order within a chain
//! depends on who came when; no caller may let it show (each takes a minimum or sorts).

use crate::point::Point;

/// No body: the end of a chain.
const NONE: u32 = u32::MAX;

/// A cell is as large as a body, so that a body meets only those in its own cell and the eight around it. Cells
/// are larger only where there would be more of them than this (4 MB; bodies of 2 ft on a field of 600 m) and
/// more than [`CELLS_PER_BODY`].
const CELLS: u64 = 1 << 20;

/// Keeps the memory linear in the number of bodies; at 16, chance brings two of them into one cell rarely.
const CELLS_PER_BODY: u64 = 16;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    columns: usize,
    rows: usize,
    cells_per_m: (f64, f64),
    /// For each cell, row by row, the first body of its chain.
    heads: Vec<u32>,
    /// For each body the next one in its cell.
    next: Vec<u32>,
    /// For each body its cell.
    cell: Vec<u32>,
}

impl Grid {
    /// An empty grid over a field of this size for `bodies` bodies, which will be numbered from 0.
    pub(crate) fn new(size_m: (f64, f64), body_m: f64, bodies: usize) -> Self {
        let (columns, rows) = shape(size_m, body_m, CELLS.max(CELLS_PER_BODY * bodies as u64));
        Self {
            columns,
            rows,
            cells_per_m: (columns as f64 / size_m.0, rows as f64 / size_m.1),
            heads: vec![NONE; columns * rows],
            next: Vec::with_capacity(bodies),
            cell: Vec::with_capacity(bodies),
        }
    }

    /// Adds the body with the next number.
    pub(crate) fn push(&mut self, center: Point) {
        let cell = self.cell_of(center);
        let id = self.next.len() as u32;
        self.next.push(self.heads[cell]);
        self.cell.push(cell as u32);
        self.heads[cell] = id;
    }

    /// Removes the body with the highest number.
    pub(crate) fn pop(&mut self) {
        if !self.next.is_empty() {
            self.unlink(self.next.len() - 1);
            self.next.pop();
            self.cell.pop();
        }
    }

    /// Notes that a body is now at `center`.
    pub(crate) fn relocate(&mut self, id: usize, center: Point) {
        let cell = self.cell_of(center);
        if cell as u32 != self.cell[id] {
            self.unlink(id);
            self.next[id] = self.heads[cell];
            self.cell[id] = cell as u32;
            self.heads[cell] = id as u32;
        }
    }

    /// Calls `visit` with every body whose center is within `reach_m` of `center` along both axes, and with
    /// some beyond; in no particular order.
    pub(crate) fn visit_around(&self, center: Point, reach_m: f64, mut visit: impl FnMut(usize)) {
        // The same rounding, monotone function numbers the cells of bodies and of the window's edges, so no
        // body inside the window can be in a cell outside it.
        let (left, right) = (
            self.column(center.x - reach_m),
            self.column(center.x + reach_m),
        );
        let (bottom, top) = (self.row(center.y - reach_m), self.row(center.y + reach_m));
        for row in bottom..=top {
            for &head in &self.heads[row * self.columns + left..=row * self.columns + right] {
                let mut id = head;
                while id != NONE {
                    visit(id as usize);
                    id = self.next[id as usize];
                }
            }
        }
    }

    fn unlink(&mut self, id: usize) {
        let after = self.next[id];
        let head = &mut self.heads[self.cell[id] as usize];
        if *head == id as u32 {
            *head = after;
            return;
        }
        let mut before = *head as usize;
        while self.next[before] != id as u32 {
            before = self.next[before] as usize;
        }
        self.next[before] = after;
    }

    fn cell_of(&self, center: Point) -> usize {
        self.row(center.y) * self.columns + self.column(center.x)
    }

    // A conversion from f64 saturates, so what lies left of the field is in column 0; by way of u32 it takes
    // fewer instructions.
    fn column(&self, x_m: f64) -> usize {
        ((x_m * self.cells_per_m.0) as u32 as usize).min(self.columns - 1)
    }

    fn row(&self, y_m: f64) -> usize {
        ((y_m * self.cells_per_m.1) as u32 as usize).min(self.rows - 1)
    }
}

/// Columns and rows of cells at least as large as a body, at most `cells` of them.
fn shape(size_m: (f64, f64), body_m: f64, cells: u64) -> (usize, usize) {
    let along = |side_m: f64| ((side_m / body_m) as u64).max(1);
    let (mut columns, mut rows) = (along(size_m.0), along(size_m.1));
    while columns * rows > cells {
        if columns >= rows {
            columns = columns.div_ceil(2);
        } else {
            rows = rows.div_ceil(2);
        }
    }
    (columns as usize, rows as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(grid: &Grid, center: Point, reach_m: f64) -> Vec<usize> {
        let mut ids = Vec::new();
        grid.visit_around(center, reach_m, |id| ids.push(id));
        ids.sort_unstable();
        ids
    }

    #[test]
    fn finds_across_cells_and_edges() {
        let mut grid = Grid::new((10.0, 10.0), 1.0, 3);
        for center in [
            Point::new(0.5, 0.5),
            Point::new(1.5, 0.5),
            Point::new(9.5, 9.5),
        ] {
            grid.push(center);
        }
        assert_eq!(found(&grid, Point::new(1.0, 1.0), 0.6), [0, 1]);
        assert_eq!(found(&grid, Point::new(-100.0, -100.0), 1.0), [0]);
        assert_eq!(found(&grid, Point::new(5.0, 5.0), f64::INFINITY), [0, 1, 2]);
        grid.relocate(1, Point::new(8.5, 9.5));
        assert_eq!(found(&grid, Point::new(9.0, 9.0), 0.6), [1, 2]);
        grid.pop();
        assert_eq!(found(&grid, Point::new(9.0, 9.0), 0.6), [1]);
    }

    #[test]
    fn chains_survive_any_order_of_leaving() {
        for order in [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ] {
            let mut grid = Grid::new((10.0, 10.0), 1.0, 3);
            (0..3).for_each(|_| grid.push(Point::new(2.5, 2.5)));
            for (gone, id) in order.into_iter().enumerate() {
                assert_eq!(found(&grid, Point::new(2.5, 2.5), 0.1).len(), 3 - gone);
                grid.relocate(id, Point::new(7.5, 7.5));
            }
            assert_eq!(found(&grid, Point::new(7.5, 7.5), 0.1), [0, 1, 2]);
        }
    }

    #[test]
    fn memory_is_bounded_whatever_the_field() {
        for size_m in [(1e6, 1e6), (1e6, 1e-3), (1e-3, 1e6), (3.0, 7e5)] {
            let (columns, rows) = shape(size_m, 1e-3, CELLS);
            assert!(
                columns >= 1 && rows >= 1 && (columns * rows) as u64 <= CELLS,
                "{columns} {rows}"
            );
        }
        assert_eq!(shape((50.0, 50.0), 2.0, CELLS), (25, 25));
    }
}
